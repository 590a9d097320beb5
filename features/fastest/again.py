"""Make a motion once more along the same path, as fast as the robot's limits allow.

What stands still, keeps its time. A tool's path keeps its highest speed, since a job leads the tool slowly on purpose;
a move of joints and a curve through points are as fast as the joints and axes can.
"""

from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from itertools import pairwise
from math import cos, radians
from typing import Final, Literal

import numpy as np
import scipy

from steptwin.features.fastest.chain import ChainDrives, driven, timed_chains
from steptwin.features.fastest.corners import JointLeg, MotionLeg, ToolLeg
from steptwin.features.fastest.drives import PathLoad
from steptwin.features.fastest.executed import timed
from steptwin.features.fastest.pieces import FollowedPath, JointPiece, PiecewisePath
from steptwin.features.fastest.rows import machine_average_s
from steptwin.host.common.arrays import FloatArray, Int64Array
from steptwin.host.common.bad_input import whole_ms
from steptwin.host.common.errors import InputError
from steptwin.host.common.planning_time import check_planning_time, in_planning_time
from steptwin.host.planning.drives import DriveLimits
from steptwin.host.planning.motion import REST_TOLERANCE, Motion
from steptwin.host.planning.motions.composer import Sequence, Standstill, sequence, standstill
from steptwin.host.planning.motions.joint_move import JointMove
from steptwin.host.planning.motions.tool_move import ToolMove
from steptwin.host.planning.motions.whole import FASTEST, CornerError, Pace
from steptwin.host.planning.peaks import check_length
from steptwin.host.robots.kinematics import make_kinematics
from steptwin.host.robots.robot import Robot

_OFF_STEPS: Final = 0.002
"""Distance in steps of a motor up to which the curve by its length may be off the motion."""
_STRIDES_MS: Final = (16, 8, 4, 2, 1)
"""Times between the places through which that curve is laid; the first that is near enough is taken."""
_MOVED_STEPS: Final = 1e-6
"""Least way between two places of a curve: over a shorter one its direction would be rounding errors."""
_OF_MOTORS: Final = 0.02
"""Part of the motors' way that counts for a length besides the tool's."""
_LEAST_MM_A_STEP: Final = 0.001
"""Least way of the tool for a step, by which its turns on the spot have a length."""
_KINK_COS: Final = cos(radians(30.0))
"""Cosine of the turn between two milliseconds from which on the joints turn back or round a corner, so they stop."""


@in_planning_time()
def fastest_again(robot: Robot, motion: Motion, drives: DriveLimits | None = None) -> Motion:
    """Return a motion along a motion's path, in its own time: as fast as the limits of joints and axes allow.

    With `drives`, such as `motor_limits` returns, it is as fast as the motors manage within these limits.

    The joints stop where they stop in the motion itself, and where its path has a corner. Pauses, outputs that change
    in them, and waits stay.

    Raises:
        InputError: the motion lasts more than an hour, changes an output on its way, or the motors do not manage it.
    """
    check_length("the motion", whole_ms("the duration", motion.duration_s))
    if any(change.on_the_way for change in motion.output_changes):
        raise InputError(f"law={FASTEST}: the motion changes outputs on its way; a program's own steps can do both")
    made = _Made(robot, motion, drives)
    for part in _parts(motion):
        check_planning_time()
        made.take(part)
    return sequence(
        motion.joint_names,
        made.parts,
        tuple(
            replace(change, from_s=made.new_s(change.from_s), until_s=made.new_s(change.until_s))
            for change in motion.output_changes
        ),
        tuple(replace(wait, at_s=made.new_s(wait.at_s)) for wait in motion.waits),
        motion.expects,
    )


@dataclass(slots=True)
class _Made:
    """The parts of the new motion so far.

    Attributes:
        motion: the motion itself.
        drives: the motors that limit the new one; None without.
        parts: its parts.
        starts_ms: start of each, and end of the last.
        old_ms: times of the motion itself when these were reached.
    """

    robot: Robot
    motion: Motion
    drives: DriveLimits | None
    parts: list[Motion] = field(default_factory=list)
    starts_ms: list[int] = field(default_factory=lambda: [0])
    old_ms: list[int] = field(default_factory=lambda: [0])

    def take(self, part: Motion) -> None:
        """Add a part of the motion itself, in its new time."""
        until_ms = self.old_ms[-1] + whole_ms("the duration", part.duration_s)
        new = list(self._timed(part))
        for number, each in enumerate(new, 1):
            self.parts.append(each)
            self.starts_ms.append(self.starts_ms[-1] + round(1000 * each.duration_s))
            self.old_ms.append(until_ms if number == len(new) else self.old_ms[-1])

    def new_s(self, t_s: float) -> float:
        """Return the new time of an instant in a pause of the motion itself."""
        last = len(self.parts) - 1
        i = min(int(np.searchsorted(self.old_ms, 1000 * t_s + 1e-6, side="right")) - 1, last)
        return self.starts_ms[i] / 1000 + min(t_s - self.old_ms[i] / 1000, self.parts[i].duration_s)

    def _timed(self, part: Motion) -> Iterator[Motion]:
        match part.law:
            case Standstill():
                yield part
            case JointMove(start, goal):
                yield from self._leg(JointLeg(self.robot, np.array(start), np.array(goal), Pace()))
            case ToolMove(path=path, branch=branch, law=law):
                times_s = np.linspace(0.0, part.duration_s, 1 + round(1000 * part.duration_s))
                pace = Pace(tool_mm_s=float(np.abs(law.velocity(times_s)).max()))
                start = part.positions(np.zeros(1))[0]
                yield from self._leg(ToolLeg(FollowedPath.along(self.robot, path, branch, start), pace))
            case _:
                yield from self._curve(part)

    def _leg(self, leg: MotionLeg) -> Iterator[Motion]:
        drives = None if self.drives is None else ChainDrives(self.drives, self._is_held)
        try:
            chains = timed_chains(self.robot, [leg], [], self.starts_ms[-1], drives=drives)
        except CornerError as error:  # the drives refuse the leg: it has no corner
            raise InputError(str(error)) from error
        for chain in chains:
            yield chain.timed.motion

    @property
    def _is_held(self) -> bool:
        """Whether the payload hangs at the tool in the next part; without an output that takes it, it always does."""
        held_by = self.robot.dynamics.payload_held_by if self.robot.dynamics else ""
        before = [each for each in self.motion.output_changes if 1000 * each.from_s <= self.old_ms[-1]]
        own = [each.on for each in before if each.output == held_by]
        return not held_by or (bool(own) and own[-1])

    def _along(self, path: PiecewisePath, from_ms: int) -> Motion:
        if self.drives is None:
            return timed(self.robot, path, machine_average_s(self.robot, path.rates()), from_ms).motion
        return driven(self.robot, path, self.drives, PathLoad(self._is_held), from_ms).motion

    def _curve(self, part: Motion) -> Iterator[Motion]:
        """Yield the stretches of a motion between its stops."""
        end_ms = round(1000 * part.duration_s)
        t_s = np.unique(np.concatenate([np.arange(end_ms + 1) / 1000, part.breakpoints_s]))
        positions, velocities = part.states(t_s)
        steps = self.robot.to_steps(positions)
        from_ms = self.starts_ms[-1]
        for begin, end in pairwise(_stops(steps, velocities)):
            own = slice(begin, end + 1)
            if np.abs(np.diff(steps[own], axis=0)).max() < _MOVED_STEPS:
                stands_s = round(float(t_s[end] - t_s[begin]), 3)
                new = standstill(part.joint_names, tuple(positions[begin].tolist()), stands_s)
            else:
                path = PiecewisePath(self.robot, (_piece(self.robot, positions[own], steps[own]),))
                new = self._along(path, from_ms)
            yield new
            from_ms += round(1000 * new.duration_s)


def _parts(motion: Motion) -> tuple[Motion, ...]:
    """Return the parts of a sequence that begin and end at rest; otherwise the motion as one."""
    if not isinstance(motion.law, Sequence):
        return (motion,)
    seams_s = np.array(motion.law.starts_ms[1:-1]) / 1000
    at_rest = (np.abs(motion.velocities(seams_s)) <= REST_TOLERANCE).all()
    return tuple(inner for part in motion.law.parts for inner in _parts(part)) if at_rest else (motion,)


def _stops(steps: FloatArray, velocities: FloatArray) -> list[int]:
    """Return the rows in which a motion must stop, with the first and the last, from shape (n, axes) and (n, joints).

    A standstill has a stop at both its ends.
    """
    ways = np.diff(steps, axis=0)
    sizes = np.linalg.norm(ways, axis=1)
    stands = sizes < _MOVED_STEPS
    directions = ways / np.where(stands, 1.0, sizes)[:, np.newaxis]
    kinks = np.einsum("ij,ij->i", directions[:-1], directions[1:]) < _KINK_COS
    rests = (np.abs(velocities[1:-1]) <= REST_TOLERANCE).all(axis=1)
    inner = (rests | kinks) & ~(stands[:-1] & stands[1:])
    return [0, *(1 + np.flatnonzero(inner)).tolist(), len(steps) - 1]


def _piece(robot: Robot, positions: FloatArray, steps: FloatArray) -> JointPiece:
    """Return the path through positions, of shape (n, joints), by its length."""
    s = _lengths(robot, positions, steps)
    for stride in _STRIDES_MS:
        kept = np.unique(np.append(np.arange(0, len(steps), stride), len(steps) - 1))
        kept = _moving(s, kept)
        ends: Literal["natural", "not-a-knot"] = "natural" if len(kept) < 4 else "not-a-knot"
        curve = scipy.interpolate.CubicSpline(s[kept], positions[kept], bc_type=ends)
        off = np.abs(robot.to_steps(np.asarray(curve(s))) - steps).max()
        if off <= _OFF_STEPS:
            break
    return JointPiece.through(robot, curve, Pace())


def _lengths(robot: Robot, positions: FloatArray, steps: FloatArray) -> FloatArray:
    """Return the length of the way up to each row: the tool's, and a little of the motors' for turns on the spot.

    A motion is averaged over its length. By the tool's length, along a curve of the tool, that disturbs least.
    """
    ways = np.linalg.norm(np.diff(steps, axis=0), axis=1)
    kinematics = make_kinematics(robot)
    if kinematics.task.width:
        tool_mm = kinematics.forward(positions)[:, :3]
        mm = np.linalg.norm(np.diff(tool_mm, axis=0), axis=1)
        ways = mm + _OF_MOTORS * ways * max(mm.sum() / ways.sum(), _LEAST_MM_A_STEP)
    return np.concatenate([[0.0], np.cumsum(ways)])


def _moving(s: FloatArray, rows: Int64Array) -> Int64Array:
    """Return rows, each farther on than the one before; the last one stays."""
    kept = rows[np.diff(s[rows], prepend=-1.0) > _MOVED_STEPS]
    return np.append(kept[s[rows[-1]] - s[kept] > _MOVED_STEPS], rows[-1])
