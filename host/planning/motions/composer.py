"""Compose a sequence of moves, as at a teach pendant: go to a position, along a line, switch an output."""

from bisect import bisect_left
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any, ClassVar, Final

import numpy as np

from steptwin.host.common.arrays import FloatArray, Int64Array
from steptwin.host.common.bad_input import shortened, unknown, whole_ms
from steptwin.host.common.errors import InputError
from steptwin.host.planning.laws import Law, SCurve, check_duration
from steptwin.host.planning.motions.joint_move import JointMove, limits_along
from steptwin.host.planning.motions.tool_move import ToolMove
from steptwin.host.planning.no_way import is_no_way
from steptwin.host.planning.paths import ToolPath, straight
from steptwin.host.planning.peaks import check_length
from steptwin.host.planning.trajectory import OutputChange, Trajectory, Wait, smooth_breakpoints_ms, states
from steptwin.host.robots.kinematics import make_kinematics
from steptwin.host.robots.poses import Pose
from steptwin.host.robots.robot import Robot


@dataclass(frozen=True, slots=True)
class Standstill:
    """A pause: no joint moves; implements Trajectory."""

    joint_names: tuple[str, ...]
    at: tuple[float, ...]
    duration_s: float

    breakpoints_s: ClassVar[tuple[float, ...]] = ()
    output_changes: ClassVar[tuple[OutputChange, ...]] = ()

    def positions(self, t_s: FloatArray) -> FloatArray:
        """Return joint positions, of shape (n, joints), all equal."""
        return np.tile(np.array(self.at), (len(t_s), 1))

    def velocities(self, t_s: FloatArray) -> FloatArray:
        """Return joint velocities, of shape (n, joints), all 0."""
        return np.zeros((len(t_s), len(self.joint_names)))


@dataclass(frozen=True, slots=True)
class Sequence:
    """Consecutive motions, each beginning at the end of the previous one; implements Trajectory.

    Attributes:
        joint_names: names of the robot's joints.
        parts: the motions, at least one.
        starts_ms: start of each part, and then the end of the last one.
        output_changes: changes of outputs during the motion.
        waits: waits for inputs, each at the beginning of a pause.
        expects: expected results for features, by key.
    """

    joint_names: tuple[str, ...]
    parts: tuple[Trajectory, ...]
    starts_ms: tuple[int, ...]
    output_changes: tuple[OutputChange, ...]
    waits: tuple[Wait, ...] = ()
    expects: Mapping[str, Any] = field(default_factory=dict)

    @property
    def duration_s(self) -> float:
        """Duration of all parts together."""
        return self.starts_ms[-1] / 1000

    @property
    def breakpoints_s(self) -> tuple[float, ...]:
        """The parts' breakpoints, the times when one part follows another, and when outputs change on the way."""
        changes_ms = {round(1000 * change.from_s) for change in self.output_changes if change.on_the_way}
        breakpoints_ms = {*self.starts_ms[1:-1], *changes_ms} - {0, self.starts_ms[-1]}
        for start_ms, part in zip(self.starts_ms, self.parts, strict=False):
            breakpoints_ms |= {start_ms + round(1000 * t_s) for t_s in part.breakpoints_s}
        return tuple(ms / 1000 for ms in sorted(breakpoints_ms))

    @property
    def smooth_ms(self) -> frozenset[int]:
        """Breakpoints inside of parts where the acceleration is almost continuous."""
        starts = zip(self.starts_ms, self.parts, strict=False)
        return frozenset(start_ms + own for start_ms, part in starts for own in smooth_breakpoints_ms(part))

    def positions(self, t_s: FloatArray) -> FloatArray:
        """Return joint positions, of shape (n, joints)."""
        positions = np.empty((len(t_s), len(self.joint_names)))
        for part, rows, own_s in self._parts_at(t_s):
            positions[rows] = part.positions(own_s)
        return positions

    def velocities(self, t_s: FloatArray) -> FloatArray:
        """Return joint velocities, of shape (n, joints)."""
        velocities = np.empty((len(t_s), len(self.joint_names)))
        for part, rows, own_s in self._parts_at(t_s):
            velocities[rows] = part.velocities(own_s)
        return velocities

    def states(self, t_s: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return positions and velocities."""
        positions, velocities = np.empty((2, len(t_s), len(self.joint_names)))
        for part, rows, own_s in self._parts_at(t_s):
            positions[rows], velocities[rows] = states(part, own_s)
        return positions, velocities

    def _parts_at(self, t_s: FloatArray) -> Iterator[tuple[Trajectory, Int64Array, FloatArray]]:
        """Yield the parts at the given times, with the rows of these times and the part's own times."""
        starts_s = np.array(self.starts_ms) / 1000
        which = np.clip(np.searchsorted(starts_s, t_s, side="right") - 1, 0, len(self.parts) - 1)
        counts = np.bincount(which, minlength=len(self.parts))
        in_order = np.split(np.argsort(which, kind="stable"), np.cumsum(counts)[:-1])
        for i in np.flatnonzero(counts):
            part, rows = self.parts[i], in_order[i]
            yield part, rows, np.clip(t_s[rows] - starts_s[i], 0.0, part.duration_s)


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
    _parts: list[Trajectory] = field(default_factory=list, init=False)
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
        self._append(JointMove(self.robot.joint_names, start, end, law))

    def line(self, branch: str, way_mm: tuple[float, float, float], law: Law) -> None:
        """Move the tool by a vector in the world frame, at constant attitude, by a law with the vector's length."""
        kinematics = make_kinematics(self.robot)
        here: Pose = tuple(kinematics.forward(self.joints[np.newaxis])[0].tolist())
        there = kinematics.task.stepped(here, dict(zip(("x", "y", "z"), way_mm, strict=True)))
        self.follow(straight(kinematics.task, here, there), law, branch)

    def follow(self, path: ToolPath, law: Law, branch: str) -> None:
        """Move the tool along a path that begins at its pose, by a law with the path's length."""
        self._check_length(law.duration_s)
        self._append(ToolMove.along(self.robot, path, law, branch, self.joints, self.now_s))

    def take(self, motion: Trajectory) -> None:
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
        self._append(Standstill(self.robot.joint_names, tuple(self.joints.tolist()), duration_s))

    def motion_since(self, from_s: float) -> Trajectory | None:
        """Return the moves that began at this time or later; None if there are none."""
        first = bisect_left(self._starts_ms, round(1000 * from_s))
        parts, starts_ms = tuple(self._parts[first:]), self._starts_ms[first:]
        if len(parts) <= 1:
            return parts[0] if parts else None
        return Sequence(self.robot.joint_names, parts, tuple(ms - starts_ms[0] for ms in starts_ms), ())

    def sequence(self, expects: Mapping[str, Any] | None = None) -> Sequence:
        """Return the sequence of all moves so far; `expects` are expected results for features."""
        parts, starts_ms = tuple(self._parts), tuple(self._starts_ms)
        output_changes = tuple(sorted(self._output_changes, key=lambda change: change.from_s))
        waits = tuple(self._waits)
        return Sequence(self.robot.joint_names, parts, starts_ms, output_changes, waits, expects or {})

    def _check_length(self, more_s: float) -> None:
        """Raise TooLongError if the sequence would be too long with a further move."""
        check_length("the whole motion", self._starts_ms[-1] + round(1000 * more_s))

    def _append(self, part: Trajectory) -> None:
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
