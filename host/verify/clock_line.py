"""Fit a line through pairs of planned and captured steps: offset, ratio, and lateness of each direction of an axis.

Each controller has its own step rule: at half steps, at whole steps, on a timer's grid. With another rule than the
plan's, steps are late or early by a fraction of a step, different for both directions. At a speed v this is a time
proportional to 1 / v, which looks like another offset and ratio. So the lateness of each direction of each axis, as a
fraction of a step, is an unknown of the fit.

The errors come from a jackknife: the motion is divided into stretches of time, each is left out in turn, and the
results are compared. The residuals of a step rule change slowly and differ between the stretches, so errors from the
number of steps alone would be too small.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Final

import numpy as np
from numpy.typing import NDArray

from steptwin.host.common.arrays import FloatArray, Int8Array, Int64Array
from steptwin.host.verify.oracle import IdealSteps

_SLOW: Final = 0.1
"""Fraction of the axis' peak speed below which crossings are not used."""
_PAIRED_STEPS: Final = 0.75
_PAIRS_MAX: Final = 4_000
"""Highest number of pairs of an axis in the fit."""
_ROUNDS: Final = 12
_TRIMMED: Final = 6.0
"""Residuals above this number of medians are removed."""
_LATE_STEPS: Final = 0.5
"""Usual lateness of a step rule: the prior, which a motion at a single speed needs."""
_SIGMAS: Final = 1.4826
"""Standard deviation of a normal distribution divided by the median of its magnitudes."""
_LEAST_GAP_S: Final = 1e-9
_LEAST_SPREAD: Final = 1e-4
"""Residuals, as a fraction of a step, of a perfect fit."""
_SETTLED_S: Final = 1e-9
_SETTLED_STEPS: Final = 1e-4
_STRETCHES: Final = 16
_ALIKE: Final = 0.25
"""Fraction of a step rule's residuals that all steps may have in common, as on a grid of samples."""
_OF_100: Final = 2.13
"""Factor from the standard error to the 95 % interval, for this number of stretches (Student's t)."""


@dataclass(frozen=True, slots=True, eq=False)
class CapturedSteps:
    """The steps of one axis in a capture: instants in seconds, and signs."""

    time_s: FloatArray
    signs: Int8Array


AxisPairs = Sequence[tuple[IdealSteps, CapturedSteps]]
"""Planned and captured steps of each moving axis."""


@dataclass(frozen=True, slots=True, eq=False)
class ClockLine:
    """A plan's time in a capture: an instant t of the plan is at offset_s + ratio * t of the capture.

    Attributes:
        offset_s: time of the capture at the plan's t = 0.
        ratio: seconds of the capture per second of the plan.
        late_steps: lateness in steps of each direction: up and down for each axis in turn.
    """

    offset_s: float
    ratio: float
    late_steps: FloatArray

    def agrees(self, other: "ClockLine", until_s: float) -> bool:
        """Return whether another line is equal up to an instant."""
        return (
            abs(self.offset_s - other.offset_s) < _SETTLED_S
            and abs(self.ratio - other.ratio) * until_s < _SETTLED_S
            and float(np.abs(self.late_steps - other.late_steps).max(initial=0.0)) < _SETTLED_STEPS
        )


@dataclass(frozen=True, slots=True, eq=False)
class Paired:
    """Pairs of planned and captured steps, as arrays of equal length.

    Attributes:
        planned_s: instants of the plan.
        measured_s: instants of the capture.
        speeds_hz: speeds of the motion at the planned steps.
        directions: 2 k for steps up of the k-th axis, 2 k + 1 for steps down.
    """

    planned_s: FloatArray
    measured_s: FloatArray
    speeds_hz: FloatArray
    directions: Int64Array

    def chosen(self, kept: NDArray[np.bool_]) -> "Paired":
        """Return some of the pairs."""
        return Paired(self.planned_s[kept], self.measured_s[kept], self.speeds_hz[kept], self.directions[kept])


def paired_until(pairs: AxisPairs, line: ClockLine, until_s: float) -> Paired:
    """Return the pairs up to an instant of the plan: captured steps, and the nearest planned ones by a line."""
    found = []
    for axis, (plan, seen) in enumerate(pairs):
        at, time_s = _nearest_pairs(plan, seen, line, axis, until_s)
        told = (plan.speeds_hz > _SLOW * plan.speeds_hz.max())[at] & (plan.time_s[at] <= until_s)
        found.append(_of_axis(axis, plan, at[told], time_s[told], line))
    return Paired(*(np.concatenate([getattr(part, name) for part in found]) for name in Paired.__slots__))


def _of_axis(axis: int, plan: IdealSteps, at: Int64Array, time_s: FloatArray, line: ClockLine) -> Paired:
    """Return pairs of one axis, corrected for the change of speed between the planned and the late step.

    After the planned crossing the motion still accelerates until a late step is made.
    """
    directions = 2 * axis + (plan.signs[at] < 0).astype(np.int64)
    late, speeds_hz = line.late_steps[directions], plan.speeds_hz
    gaps_s = np.maximum(plan.time_s[2:] - plan.time_s[:-2], _LEAST_GAP_S)
    accelerations = np.zeros(plan.time_s.size)
    accelerations[1:-1] = (speeds_hz[2:] - speeds_hz[:-2]) / gaps_s
    v, a = speeds_hz[at], accelerations[at]
    made_hz = np.sqrt(np.maximum(v**2 + 2.0 * a * late, (v / 2.0) ** 2))
    until_made_s = 2.0 * late / (v + made_hz)
    return Paired(plan.time_s[at] + until_made_s - late / made_hz, time_s, made_hz, directions)


def _nearest_pairs(
    plan: IdealSteps, seen: CapturedSteps, line: ClockLine, axis: int, until_s: float
) -> tuple[Int64Array, FloatArray]:
    """Return the planned steps of pairs, and the instants of their captured steps.

    A captured step is shifted by the lateness of its direction, at the speed of the nearest planned step.
    """
    first, last = np.searchsorted(seen.time_s, line.offset_s + line.ratio * np.array([plan.time_s[0], until_s]))
    some = _thinned(np.arange(max(first - 1, 0), min(last + 1, seen.time_s.size)))
    time_s, signs = seen.time_s[some], seen.signs[some]
    late = line.late_steps[2 * axis + (signs < 0)]
    due_s = (time_s - line.offset_s) / line.ratio
    speeds_hz = np.maximum(plan.speeds_hz[nearest(plan.time_s, due_s)], _SLOW * plan.speeds_hz.max())
    due_s = due_s - late / speeds_hz
    at = nearest(plan.time_s, due_s)
    off_steps = np.abs(due_s - plan.time_s[at]) * plan.speeds_hz[at]
    kept = (off_steps < _PAIRED_STEPS) & (signs == plan.signs[at])
    return at[kept], time_s[kept]


def with_late(pairs: AxisPairs, line: ClockLine, until_s: float) -> ClockLine:
    """Return a line with the lateness of each direction: a circular mean within a step, because 0.6 equals -0.4."""
    late_steps = line.late_steps.copy()
    for axis, (plan, seen) in enumerate(pairs):
        due_s = (seen.time_s - line.offset_s) / line.ratio
        within = np.flatnonzero((due_s > plan.time_s[0]) & (due_s < min(until_s, float(plan.time_s[-1]))))
        due_s, signs = due_s[within], seen.signs[within]
        at = nearest(plan.time_s, due_s)
        angles = 2.0 * np.pi * (due_s - plan.time_s[at]) * plan.speeds_hz[at]
        for direction, sign in enumerate((1, -1)):
            own = (signs == sign) & (plan.signs[at] == sign)
            if own.any():
                late_steps[2 * axis + direction] = np.angle(np.exp(1j * angles[own]).mean()) / (2.0 * np.pi)
    return replace(line, late_steps=late_steps)


def nearest(times_s: FloatArray, wanted_s: FloatArray) -> Int64Array:
    """Return the index of the nearest instant for each element of `wanted_s`."""
    after = np.searchsorted(times_s, wanted_s)
    before = np.maximum(after - 1, 0)
    after = np.minimum(after, times_s.size - 1)
    nearer: Int64Array = np.where(wanted_s - times_s[before] <= times_s[after] - wanted_s, before, after)
    return nearer


def _thinned(indices: Int64Array) -> Int64Array:
    """Return every n-th pair of an axis if there are too many."""
    return indices[:: -(-indices.size // _PAIRS_MAX) or 1]


def fitted(paired: Paired, line: ClockLine) -> tuple[ClockLine, Callable[[], tuple[float, float]]]:
    """Return the line through the pairs without outliers, and a function that returns errors of offset and ratio.

    The errors are 95 % intervals. Without two different instants the previous line is returned, with infinite errors.
    """
    if paired.planned_s.size < 3 or np.ptp(paired.planned_s) == 0.0:
        return replace(line, ratio=1.0), lambda: (np.inf, np.inf)
    middle_s = (paired.planned_s[0] + paired.planned_s[-1]) / 2.0
    kept = np.ones(paired.planned_s.size, np.bool_)
    spread = _LEAST_SPREAD
    for _ in range(_ROUNDS):
        equations = _Equations(paired.chosen(kept), line, middle_s)
        off_steps = np.abs(residual_steps(paired, equations.line(spread / _LATE_STEPS)))
        median = float(np.median(off_steps[kept]))
        spread = max(_SIGMAS * median, _LEAST_SPREAD)
        trimmed = off_steps <= _TRIMMED * max(median, _LEAST_SPREAD)
        if np.array_equal(trimmed, kept):
            break
        kept = trimmed
    prior = spread / equations.usually_late(spread)
    return equations.line(prior), partial(equations.errors, spread, prior)


def residual_steps(paired: Paired, line: ClockLine) -> FloatArray:
    """Return the distance of each pair from a line, in steps."""
    late_s = paired.measured_s - line.offset_s - line.ratio * paired.planned_s
    residuals: FloatArray = paired.speeds_hz * late_s - line.late_steps[paired.directions]
    return residuals


class _Equations:
    """The normal equations of the pairs, stretch by stretch.

    The equation of a pair, in steps, is speed * (offset + ratio * t) + lateness of its direction = speed * residual
    time. The unknowns are corrections of the previous line: its offset at the middle, its ratio, and the lateness of
    each direction.
    """

    def __init__(self, paired: Paired, line: ClockLine, middle_s: float) -> None:
        self._before, self._middle_s = line, middle_s
        directions, size = line.late_steps.size, 2 + line.late_steps.size
        order = np.argsort(paired.planned_s, kind="stable")
        stretch = np.empty(order.size, np.int64)
        stretch[order] = np.arange(order.size) * _STRETCHES // order.size
        speed, t_s = paired.speeds_hz, paired.planned_s - middle_s
        came = speed * (paired.measured_s - line.offset_s - line.ratio * paired.planned_s)

        def sums(values: FloatArray) -> FloatArray:
            summed: FloatArray = np.bincount(stretch, values, _STRETCHES).astype(np.float64)
            return summed

        def sums_by_direction(values: FloatArray) -> FloatArray:
            summed: FloatArray = np.bincount(
                stretch * directions + paired.directions, values, _STRETCHES * directions
            ).astype(np.float64)
            return summed.reshape(_STRETCHES, directions)

        self._left = np.zeros((_STRETCHES, size, size))
        self._right = np.zeros((_STRETCHES, size))
        for row, first in enumerate((speed, speed * t_s)):
            self._left[:, row, 0], self._left[:, row, 1] = sums(first * speed), sums(first * speed * t_s)
            self._left[:, row, 2:] = self._left[:, 2:, row] = sums_by_direction(first)
            self._right[:, row] = sums(first * came)
        self._pairs = paired.planned_s.size
        every = np.arange(2, size)
        self._left[:, every, every] = sums_by_direction(np.ones_like(speed))
        self._right[:, 2:] = sums_by_direction(came)
        self._directions = every

    def _with_prior(self, left: FloatArray, prior: float) -> FloatArray:
        """Add the prior of the lateness; `prior` is a pair's error divided by the usual lateness."""
        known = left.copy()
        known[..., self._directions, self._directions] += prior**2
        return known

    def _solved(self, prior: float) -> FloatArray:
        """Return the unknowns."""
        found: FloatArray = np.linalg.solve(self._with_prior(self._left.sum(axis=0), prior), self._right.sum(axis=0))
        return found

    def line(self, prior: float) -> ClockLine:
        """Return the corrected line."""
        middle_s, ratio, *late = self._solved(prior).tolist()
        before = self._before
        return ClockLine(before.offset_s + middle_s - ratio * self._middle_s, before.ratio + ratio, np.array(late))

    def usually_late(self, spread_steps: float) -> float:
        """Return the usual lateness of this controller's steps by the pairs, at most that of other controllers."""
        prior = spread_steps / _LATE_STEPS
        known = np.linalg.inv(self._with_prior(self._left.sum(axis=0), prior))
        late, unsure = self._solved(prior)[2:], spread_steps**2 * known.diagonal()[2:]
        told = self._left.sum(axis=0).diagonal()[2:] > 0.0
        return float(np.clip(np.sqrt((late**2 + unsure)[told].mean()), _LEAST_SPREAD, _LATE_STEPS))

    def errors(self, spread_steps: float, prior: float) -> tuple[float, float]:
        """Return the errors of the offset at the plan's t = 0 and of the ratio.

        They combine the jackknife over the stretches, the error of the prior, and the common part of the residuals.
        """
        told = np.zeros((2, self._right.shape[1]))
        told[0, :2], told[1, 1] = (1.0, -self._middle_s), 1.0
        left, right = self._left.sum(axis=0), self._right.sum(axis=0)
        without = np.linalg.solve(self._with_prior(left - self._left, prior), (right - self._right)[..., np.newaxis])
        apart = told @ (without[..., 0] - self._solved(prior)).T
        jackknifed = (1.0 - 1.0 / _STRETCHES) * (apart**2).sum(axis=1)
        weights = np.linalg.solve(self._with_prior(left, prior), told.T)[2:]
        guessed = (spread_steps * prior * weights) ** 2
        alike = (_ALIKE * spread_steps) ** 2 * self._pairs / left.diagonal()[:2]
        offset_s, ratio = (_OF_100 * np.sqrt(jackknifed + guessed.sum(axis=0) + alike)).tolist()
        return offset_s, ratio
