"""Compose a sequence of moves, as at a teach pendant: go to a position, along a line, switch an output."""

from bisect import bisect_left
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from itertools import accumulate
from typing import Any, Final

import numpy as np

from steptwin.host.common.arrays import FloatArray, Int64Array
from steptwin.host.common.bad_input import shortened, unknown, whole_ms
from steptwin.host.common.errors import InputError
from steptwin.host.planning.laws import Law, SCurve, check_duration
from steptwin.host.planning.motion import JointLaw, Motion, OutputChange, Wait
from steptwin.host.planning.motions.joint_move import joint_move, limits_along
from steptwin.host.planning.motions.tool_move import tool_move
from steptwin.host.planning.no_way import is_no_way
from steptwin.host.planning.paths import ToolPath, straight
from steptwin.host.planning.peaks import check_length
from steptwin.host.robots.kinematics import make_kinematics
from steptwin.host.robots.poses import Pose
from steptwin.host.robots.robot import Robot


@dataclass(frozen=True, slots=True)
class Standstill(JointLaw):
    """No joint moves; `at` are the positions in mm and degrees."""

    at: tuple[float, ...]

    def positions(self, t_s: FloatArray) -> FloatArray:
        """Return joint positions, of shape (n, joints), all equal."""
        return np.tile(np.array(self.at), (len(t_s), 1))

    def velocities(self, t_s: FloatArray) -> FloatArray:
        """Return joint velocities, of shape (n, joints), all 0."""
        return np.zeros((len(t_s), len(self.at)))


def standstill(joint_names: tuple[str, ...], at: tuple[float, ...], duration_s: float) -> Motion:
    """Return a pause at joint positions in mm and degrees."""
    return Motion(joint_names, duration_s, Standstill(at))


@dataclass(frozen=True, slots=True)
class Sequence(JointLaw):
    """Consecutive motions, each beginning at the end of the previous one.

    Attributes:
        joint_count: number of joints.
        parts: the motions.
        starts_ms: start of each part, and then the end of the last one.
    """

    joint_count: int
    parts: tuple[Motion, ...]
    starts_ms: tuple[int, ...]

    def positions(self, t_s: FloatArray) -> FloatArray:
        """Return joint positions, of shape (n, joints)."""
        positions = np.empty((len(t_s), self.joint_count))
        for part, rows, own_s in self._parts_at(t_s):
            positions[rows] = part.positions(own_s)
        return positions

    def velocities(self, t_s: FloatArray) -> FloatArray:
        """Return joint velocities, of shape (n, joints)."""
        velocities = np.empty((len(t_s), self.joint_count))
        for part, rows, own_s in self._parts_at(t_s):
            velocities[rows] = part.velocities(own_s)
        return velocities

    def states(self, t_s: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return positions and velocities."""
        positions, velocities = np.empty((2, len(t_s), self.joint_count))
        for part, rows, own_s in self._parts_at(t_s):
            positions[rows], velocities[rows] = part.states(own_s)
        return positions, velocities

    def _parts_at(self, t_s: FloatArray) -> Iterator[tuple[Motion, Int64Array, FloatArray]]:
        """Yield the parts at the given times, with the rows of these times and the part's own times."""
        starts_s = np.array(self.starts_ms) / 1000
        which = np.clip(np.searchsorted(starts_s, t_s, side="right") - 1, 0, len(self.parts) - 1)
        counts = np.bincount(which, minlength=len(self.parts))
        in_order = np.split(np.argsort(which, kind="stable"), np.cumsum(counts)[:-1])
        for i in np.flatnonzero(counts):
            part, rows = self.parts[i], in_order[i]
            yield part, rows, np.clip(t_s[rows] - starts_s[i], 0.0, part.duration_s)


def sequence(
    joint_names: tuple[str, ...],
    parts: Iterable[Motion],
    output_changes: tuple[OutputChange, ...] = (),
    waits: tuple[Wait, ...] = (),
    expects: Mapping[str, Any] | None = None,
) -> Motion:
    """Return motions one after another, each beginning at the end of the previous one.

    Its breakpoints are those of the parts, the times when one part follows another, and when outputs change on the way.
    Changes of outputs and waits of the parts do not count.
    """
    own = tuple(parts)
    *starts_ms, end_ms = accumulate((whole_ms("the duration", part.duration_s) for part in own), initial=0)
    breakpoints_ms = {*starts_ms, *(round(1000 * change.from_s) for change in output_changes if change.on_the_way)}
    breakpoints_ms -= {0, end_ms}
    for start_ms, part in zip(starts_ms, own, strict=True):
        breakpoints_ms |= {start_ms + round(1000 * t_s) for t_s in part.breakpoints_s}
    return Motion(
        joint_names,
        end_ms / 1000,
        Sequence(len(joint_names), own, (*starts_ms, end_ms)),
        tuple(ms / 1000 for ms in sorted(breakpoints_ms)),
        frozenset(start_ms + ms for start_ms, part in zip(starts_ms, own, strict=True) for ms in part.smooth_ms),
        output_changes,
        waits,
        expects or {},
    )


SWITCHING_S: Final = 0.3
"""Pause while a gripper, a magnet or a lock operates."""
PACE: Final = 0.8
"""Fraction of the joints' speed and acceleration limits that joint moves use."""
JERK_TIME_S: Final = 0.1
"""Time for the acceleration of a joint move to rise to its highest value."""
WAIT_S: Final = 0.01
"""Planned pause of a wait for an input; the machine waits at its beginning."""

WAIT_MAX_S: Final = 3600.0
"""Longest time-out of a wait."""


@dataclass(slots=True)
class Composer:
    """A sequence of moves under construction; `sequence` returns it.

    Each move begins at the end of the previous one. Every move raises InputError if the robot cannot make it. Times in
    messages count from the start of the sequence.

    Attributes:
        robot: robot that moves.
        joints: joint positions reached, in mm and degrees, shape (joints,); at first the start of the sequence.
    """

    robot: Robot
    joints: FloatArray
    _parts: list[Motion] = field(default_factory=list, init=False)
    _starts_ms: list[int] = field(default_factory=lambda: [0], init=False)
    _output_changes: list[OutputChange] = field(default_factory=list, init=False)
    _waits: list[Wait] = field(default_factory=list, init=False)

    @property
    def now_s(self) -> float:
        """Time of the sequence when the next move begins."""
        return self._starts_ms[-1] / 1000

    def go(self, goal: FloatArray) -> None:
        """Move all joints together, jerk-limited, to a position of shape (joints,); do nothing if already there."""
        way = goal - self.joints
        if is_no_way(way):
            return
        speed, acceleration = limits_along(self.robot, way)
        law = SCurve.fastest(1.0, PACE * speed, PACE * acceleration, PACE * acceleration / JERK_TIME_S)
        self.go_by(law, goal)

    def go_some(self, positions: Mapping[str, float]) -> None:
        """Move some joints, by name, like `go`; the others do not move."""
        goal = self.joints.copy()
        for name, position in positions.items():
            goal[self.robot.index_of(name)] = position
        self.go(goal)

    def go_by(self, law: Law, goal: FloatArray) -> None:
        """Move all joints to a position of shape (joints,) by a law with a distance of 1."""
        self._check_length(law.duration_s)
        start, end = (tuple(joints.tolist()) for joints in (self.joints, goal))
        self._append(joint_move(self.robot.joint_names, start, end, law))

    def line(self, branch: str, way_mm: tuple[float, float, float], law: Law) -> None:
        """Move the tool by a vector in the world frame, at constant attitude, by a law with the vector's length."""
        kinematics = make_kinematics(self.robot)
        here: Pose = tuple(kinematics.forward(self.joints[np.newaxis])[0].tolist())
        there = kinematics.task.stepped(here, dict(zip(("x", "y", "z"), way_mm, strict=True)))
        self.follow(straight(kinematics.task, here, there), law, branch)

    def follow(self, path: ToolPath, law: Law, branch: str) -> None:
        """Move the tool along a path that begins at its pose, by a law with the path's length."""
        self._check_length(law.duration_s)
        self._append(tool_move(self.robot, path, law, branch, self.joints, self.now_s))

    def take(self, motion: Motion) -> None:
        """Append a motion that begins at the present position."""
        self._check_length(motion.duration_s)
        self._append(motion)

    def switch(self, output: str, *, on: bool) -> None:
        """Switch a digital output of the robot during a pause."""
        require_output(self.robot, output)
        from_s = self.now_s
        self.pause(SWITCHING_S)
        self._output_changes.append(OutputChange(output, on, from_s, self.now_s))

    def add_output_changes(self, changes: Iterable[OutputChange]) -> None:
        """Let outputs of the robot change during motions that have been added."""
        for change in changes:
            require_output(self.robot, change.output)
            self._output_changes.append(change)

    def is_on(self, output: str) -> bool:
        """Return whether an output is on after all changes so far; at first it is off."""
        changes = [change for change in self._output_changes if change.output == output]
        return bool(changes) and max(changes, key=lambda change: change.from_s).on

    def wait(self, sensor: str, *, on: bool, timeout_s: float, place: str = "") -> None:
        """Wait until a digital input of the robot has a level; a time-out ends the motion.

        `place` is the position of the wait in its file, for messages.
        """
        require_input(self.robot, sensor)
        check_timeout(timeout_s)
        self._waits.append(Wait(sensor, on, self.now_s, timeout_s, place))
        self.pause(WAIT_S)

    def pause(self, duration_s: float) -> None:
        """Pause for whole milliseconds, at least one."""
        check_duration(duration_s)
        self._check_length(duration_s)
        self._append(standstill(self.robot.joint_names, tuple(self.joints.tolist()), duration_s))

    def motion_since(self, from_s: float) -> Motion | None:
        """Return the moves that began at or after a time; None without any."""
        first = bisect_left(self._starts_ms, round(1000 * from_s))
        parts = self._parts[first:]
        if len(parts) <= 1:
            return parts[0] if parts else None
        return sequence(self.robot.joint_names, parts)

    def sequence(self, expects: Mapping[str, Any] | None = None) -> Motion:
        """Return the motion of all moves so far; `expects` are expected results for features."""
        output_changes = tuple(sorted(self._output_changes, key=lambda change: change.from_s))
        return sequence(self.robot.joint_names, self._parts, output_changes, tuple(self._waits), expects)

    def _check_length(self, more_s: float) -> None:
        """Raise TooLongError if the sequence would be too long with a further move."""
        check_length("the whole motion", self._starts_ms[-1] + round(1000 * more_s))

    def _append(self, part: Motion) -> None:
        self._parts.append(part)
        self._starts_ms.append(self._starts_ms[-1] + whole_ms("the duration", part.duration_s))
        self.joints = part.positions(np.array([part.duration_s]))[0]


def require_output(robot: Robot, name: str) -> None:
    """Raise InputError if a robot has no digital output of this name."""
    if not robot.outputs:
        raise _without("outputs", robot, f'{name} = {{ joint = "{robot.joint_names[-1]}", out = 1 }}')
    if name not in robot.outputs:
        raise unknown("outputs:", name, robot.outputs)


def require_input(robot: Robot, name: str) -> None:
    """Raise InputError if a robot has no digital input of this name."""
    if not robot.inputs:
        raise _without("inputs", robot, f'{name} = {{ joint = "{robot.joint_names[-1]}", input = 1 }}')
    if name not in robot.inputs:
        raise unknown("inputs:", name, robot.inputs)


def _without(table: str, robot: Robot, line: str) -> InputError:
    """Return the error for a robot without outputs or inputs; it shows a line that defines one."""
    return InputError(f"{table}: {robot.name} has none; its file names them under [{table}], such as {shortened(line)}")


def check_timeout(timeout_s: float) -> None:
    """Raise InputError for an invalid time-out of a wait."""
    if not 0 < timeout_s <= WAIT_MAX_S:
        raise InputError(f"timeout_s: {timeout_s:g} s is not above 0 and up to {WAIT_MAX_S:g} s")
