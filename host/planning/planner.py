"""The planner: convert a motion to PVT points, checked before anything is sent.

Positions are converted to wire units on absolute values and rounded once; a record's displacement is the difference of
two rounded absolutes, so rounding errors do not add up. Velocities are the motion's own at the points.
"""

from collections.abc import Iterable
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from steptwin.host.common.arrays import FloatArray, Int64Array
from steptwin.host.common.bad_input import whole_ms
from steptwin.host.common.errors import InputError
from steptwin.host.common.features import changed_motion
from steptwin.host.common.planning_time import in_planning_time
from steptwin.host.planning import checks
from steptwin.host.planning.motion import DEFAULT_POINT_MS, Motion
from steptwin.host.planning.motions.stretched import largest_stretch, smallest_stretch, stretched
from steptwin.host.planning.peaks import (
    Peak,
    Quantity,
    Samples,
    check_length,
    excess_between_points,
    highest,
    sampled,
    speed_peaks,
    step_rate_peaks,
)
from steptwin.host.planning.plan import Plan
from steptwin.host.robots.joint import with_fewer_steps
from steptwin.host.robots.robot import Robot
from steptwin.protocol.pvt import DURATION_MAX_MS, VELOCITY_PER_UNIT_PER_MS


@in_planning_time()
def plan(robot: Robot, motion: Motion, point_ms: int = DEFAULT_POINT_MS) -> Plan:
    """Sample a motion every `point_ms` milliseconds and at its breakpoints, check it and convert it.

    A feature may change the motion before, such as shape it against oscillations: the plan has the changed one.

    Raises:
        InputError: the motion has other joints than the robot, is not finite, exceeds a limit of position, speed,
            acceleration or step rate, does not start and end at rest, or does not fit in PVT records; the message
            names joint, time, value and limit, and for a motion that is too fast the stretch that passes.
    """
    return plan_stretched(robot, motion, 1.0, point_ms)


@in_planning_time()
def plan_stretched(
    robot: Robot, motion: Motion, stretch: float | None = None, point_ms: int = DEFAULT_POINT_MS
) -> Plan:
    """Plan a motion stretched by a factor, or with None by the smallest one that passes, as `plan` does."""
    asked = 1.0 if stretch is None else stretch
    try:
        return _plan(robot, _stretched(motion, asked), point_ms)
    except checks.TooFastError as error:
        factor = stretch_that_passes(robot, motion, error, asked, point_ms)
        if stretch is None:
            return _plan(robot, stretched(motion, factor), point_ms)
        slower = f"{factor:g} times slower passes (stretch={factor:g})" if factor > 1 else f"stretch={factor:g} passes"
        drives = _slower_drives(robot, _stretched(motion, asked), point_ms, error)
        advice = f"{slower}{drives}"
        too_fast = checks.TooFastError(f"{error}; {advice}", error.peaks, advice)
        raise too_fast.plainly(f"{error.plain}; {advice}") from error


def _stretched(motion: Motion, factor: float) -> Motion:
    return motion if factor == 1 else stretched(motion, factor)


def stretch_that_passes(
    robot: Robot,
    motion: Motion,
    error: checks.TooFastError,
    asked: float = 1.0,
    point_ms: int = DEFAULT_POINT_MS,
) -> float:
    """Return the smallest stretch above `asked` that passes; raise InputError if there is none.

    `error` is the refusal of the motion with the stretch `asked`.
    """

    def passes(slower: Motion) -> bool:
        return _passes(robot, slower, point_ms)

    least = error.least_stretch * _stretched(motion, asked).duration_s / motion.duration_s
    factor = smallest_stretch(motion, passes, least, asked)
    if factor is None:
        never = f"no stretch up to {largest_stretch(motion):g} makes it pass"
        raise InputError(f"{error}; {never}").plainly(f"{error.plain}; {never}") from error
    return factor


def _passes(robot: Robot, motion: Motion, point_ms: int) -> bool:
    try:
        _plan(robot, motion, point_ms)
    except checks.TooFastError:
        return False
    return True


def _slower_drives(robot: Robot, motion: Motion, point_ms: int, error: checks.TooFastError) -> str:
    """Return the drivers that need few enough steps, if the motion passes with them; otherwise an empty text."""
    parts = {peak.joint: peak.limit / peak.value for peak in error.peaks if peak.quantity is Quantity.STEP_RATE}
    choices = robot.board.profile.chip.microsteps
    changed = {name: with_fewer_steps(robot.joint(name), part, choices) for name, part in parts.items()}
    drives = {name: drive for name, (drive, _) in changed.items()}
    joints = tuple(replace(joint, transmission=drives.get(joint.name, joint.transmission)) for joint in robot.joints)
    if not changed or not _passes(replace(robot, joints=joints), motion, point_ms):
        return ""
    return ", and so does " + " and ".join(f"joints.{name}.{setting}" for name, (_, setting) in changed.items())


def step_peaks(robot: Robot, part: Motion, from_ms: int, windows: Iterable[Samples]) -> tuple[Peak, ...]:
    """Return the peaks of a part of a motion from a time on, as the planner finds them in the whole.

    `windows` are those of the part. Raises TooFastError if PVT records cannot hold it.
    """
    own_ms = _point_times_ms(part, DEFAULT_POINT_MS, from_ms)
    looked = _Examined.at(robot, own_ms, windows)
    return (*looked.step_rates(own_ms + from_ms), *looked.peaks, *looked.excess)


def _plan(robot: Robot, motion: Motion, point_ms: int) -> Plan:
    """Plan a motion as features change it; raise TooFastError if it must be stretched."""
    changed = changed_motion(robot, motion)
    if changed is None:
        return plan_executed(robot, motion, point_ms)
    return replace(plan_executed(robot, changed.motion, point_ms), changed=changed)


def executed_duration_s(robot: Robot, motion: Motion) -> float:
    """Return the duration of a motion as features change it before it is checked."""
    changed = changed_motion(robot, motion)
    return motion.duration_s if changed is None else changed.motion.duration_s


def plan_executed(robot: Robot, motion: Motion, point_ms: int = DEFAULT_POINT_MS) -> Plan:
    """Plan a motion exactly as it is, such as one that has been planned before; raises as `plan`."""
    checks.check_joint_names(robot, motion)
    times_ms = _point_times_ms(motion, point_ms)
    check = checks.SampleCheck(robot, checks.knots_ms(motion))
    looked = _Examined.at(robot, times_ms, check.watched(sampled(motion)))
    check.check_positions()
    check.check_rest()
    peaks = (*looked.step_rates(times_ms), *looked.peaks)
    checks.check_peaks(peaks)
    checks.check_peaks(looked.excess)
    points, velocities = (each.astype(np.int64) for each in (looked.points, looked.velocities))
    return Plan(robot, motion, times_ms, points, velocities, peaks)


class _Examined(NamedTuple):
    """Results of examining a motion window by window.

    Attributes:
        robot: the robot.
        points: shape (points, axes), positions in wire units as floats, which cannot overflow.
        velocities: shape (points, axes), velocities in 1/64 unit per ms as floats.
        peaks: peaks of speed and acceleration.
        excess: peaks beyond a limit of the cubics between the points; used if the other peaks pass.
    """

    robot: Robot
    points: FloatArray
    velocities: FloatArray
    peaks: tuple[Peak, ...]
    excess: tuple[Peak, ...]

    @classmethod
    def at(cls, robot: Robot, times_ms: Int64Array, windows: Iterable[Samples]) -> "_Examined":
        """Examine a motion with points at these times."""
        points = np.empty((len(times_ms), len(robot.axes)))
        velocities = np.empty_like(points)
        peaks, excess, begin_ms, first = [], list[Peak](), 0, 0
        kept: Samples | None = None
        for samples in windows:
            end_ms = begin_ms + len(samples.t_s) - 1
            last = int(np.searchsorted(times_ms, end_ms, side="right"))
            own = samples.rows(times_ms[first:last] - begin_ms)
            points[first:last] = robot.to_units(own.positions)
            velocities[first:last] = robot.coupling.to_axes(own.velocities)
            peaks.append(tuple(speed_peaks(robot, samples)))
            own = own if kept is None else kept.followed_by(own)
            excess += excess_between_points(robot, own)
            kept = own.rows(np.array([-1])) if len(own.t_s) else None
            begin_ms, first = end_ms, last
        per_ms = velocities * robot.wire_units_per_unit * VELOCITY_PER_UNIT_PER_MS / 1000
        return cls(robot, points, np.round(per_ms), highest(peaks), tuple(excess))

    def step_rates(self, times_ms: Int64Array) -> tuple[Peak, ...]:
        """Return the peaks of the step rates at these times; raise TooFastError if PVT records cannot hold them."""
        checks.check_record_widths(self.robot, times_ms, self.points, self.velocities)
        return step_rate_peaks(self.robot, times_ms, self.points, self.velocities)


def _point_times_ms(motion: Motion, point_ms: int, from_ms: int = 0) -> Int64Array:
    """Return the times of the points: the grid, the breakpoints and the end, all in whole milliseconds.

    The grid is that of a longer motion, of which this one is the part from `from_ms` on.
    """
    if not 1 <= point_ms <= DURATION_MAX_MS:
        raise InputError(f"{point_ms} ms between points is not from 1 to {DURATION_MAX_MS} ms")
    end_ms = whole_ms("the duration", motion.duration_s)
    check_length("the motion", end_ms)
    breakpoints_ms = [whole_ms("a breakpoint", t_s) for t_s in motion.breakpoints_s]
    for what, t_ms in (("the duration", end_ms), *(("a breakpoint", t_ms) for t_ms in breakpoints_ms)):
        if not 1 <= t_ms <= end_ms:
            raise InputError(f"{what}: {t_ms} ms is not from 1 ms to the end at {end_ms} ms")
    grid_ms = np.arange(-from_ms % point_ms, end_ms, point_ms)
    times_ms = np.sort(np.concatenate((grid_ms, np.array([0, *breakpoints_ms, end_ms], np.int64))))
    return times_ms[np.diff(times_ms, prepend=-1) > 0]
