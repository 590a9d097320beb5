"""Messages between a served board and ROS through a rosbridge server: joint_states and FollowJointTrajectory.

This module has the messages, and ROS' units, rad and m. `bridge` offers a machine, `goals` checks goals.

The protocol is rosbridge v2 (ROSBRIDGE_PROTOCOL.md of rosbridge_suite, sections 3.2 and 4): JSON objects whose `op` is
their kind. A client that has advertised an action receives goals by `send_action_goal` and `cancel_action_goal`, and
answers by `action_feedback` and `action_result`. A message without a header, as those here, gets the server's time. The
action is control_msgs/action/FollowJointTrajectory.
"""

import json
import re
from enum import IntEnum
from math import pi
from typing import Any, Final, NamedTuple

import numpy as np

from steptwin.host.common.arrays import FloatArray
from steptwin.host.common.errors import InputError
from steptwin.host.common.tables import Table, json_table
from steptwin.host.robots.joint import Unit
from steptwin.host.robots.robot import Robot

PER_ROS_UNIT: Final = {Unit.DEG: 180.0 / pi, Unit.MM: 1000.0}
"""Degrees in a rad, millimetres in a m."""
JOINT_STATES: Final = "joint_states"
_JOINT_STATE: Final = "sensor_msgs/msg/JointState"
_ACTION_TYPE: Final = "control_msgs/action/FollowJointTrajectory"
_NAME: Final = re.compile(r"[A-Za-z_][A-Za-z0-9_]*(/[A-Za-z_][A-Za-z0-9_]*)*")


class FollowCode(IntEnum):
    """`error_code` of the result of control_msgs/action/FollowJointTrajectory."""

    SUCCESSFUL = 0
    INVALID_GOAL = -1
    INVALID_JOINTS = -2
    OLD_HEADER_TIMESTAMP = -3
    PATH_TOLERANCE_VIOLATED = -4
    GOAL_TOLERANCE_VIOLATED = -5


class GoalSent(NamedTuple):
    """A goal of the action with the server's id; its arguments are unchecked."""

    goal_id: str
    args: object


class CancelRequest(NamedTuple):
    """A request of a client to cancel a goal."""

    goal_id: str


class ServerStatus(NamedTuple):
    """A status message of the server, for example about an unknown operation."""

    text: str


ServerMessage = GoalSent | CancelRequest | ServerStatus


class RosNames(NamedTuple):
    """Names of an action and a topic in ROS."""

    action: str
    topic: str

    @classmethod
    def of(cls, controller: str) -> "RosNames":
        """Return the names for a controller; raise InputError for a name that ROS does not accept."""
        if not _NAME.fullmatch(controller):
            raise InputError(
                f"controller={controller}: is no name in ROS: letters, digits and _, not first a digit, parts joined"
                " by /; joint_trajectory_controller is usual"
            )
        return cls(f"/{controller}/follow_joint_trajectory", f"/{JOINT_STATES}")

    def advertisements(self) -> list[str]:
        """Return the messages for the start of a connection."""
        return [
            _text("advertise", topic=self.topic, type=_JOINT_STATE),
            _text("advertise_action", action=self.action, type=_ACTION_TYPE),
        ]

    def withdrawals(self) -> list[str]:
        """Return the messages for the end of a connection."""
        return [_text("unadvertise_action", action=self.action), _text("unadvertise", topic=self.topic)]

    def joint_states(self, robot: Robot, joints: dict[str, float]) -> str:
        """Return the message with joint positions, given by name in mm and degrees."""
        values = [position / PER_ROS_UNIT[robot.joint(name).unit] for name, position in joints.items()]
        return _text("publish", topic=self.topic, msg={"name": list(joints), "position": values})

    def feedback(self, goal_id: str, robot: Robot, at_s: float, desired: FloatArray, actual: FloatArray) -> str:
        """Return the message of a goal's progress: time, and positions of shape (joints,) in mm and degrees."""
        time = duration(at_s)
        points = {"desired": desired, "actual": actual, "error": desired - actual}
        values = {
            key: {"positions": in_ros_units(robot, positions).tolist(), "time_from_start": time}
            for key, positions in points.items()
        }
        return _text(
            "action_feedback",
            id=goal_id,
            action=self.action,
            values={"joint_names": list(robot.joint_names), **values},
        )

    def result(self, goal_id: str, status: int, code: FollowCode, text: str) -> str:
        """Return the message of a goal's end; `status` is that of action_msgs/GoalStatus.

        `result` is true even for an aborted goal, since the server drops code and text with false.
        """
        values = {"error_code": int(code), "error_string": text}
        return _text("action_result", id=goal_id, action=self.action, values=values, status=status, result=True)

    def parsed(self, text: str | bytes) -> ServerMessage | None:
        """Return the content of a server's message; None if it concerns others.

        Raises:
            InputError: it is no message of the protocol, or lacks a value.
        """
        if isinstance(text, bytes):
            raise InputError("is in bytes; only JSON was asked for")
        message = json_table(text)
        op = _word(message, "op")
        if op == "status":
            return ServerStatus(str(message.values.get("msg", "")))
        if op not in ("send_action_goal", "cancel_action_goal") or message.values.get("action") != self.action:
            return None
        goal_id = _word(message, "id")
        return GoalSent(goal_id, message.values.get("args")) if op == "send_action_goal" else CancelRequest(goal_id)


def _word(message: Table, key: str) -> str:
    value = message.values.get(key)
    if not isinstance(value, str):
        raise InputError(f"{key}: is not a text")
    return value


def _text(op: str, **values: Any) -> str:
    return json.dumps({"op": op, **values}, allow_nan=False)


def in_ros_units(robot: Robot, joints: FloatArray) -> FloatArray:
    """Convert positions of shape (..., joints) from mm and degrees to m and rad."""
    return np.asarray(joints / np.array([PER_ROS_UNIT[joint.unit] for joint in robot.joints]))


def duration(time_s: float) -> dict[str, int]:
    """Return a time as builtin_interfaces/Duration."""
    sec, nanosec = divmod(round(time_s * 1e9), 1_000_000_000)
    return {"sec": sec, "nanosec": nanosec}
