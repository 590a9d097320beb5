"""A rosbridge server in virtual time: it says what a script has for each instant, and keeps what it is told."""

import json
from collections.abc import Callable
from math import pi
from typing import Any, Final

from steptwin.features.ros2.bridge import RosBridge, RosbridgeLostError
from steptwin.features.ros2.messages import RosNames
from steptwin.host.operate.session import Session
from tests.host.operate.sessions import HOME, ROBOT

NAMES: Final = RosNames.of("arm_controller")
ACTION: Final = "/arm_controller/follow_joint_trajectory"
END: Final = "end"
LOST: Final = "lost"
Does = str | dict[str, Any] | Callable[[], None]


class StubRosbridge:
    """A channel. Each entry of its script is due at an instant: a message, a text, a call, END (Ctrl-C) or LOST."""

    def __init__(self, session: Session, script: list[tuple[float, Does]]) -> None:
        self._now_s = session.link.now_s
        self._begin_s = self._now_s()
        self._script = sorted(script, key=lambda entry: entry[0])
        self.told: list[tuple[float, dict[str, Any]]] = []

    def now_s(self) -> float:
        return self._now_s() - self._begin_s

    def send(self, text: str) -> None:
        self.told.append((self.now_s(), json.loads(text)))

    def received(self) -> list[str | bytes]:
        said: list[str | bytes] = []
        while self._script and self._script[0][0] <= self.now_s():
            _, does = self._script.pop(0)
            if does == LOST:
                raise RosbridgeLostError("rosbridge at 127.0.0.1:9090: the connection has ended")
            if does == END:
                raise KeyboardInterrupt
            if callable(does):
                does()
            else:
                said.append(does if isinstance(does, str) else json.dumps(does))
        return said

    def of(self, op: str) -> list[dict[str, Any]]:
        return [message for _, message in self.told if message["op"] == op]

    def times_of(self, op: str) -> list[float]:
        return [time for time, message in self.told if message["op"] == op]

    def results(self) -> list[tuple[str, int, int, str]]:
        """Return id, status, error code and text of each result."""
        return [
            (each["id"], each["status"], each["values"]["error_code"], each["values"]["error_string"])
            for each in self.of("action_result")
        ]


def served(session: Session, *script: tuple[float, Does]) -> tuple[StubRosbridge, list[str]]:
    """Serve a stub until its script ends; return it and the bridge's lines."""
    stub, lines = StubRosbridge(session, list(script)), list[str]()
    RosBridge(session, stub, NAMES, lines.append).run()
    return stub, lines


def in_ros(joints: list[float]) -> list[float]:
    """Return positions in mm and degrees in m and rad."""
    return [
        value / 1000.0 if joint.unit == "mm" else value * pi / 180.0
        for joint, value in zip(ROBOT.joints, joints, strict=True)
    ]


def moved(**ways: float) -> list[float]:
    """Return HOME with some joints moved, in mm and degrees."""
    return [home + ways.get(name, 0.0) for name, home in zip(ROBOT.joint_names, HOME, strict=True)]


def point(time_s: float, joints: list[float], velocities: list[float] | None = None) -> dict[str, Any]:
    whole = int(time_s)
    return {
        "positions": in_ros(joints),
        "velocities": [] if velocities is None else in_ros(velocities),
        "accelerations": [],
        "effort": [],
        "time_from_start": {"sec": whole, "nanosec": round((time_s - whole) * 1e9)},
    }


def arguments(*points: dict[str, Any], **others: Any) -> dict[str, Any]:
    """Return the arguments of a goal as rosbridge writes them, with every field of the message."""
    return {
        "trajectory": {
            "header": {"stamp": {"sec": 0, "nanosec": 0}, "frame_id": ""},
            "joint_names": list(ROBOT.joint_names),
            "points": list(points),
        },
        "multi_dof_trajectory": {"header": {}, "joint_names": [], "points": []},
        "path_tolerance": [],
        "component_path_tolerance": [],
        "goal_tolerance": [],
        "component_goal_tolerance": [],
        "goal_time_tolerance": {"sec": 0, "nanosec": 0},
        **others,
    }


def goal(args: object, goal_id: str = "g1") -> dict[str, Any]:
    return {
        "op": "send_action_goal",
        "id": goal_id,
        "action": ACTION,
        "action_type": "control_msgs/action/FollowJointTrajectory",
        "args": args,
        "feedback": True,
    }


def cancel(goal_id: str = "g1") -> dict[str, Any]:
    return {"op": "cancel_action_goal", "id": goal_id, "action": ACTION}


FORTH: Final = arguments(point(0.0, HOME), point(1.0, moved(th1=10.0)), point(2.0, moved(th1=20.0)))
"""A motion of two seconds."""
EXECUTED: Final = (4, 0, "")
"""Status, error code and text of a goal that has succeeded."""
