"""Slow down or speed up a whole motion: the same path, with all times multiplied by one factor."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from math import ceil, floor
from typing import Final

from steptwin.host.common.arrays import FloatArray
from steptwin.host.common.bad_input import whole_ms
from steptwin.host.common.errors import InputError
from steptwin.host.common.planning_time import check_planning_time
from steptwin.host.planning.peaks import LONGEST_MS, TooLongError
from steptwin.host.planning.trajectory import (
    DEFAULT_POINT_MS,
    DerivedTrajectory,
    OutputChange,
    Trajectory,
    Wait,
    smooth_breakpoints_ms,
    states,
    waits_of,
)


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
class Stretched(DerivedTrajectory):
    """A trajectory whose duration is another one.

    Speeds are divided by the factor, accelerations by its square. A breakpoint between two milliseconds becomes a
    breakpoint at each of them. If the acceleration jumps by da within this millisecond, the cubic of the PVT record
    deviates from the motion by less than da dt^2 / 32: 0.003 step for 1000 deg/s^2 at 100 steps/deg. A breakpoint with
    almost continuous acceleration, as in a fastest motion, becomes a single one, up to a millisecond away and not
    beside another point, so no record lasts one millisecond.

    Attributes:
        stretched_s: its new duration, a whole number of milliseconds.
    """

    stretched_s: float

    @classmethod
    def by(cls, trajectory: Trajectory, factor: float) -> "Stretched":
        """Return a trajectory that takes `factor` times as long, rounded up to a millisecond.

        Raises InputError if the factor is not from 1 / STRETCH_MAX to STRETCH_MAX, or the duration exceeds LONGEST_MS.
        """
        if not 1 / STRETCH_MAX <= factor <= STRETCH_MAX:
            raise InputError(f"stretch={factor:g}: is not from {1 / STRETCH_MAX:g} to {STRETCH_MAX:g}")
        duration_ms = max(1, ceil(whole_ms("the duration", trajectory.duration_s) * factor - _WHOLE_MS))
        if duration_ms > LONGEST_MS:
            longest = f"more than an hour; the largest is {largest_stretch(trajectory):g}"
            raise TooLongError(f"stretch={factor:g}: makes a motion of {duration_ms / 1000:g} s, {longest}")
        return cls(trajectory, duration_ms / 1000)

    @property
    def factor(self) -> float:
        """New duration over old duration."""
        return self.duration_s / self.trajectory.duration_s

    @property
    def duration_s(self) -> float:
        """Its new duration."""
        return self.stretched_s

    @property
    def breakpoints_s(self) -> tuple[float, ...]:
        """Whole milliseconds at or around the trajectory's breakpoints."""
        smooth_ms, around_ms = smooth_breakpoints_ms(self.trajectory), set[int]()
        for t_s in self.trajectory.breakpoints_s:
            t_ms = 1000 * self.factor * t_s
            both = {_floor_ms(t_ms), _ceil_ms(t_ms)}
            around_ms |= {_uncrowded(t_ms, around_ms)} if round(1000 * t_s) in smooth_ms else both
        end_ms = round(1000 * self.duration_s)
        return tuple(t_ms / 1000 for t_ms in sorted(around_ms) if 0 < t_ms < end_ms)

    @property
    def output_changes(self) -> tuple[OutputChange, ...]:
        """The trajectory's changes of outputs, at their new times."""
        return tuple(
            replace(change, from_s=self.factor * change.from_s, until_s=self.factor * change.until_s)
            for change in self.trajectory.output_changes
        )

    @property
    def waits(self) -> tuple[Wait, ...]:
        """The trajectory's waits, at the first whole milliseconds in their pauses; their time-outs stay."""
        return tuple(
            replace(wait, at_s=_ceil_ms(1000 * self.factor * wait.at_s) / 1000) for wait in waits_of(self.trajectory)
        )

    def positions(self, t_s: FloatArray) -> FloatArray:
        """Return joint positions, of shape (n, joints)."""
        return self.trajectory.positions(self._own_s(t_s))

    def velocities(self, t_s: FloatArray) -> FloatArray:
        """Return joint velocities, of shape (n, joints)."""
        return self.trajectory.velocities(self._own_s(t_s)) / self.factor

    def states(self, t_s: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return positions and velocities."""
        positions, velocities = states(self.trajectory, self._own_s(t_s))
        return positions, velocities / self.factor

    def _own_s(self, t_s: FloatArray) -> FloatArray:
        return (t_s / self.factor).clip(0.0, self.trajectory.duration_s)


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
    trajectory: Trajectory, passes: Callable[[Trajectory], bool], least: float, fails: float = 1.0
) -> float | None:
    """Return the smallest factor above `fails`, in thousandths, with which a trajectory passes.

    It does not pass at the factor `fails`, and certainly not below `least`. Returns None if no factor up to
    `largest_stretch` passes.
    """

    def passes_at(factor: int) -> bool:
        return passes(Stretched.by(trajectory, factor / PER_FACTOR))

    largest = largest_stretch(trajectory)
    if not fails < largest:
        return None
    least_factor = ceil(min(least, largest) * PER_FACTOR * (1 - 1e-12))
    factor = least_passing(passes_at, floor(fails * PER_FACTOR), least_factor, round(largest * PER_FACTOR))
    return None if factor is None else factor / PER_FACTOR


def largest_stretch(trajectory: Trajectory) -> float:
    """Return the largest factor for a trajectory, in thousandths: STRETCH_MAX, or less for the longest motion."""
    longest = floor(PER_FACTOR * LONGEST_MS / (1000 * trajectory.duration_s) + _WHOLE_MS) / PER_FACTOR
    return min(STRETCH_MAX, longest)
