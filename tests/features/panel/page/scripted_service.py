"""A service without a machine: tests set its snapshot, and see what pages have asked for."""

import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from typing import Any

import numpy as np

from steptwin.features.panel.page.scene import links_at
from steptwin.features.panel.service.commands import Command, Jog
from steptwin.features.panel.service.messages import RefusedError
from steptwin.features.panel.service.results import Result
from steptwin.features.panel.service.service import MachineService
from steptwin.features.panel.service.snapshots import JointView, Snapshot
from steptwin.host.client.links.bus_link import Connection
from steptwin.host.robots.kinematics import make_kinematics
from steptwin.host.robots.robot import Robot


class ScriptedService(MachineService):
    """A service that remembers what it is asked for.

    Attributes:
        now: the snapshot that pages read.
        asked: the commands, in order, with the client that has asked.
        asked_from: the number of the newest snapshot that the page had shown, for each command, beat and resume.
        beats: client, press and jog of each beat.
        calls: the names of the other methods that were called, with their arguments.
        refusal: why the service refuses everything; None while it agrees.
        over: why a press was over before it was released; None if it was not.
    """

    def __init__(self, robot: Robot) -> None:
        super().__init__(Connection("socketcand", None, None, "127.0.0.1", 1), robot)
        self.now = snapshot_of(robot)
        self.asked: list[tuple[str, Command]] = []
        self.beats: list[tuple[str, int, Jog]] = []
        self.calls: list[tuple[object, ...]] = []
        self.asked_from: list[int | None] = []
        self.refusal: str | None = None
        self.over: str | None = None
        self.kept_results: tuple[Result, ...] = ()

    @property
    def snapshot(self) -> Snapshot:
        holder = self.operator.holder
        return replace(self.now, operator=holder.name if holder else None)

    @property
    def results(self) -> tuple[Result, ...]:
        return self.kept_results

    @contextmanager
    def _agreeing(self, client: str) -> Iterator[None]:
        self.operator.require(client)
        if self.refusal is not None:
            raise RefusedError(self.refusal)
        yield

    def require_shown(self, name: str, shown: int | None) -> None:
        assert name
        self.asked_from.append(shown)

    def ask(self, client: str, command: Command, shown: int | None) -> None:
        with self._agreeing(client):
            self.require_shown("ask", shown)
            self.asked.append((client, command))

    def beat(self, client: str, press: int, jog: Jog, shown: int | None) -> None:
        with self._agreeing(client):
            self.require_shown("beat", shown)
            self.beats.append((client, press, jog))

    def release(self, client: str, press: int) -> str | None:
        self.calls.append(("release", client, press))
        return self.over

    def resume(self, client: str, shown: int | None) -> None:
        self.require_shown("resume", shown)
        self.calls.append(("resume", client))

    def change_speed(self, client: str, percent: int, shown: int | None) -> None:
        self.require_shown("speed", shown)
        self.calls.append(("speed", client, percent))

    def pause(self, by: str = "a client") -> None:
        self.calls.append(("pause", by))

    def stop(self, by: str = "a client", press: str | None = None) -> bool:
        self.calls.append(("stop", by, press))
        return self.now.connected

    def emergency_stop(self, by: str = "a client", press: str | None = None) -> bool:
        self.calls.append(("emergency_stop", by, press))
        return self.now.connected

    def gone(self, client: str) -> None:
        self.calls.append(("gone", client))
        self.operator.give_up(client)

    def close(self) -> None:
        self.calls.append(("close",))

    # --- the machine

    def show(self, **changes: Any) -> None:
        """Change what the snapshot has, as a new one."""
        self.now = replace(self.now, **(changes | {"time_s": time.monotonic(), "number": self.now.number + 1}))

    def show_joints(self, **changes: Any) -> None:
        """Change every joint's view."""
        joints = tuple(replace(joint, **changes) for joint in self.now.joints)
        self.show(joints=joints, pose=self.now.pose if all(joint.homed for joint in joints) else None)


def snapshot_of(robot: Robot) -> Snapshot:
    """Return the snapshot of a robot that stands homed and enabled at its home position."""
    joints = tuple(
        JointView(joint.name, str(joint.unit), position, 0.0, 0.0, joint.lower, joint.upper, True, "enabled", "-", None)
        for joint, position in zip(robot.joints, robot.home, strict=True)
    )
    kinematics = make_kinematics(robot)
    pose = kinematics.task.figures(kinematics.forward(np.array([robot.home])))[0].tolist()
    return Snapshot(
        number=0,
        time_s=time.monotonic(),
        connected=True,
        why_not=None,
        simulated=True,
        joints=joints,
        pose=dict(zip(kinematics.task.keys, pose, strict=True)),
        links_mm=tuple(links_at(robot, list(robot.home))),
        inputs=dict.fromkeys(robot.inputs, False),
        outputs=dict.fromkeys(robot.outputs, False),
        activity=None,
        emergency_stopped=False,
        operator=None,
    )
