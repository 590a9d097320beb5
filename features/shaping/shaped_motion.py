"""Shape a motion: each joint moves by the sum of delayed parts of its motion, against the oscillation of that joint.

Each run from rest to rest is shaped for itself, so the machine has settled where the motion stops, waits, or switches
an output at rest, and arrives exactly. A run lasts longer by the longest shaper. All shapers have the same mean delay,
also those of joints without an oscillation. So at constant speed all joints are as late as each other, and a straight
run of the joints stays straight with equal shapers. In curves, and on straight runs with different shapers while the
speed changes, the tool leaves its path, by about half the acceleration times the variance of the delays.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache, partial
from itertools import pairwise
from math import ceil
from typing import Any, Final, NamedTuple, Self

import numpy as np

from steptwin.features.fastest.shaper import NO_SHAPER, Oscillation, Shaper, on_milliseconds, shaper_of
from steptwin.features.motors.limits.motor_rows import MotorLimits
from steptwin.features.shaping.section import DAMPING, Shaping
from steptwin.host.common.arrays import BoolArray, FloatArray, Int64Array
from steptwin.host.common.features import ChangedMotion
from steptwin.host.common.planning_time import check_planning_time
from steptwin.host.planning.checks import BEYOND_STEPS
from steptwin.host.planning.motion import DEFAULT_POINT_MS, REST_TOLERANCE, Motion
from steptwin.host.planning.motions.sampled import Spline, along_cubics
from steptwin.host.robots.kinematics import make_kinematics
from steptwin.host.robots.kinematics.base import tool_places_mm
from steptwin.host.robots.robot import Robot

_ROUNDING: Final = 5e-10
"""Rounding error beyond a limit of speed or acceleration, as a fraction of it."""
_SAME_PLACE: Final = 1e-9
"""Distance in mm or degrees within which a joint stands still."""


@dataclass(frozen=True, slots=True, eq=False)
class ShapedCubics(Spline):
    """Cubics between points at which a shaped motion is exactly the sum of the delayed parts.

    Attributes:
        end: joint positions at the end, exactly those of the motion that was shaped.
    """

    end: tuple[float, ...]

    def positions(self, t_s: FloatArray) -> FloatArray:
        """Return joint positions, of shape (n, joints)."""
        return np.where(t_s[:, np.newaxis] >= self.knots_s[-1], np.array(self.end), self.curve(t_s))


class JointDelays(NamedTuple):
    """The delayed parts of all joints.

    Attributes:
        delays_ms: shape (n,), whole milliseconds.
        parts: shape (n, joints), those of each joint add up to 1.
        mean_ms: mean delay, the same for all joints but for rounding.
    """

    delays_ms: Int64Array
    parts: FloatArray
    mean_ms: float

    @classmethod
    def of(cls, robot: Robot, oscillations: Mapping[str, Oscillation]) -> Self:
        """Return the delays against the joints' oscillations, by name."""
        shaping = _shaping(robot)
        found = {name: shaper_of(shaping.joints[name].kind, each) for name, each in oscillations.items()}
        means_s = {name: _mean_s(found.get(name, NO_SHAPER)) for name in robot.joint_names}
        mean_s = max(means_s.values())
        parts: dict[int, FloatArray] = {}
        for i, name in enumerate(robot.joint_names):
            shaper, later_s = found.get(name, NO_SHAPER), mean_s - means_s[name]
            for part, delay_s in zip(*on_milliseconds(shaper, oscillations.get(name, _STILL), later_s), strict=True):
                parts.setdefault(round(1000 * delay_s), np.zeros(len(robot.joints)))[i] += part
        delays_ms = sorted(parts)
        return cls(np.array(delays_ms), np.array([parts[each] for each in delays_ms]), 1000.0 * mean_s)

    @property
    def longest_ms(self) -> int:
        """The longest delay of all joints."""
        return int(self.delays_ms[-1])

    def applied(self, motion: FloatArray, begin: FloatArray, end: FloatArray) -> FloatArray:
        """Return the sum of the delayed parts of values at each ms, both of shape (n, joints), before and after them.

        `begin` and `end`, of shape (joints,), are the values before and after the given ones.
        """
        total = len(motion) + self.longest_ms
        found = np.tile(begin, (total, 1))
        for delay_ms, part in zip(self.delays_ms.tolist(), self.parts, strict=True):
            found[delay_ms : delay_ms + len(motion)] += part * (motion - begin)
            found[delay_ms + len(motion) :] += part * (end - begin)
        return found


_STILL: Final = Oscillation(1.0)
"""An oscillation so slow that a part is divided in proportion to the time between two milliseconds."""


def _mean_s(shaper: Shaper) -> float:
    return sum(part * delay_s for part, delay_s in zip(*shaper, strict=True))


def _shaping(robot: Robot) -> Shaping:
    found: Any = robot.sections["shaping"]
    shaping: Shaping = found
    return shaping


_MODEL_PLACES: Final = 9
"""Number of places of a motion at which the motors' model gives the joints' frequencies."""


def oscillations_of(robot: Robot, motion: Motion) -> dict[str, Oscillation]:
    """Return the oscillations of the shaped joints: those of the robot file, or of the motors' model in this motion."""
    joints = _shaping(robot).joints
    found: dict[str, Oscillation] = {}
    if any(joint.frequency_hz is None for joint in joints.values()):
        poses = motion.positions(np.linspace(0.0, motion.duration_s, _MODEL_PLACES))
        model = zip(*(each.tolist() for each in _limits(robot).joint_oscillations(poses)), strict=True)
        found = {name: Oscillation(*each) for name, each in zip(robot.joint_names, model, strict=True)}
    for name, joint in joints.items():
        if joint.frequency_hz is not None:
            found[name] = Oscillation(joint.frequency_hz, DAMPING if joint.damping is None else joint.damping)
    return {name: found[name] for name in robot.joint_names if name in joints}


@lru_cache(maxsize=8)
def _limits(robot: Robot) -> MotorLimits:
    return MotorLimits.of(robot, 0.0)


class _ShapedRun(NamedTuple):
    """A part of a motion from rest to rest: its times in the motion, and when it begins in the shaped one."""

    begin_ms: int
    end_ms: int
    from_ms: int
    moves: bool


def _runs(motion: Motion, longest_ms: int) -> list[_ShapedRun]:
    """Return the runs of a motion; one that moves lasts longer by the longest delay."""
    changes_s = [t_s for each in motion.output_changes if not each.on_the_way for t_s in (each.from_s, each.until_s)]
    waits_s = [wait.at_s for wait in motion.waits]
    end_ms = round(1000 * motion.duration_s)
    inner_s = np.array([*motion.breakpoints_s, *changes_s, *waits_s])
    inner_ms = np.unique(np.rint(1000.0 * inner_s).astype(np.int64))
    inner_ms = inner_ms[(inner_ms > 0) & (inner_ms < end_ms)]
    rests_ms = [0, *inner_ms[_at_rest(motion.velocities(inner_ms / 1000))].tolist(), end_ms]
    runs, from_ms = list[_ShapedRun](), 0
    for begin_ms, end_ms in pairwise(rests_ms):
        positions, velocities = motion.states(np.arange(begin_ms, end_ms + 1) / 1000)
        moves = not _at_rest(velocities).all() or bool((np.ptp(positions, axis=0) > _SAME_PLACE).any())
        runs.append(_ShapedRun(begin_ms, end_ms, from_ms, moves))
        from_ms += end_ms - begin_ms + (longest_ms if moves else 0)
        check_planning_time()
    return runs


def _at_rest(velocities: FloatArray) -> BoolArray:
    return np.asarray((np.abs(velocities) <= REST_TOLERANCE).all(axis=1))


def shaped(robot: Robot, motion: Motion) -> ChangedMotion | None:
    """Return a motion shaped; None for one that does not start and end at rest or is not finite, which is refused."""
    ends = np.array([0.0, motion.duration_s])
    if not _at_rest(motion.velocities(ends)).all() or not np.isfinite(motion.positions(ends)).all():
        return None
    oscillations = oscillations_of(robot, motion)
    delays = JointDelays.of(robot, oscillations)
    runs = _runs(motion, delays.longest_ms)
    later_s = partial(_later_s, runs, delays)
    made = _through_points(robot, motion, runs, delays)
    made = replace(
        made,
        output_changes=tuple(
            replace(
                each,
                from_s=later_s(each.from_s),
                until_s=later_s(each.from_s) + each.until_s - each.from_s if each.on_the_way else later_s(each.until_s),
            )
            for each in motion.output_changes
        ),
        waits=tuple(replace(wait, at_s=later_s(wait.at_s)) for wait in motion.waits),
        expects=motion.expects,
    )
    return ChangedMotion(made, later_s, partial(described, robot, motion, made, runs, oscillations, delays))


def _later_s(runs: Sequence[_ShapedRun], delays: JointDelays, t_s: float) -> float:
    """Return the time of the shaped motion for a time of the motion, a whole ms: in a run it is later by the mean."""
    t_ms = 1000.0 * t_s
    run = next((run for run in runs if t_ms < run.end_ms), runs[-1])
    late_ms = t_ms - run.begin_ms
    if late_ms >= run.end_ms - run.begin_ms:
        return (run.from_ms + run.end_ms - run.begin_ms + (delays.longest_ms if run.moves else 0)) / 1000
    mean_ms = delays.mean_ms if run.moves and late_ms > 0 else 0.0
    return ceil(run.from_ms + late_ms + mean_ms - 1e-6) / 1000


def _through_points(robot: Robot, motion: Motion, runs: Sequence[_ShapedRun], delays: JointDelays) -> Motion:
    """Return the cubics through as few points as the shaped motion takes."""
    inner_ms = np.rint(1000.0 * np.array(motion.breakpoints_s)).astype(np.int64)
    is_jump = ~np.isin(inner_ms, list(motion.smooth_ms))
    times_ms, positions, velocities = [np.zeros(1, np.int64)], list[FloatArray](), list[FloatArray]()
    for run in runs:
        lasts_ms = run.end_ms - run.begin_ms
        at, moved = motion.states(np.array([run.begin_ms, run.end_ms]) / 1000)
        knots_ms, moved = np.array([0, lasts_ms]), np.zeros_like(moved)
        if run.moves:
            q, v = motion.states(np.arange(run.begin_ms, run.end_ms + 1) / 1000)
            q, v = delays.applied(q, q[0], q[-1]), delays.applied(v, 0.0 * v[0], 0.0 * v[-1])
            inside = (inner_ms > run.begin_ms) & (inner_ms < run.end_ms)
            jumps_ms, smooth_ms = (inner_ms[inside & kind] - run.begin_ms for kind in (is_jump, ~is_jump))
            grid_ms = np.arange(-run.from_ms % DEFAULT_POINT_MS, len(q), DEFAULT_POINT_MS)
            ends_ms = np.add.outer(np.array([0, *jumps_ms, lasts_ms]), delays.delays_ms).ravel()
            first_ms = np.unique(np.concatenate([[0], grid_ms, ends_ms]))
            knots_ms = _knots(robot, first_ms, np.unique(np.add.outer(smooth_ms, delays.delays_ms)), q, v)
            at, moved = np.vstack([at[:1], q[knots_ms[1:-1]], at[1:]]), v[knots_ms]
            moved[[0, -1]] = 0.0
        times_ms.append(run.from_ms + knots_ms[1:])
        positions.append(at[1:] if positions else at)
        velocities.append(moved[1:] if velocities else moved)
        check_planning_time()
    curve = Spline.hermite(np.concatenate(times_ms) / 1000, np.vstack(positions), np.vstack(velocities)).curve
    end = motion.positions(np.array([motion.duration_s]))[0]
    return along_cubics(motion.joint_names, ShapedCubics(curve, tuple(end.tolist())))


def _knots(
    robot: Robot, knots_ms: Int64Array, further_ms: Int64Array, positions: FloatArray, velocities: FloatArray
) -> Int64Array:
    """Return knots with further ones, until the cubics between them are as close and as slow as the motion.

    Positions and velocities, of shape (n, joints), are those of the motion at each ms. Where a cubic is too far off or
    exceeds a limit, it is divided at the further times given, and otherwise in its middle.
    """
    t_s = np.arange(len(positions)) / 1000
    joint_limits = [(joint.speed_max, joint.acceleration_max) for joint in robot.joints]
    axis_limits = zip(robot.axis_speeds_max.tolist(), robot.axis_accelerations_max.tolist(), strict=True)
    speeds, accelerations = (1.0 + _ROUNDING) * np.array([*joint_limits, *axis_limits]).T
    while True:
        curve = Spline.hermite(knots_ms / 1000, positions[knots_ms], velocities[knots_ms])
        off = np.abs(robot.to_steps(curve.positions(t_s) - positions)).max(axis=1) > BEYOND_STEPS
        own = curve.velocities(t_s)
        own = np.concatenate([own, robot.coupling.to_axes(own)], axis=1)
        off |= (np.abs(own) > speeds).any(axis=1)
        off[:-1] |= (np.abs(np.diff(own, axis=0)) > 0.001 * accelerations).any(axis=1)
        which = np.unique(np.searchsorted(knots_ms, np.flatnonzero(off[:-1]), side="right"))
        which = which[np.diff(knots_ms)[which - 1] > 1]
        if not len(which):
            return knots_ms
        place = np.searchsorted(knots_ms, further_ms)
        inside = np.isin(place, which) & ~np.isin(further_ms, knots_ms)
        halved = np.setdiff1d(which, place[inside])
        knots_ms = np.unique(
            np.concatenate([knots_ms, further_ms[inside], (knots_ms[halved - 1] + knots_ms[halved]) // 2])
        )


def described(
    robot: Robot,
    motion: Motion,
    made: Motion,
    runs: Sequence[_ShapedRun],
    oscillations: Mapping[str, Oscillation],
    delays: JointDelays,
) -> str:
    """Return what shaping has changed, as one line: by which shapers, how much later, how far off the path."""
    kinds = _shaping(robot).joints
    shapers = ", ".join(f"{name} {kinds[name].kind} {each.frequency_hz:.1f} Hz" for name, each in oscillations.items())
    longer_s = made.duration_s - motion.duration_s
    off_mm = max(_off_path_mm(robot, motion, made, runs, delays), default=0.0)
    off = f", the tool at most {off_mm:.3f} mm off its path" if off_mm > 0.0 else ""
    return f"shaped ({shapers}): {longer_s:.3f} s longer{off}"


def _off_path_mm(
    robot: Robot, motion: Motion, made: Motion, runs: Sequence[_ShapedRun], delays: JointDelays
) -> Iterator[float]:
    """Yield for each run that moves how far the shaped tool is at most from the path of the tool."""
    tool_at = partial(tool_places_mm, make_kinematics(robot))
    for run in runs:
        if not run.moves:
            continue
        count = run.end_ms - run.begin_ms
        path = tool_at(motion.positions(np.arange(run.begin_ms, run.end_ms + 1) / 1000))
        tool = tool_at(made.positions((run.from_ms + np.arange(count + delays.longest_ms + 1)) / 1000))
        least = np.full(len(tool), np.inf)
        for back_ms in range(delays.longest_ms + 1):
            at = np.clip(np.arange(len(tool)) - back_ms, 0, count - 1)
            begin, chord = path[at], path[at + 1] - path[at]
            length2 = np.maximum((chord**2).sum(axis=1), 1e-18)
            part = np.clip(((tool - begin) * chord).sum(axis=1) / length2, 0.0, 1.0)
            least = np.minimum(least, ((tool - begin - part[:, np.newaxis] * chord) ** 2).sum(axis=1))
        yield float(np.sqrt(least.max()))
