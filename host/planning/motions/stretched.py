"""Slow down or speed up a whole motion: the same path, with all times multiplied by one factor."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from math import ceil, floor
from typing import Final

from steptwin.host.common.arrays import FloatArray
from steptwin.host.common.bad_input import whole_ms
from steptwin.host.common.errors import InputError
from steptwin.host.common.planning_time import check_planning_time
from steptwin.host.planning.motion import DEFAULT_POINT_MS, JointLaw, Motion
from steptwin.host.planning.peaks import LONGEST_MS, TooLongError


def least_passing(passes: Callable[[int], bool], fails: int, guess: int, largest: int) -> int | None:
    """Return the smallest number above `fails` that passes; None if none up to `largest` does.

    If a number passes, all larger ones are assumed to pass. The number before the result is `fails`, or was tried and
    does not pass. A good guess, preferably too low, saves trials.
    """
    below, longer = fails, 1
    number = min(max(fails + 1, guess), largest)
    while not passes(number):
        check_planning_time()
        if number >= largest:
            return None
        below, number, longer = number, min(number + longer, largest), 2 * longer
    if number - below > 1 and below == fails and not passes(number - 1):
        return number
    while number - below > 1:
        check_planning_time()
        middle = (number + below) // 2
        if passes(middle):
            number = middle
        else:
            below = middle
    return number


PER_FACTOR: Final = 1000
"""Resolution of stretch factors: thousandths."""
STRETCH_MAX: Final = 1000.0
"""Largest factor; a motion that needs a larger one has times in a wrong unit."""
_WHOLE_MS: Final = 1e-6
"""Tolerance in ms of a time that counts as a whole millisecond."""


@dataclass(frozen=True, slots=True, eq=False)
class _Stretched(JointLaw):
    """A law of which all times are multiplied by a factor; `duration_s` is its own duration."""

    law: JointLaw
    factor: float
    duration_s: float

    def positions(self, t_s: FloatArray) -> FloatArray:
        return self.law.positions(self._own_s(t_s))

    def velocities(self, t_s: FloatArray) -> FloatArray:
        return self.law.velocities(self._own_s(t_s)) / self.factor

    def states(self, t_s: FloatArray) -> tuple[FloatArray, FloatArray]:
        positions, velocities = self.law.states(self._own_s(t_s))
        return positions, velocities / self.factor

    def _own_s(self, t_s: FloatArray) -> FloatArray:
        return (t_s / self.factor).clip(0.0, self.duration_s)


def stretched(motion: Motion, factor: float) -> Motion:
    """Return a motion that takes `factor` times as long, rounded up to a millisecond.

    Speeds are divided by the factor, accelerations by its square. A breakpoint between two milliseconds becomes a
    breakpoint at each of them. If the acceleration jumps by da within this millisecond, the cubic of the PVT record
    deviates from the motion by less than da dt^2 / 32: 0.003 step for 1000 deg/s^2 at 100 steps/deg. A breakpoint with
    almost continuous acceleration, as in a fastest motion, becomes a single one, up to a millisecond away and not
    beside another point, so no record lasts one millisecond.

    Outputs change at their new times. Waits are at the first whole milliseconds in their pauses; their time-outs stay.

    Raises:
        InputError: the factor is not from 1 / STRETCH_MAX to STRETCH_MAX, or the duration exceeds LONGEST_MS.
    """
    if not 1 / STRETCH_MAX <= factor <= STRETCH_MAX:
        raise InputError(f"stretch={factor:g}: is not from {1 / STRETCH_MAX:g} to {STRETCH_MAX:g}")
    duration_ms = max(1, ceil(whole_ms("the duration", motion.duration_s) * factor - _WHOLE_MS))
    if duration_ms > LONGEST_MS:
        longest = f"more than an hour; the largest is {largest_stretch(motion):g}"
        raise TooLongError(f"stretch={factor:g}: makes a motion of {duration_ms / 1000:g} s, {longest}")
    factor = duration_ms / 1000 / motion.duration_s
    around_ms = set[int]()
    for t_s in motion.breakpoints_s:
        t_ms = 1000 * factor * t_s
        both = {_floor_ms(t_ms), _ceil_ms(t_ms)}
        around_ms |= {_uncrowded(t_ms, around_ms)} if round(1000 * t_s) in motion.smooth_ms else both
    return Motion(
        motion.joint_names,
        duration_ms / 1000,
        _Stretched(motion.law, factor, motion.duration_s),
        tuple(t_ms / 1000 for t_ms in sorted(around_ms) if 0 < t_ms < duration_ms),
        output_changes=tuple(
            replace(change, from_s=factor * change.from_s, until_s=factor * change.until_s)
            for change in motion.output_changes
        ),
        waits=tuple(replace(wait, at_s=_ceil_ms(1000 * factor * wait.at_s) / 1000) for wait in motion.waits),
        expects=motion.expects,
    )


def _uncrowded(t_ms: float, taken_ms: set[int]) -> int:
    """Return the nearest millisecond, up to one away, that is not beside a grid point or an occupied millisecond."""
    near_ms = range(_floor_ms(t_ms - 1.0), _ceil_ms(t_ms + 1.0) + 1)

    def crowded(ms: int) -> tuple[bool, float]:
        beside_grid = ms % DEFAULT_POINT_MS in (1, DEFAULT_POINT_MS - 1)
        return beside_grid or bool(taken_ms & {ms - 1, ms + 1}), abs(ms - t_ms)

    return min((ms for ms in near_ms if abs(ms - t_ms) <= 1.0 + _WHOLE_MS), key=crowded)


def _floor_ms(t_ms: float) -> int:
    return floor(t_ms + _WHOLE_MS)


def _ceil_ms(t_ms: float) -> int:
    return ceil(t_ms - _WHOLE_MS)


def smallest_stretch(
    motion: Motion, passes: Callable[[Motion], bool], least: float, fails: float = 1.0
) -> float | None:
    """Return the smallest factor above `fails`, in thousandths, with which a motion passes.

    It does not pass at the factor `fails`, and certainly not below `least`. Returns None if no factor up to
    `largest_stretch` passes.
    """

    def passes_at(factor: int) -> bool:
        return passes(stretched(motion, factor / PER_FACTOR))

    largest = largest_stretch(motion)
    if not fails < largest:
        return None
    least_factor = ceil(min(least, largest) * PER_FACTOR * (1 - 1e-12))
    factor = least_passing(passes_at, floor(fails * PER_FACTOR), least_factor, round(largest * PER_FACTOR))
    return None if factor is None else factor / PER_FACTOR


def largest_stretch(motion: Motion) -> float:
    """Return the largest factor for a motion, in thousandths: STRETCH_MAX, or less for the longest motion."""
    longest = floor(PER_FACTOR * LONGEST_MS / (1000 * motion.duration_s) + _WHOLE_MS) / PER_FACTOR
    return min(STRETCH_MAX, longest)
