"""Fit a line through pairs of planned steps and those seen: offset, ratio, and how late each direction of an axis is.

A controller makes its steps by a rule of its own: at half a step, at whole ones, on a timer's grid. Steps of another
rule than the plan's come by a part of a step late or early, upwards another part than downwards. At a speed v that is a
time of 1 / v, which looks like another offset and another ratio. So each direction of each axis has an unknown of its
own: the part of a step by which it is late.

The errors are those of a jackknife: the motion is cut into stretches of time, each is left out in turn, and the answers
are compared. What the rule leaves over changes slowly and differs between the stretches, so the number of steps alone
would promise too much.
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
"""Crossings below this part of the axis' peak speed tell no time."""
_PAIRED_STEPS: Final = 0.75
_PAIRS_MAX: Final = 4_000
"""Pairs of an axis that are fitted."""
_ROUNDS: Final = 12
_TRIMMED: Final = 6.0
"""Residuals beyond so many medians are left out."""
_LATE_STEPS: Final = 0.5
"""How late a rule makes steps, usually: what is known before, where a motion at one speed does not tell it."""
_SIGMAS: Final = 1.4826
"""Standard deviation of a normal distribution in medians of its magnitudes."""
_LEAST_GAP_S: Final = 1e-9
_LEAST_SPREAD: Final = 1e-4
"""Residuals of this part of a step are those of a perfect fit."""
_SETTLED_S: Final = 1e-9
_SETTLED_STEPS: Final = 1e-4
_STRETCHES: Final = 16
_ALIKE: Final = 0.25
"""Part of what a rule leaves over that all steps may share: of a grid of samples, and of a law of speed in segments."""
_OF_100: Final = 2.13
"""Factor from the standard error to that which 95 of 100 captures keep, with so many stretches (Student)."""


@dataclass(frozen=True, slots=True, eq=False)
class SeenSteps:
    """The steps of one axis in a capture: instants in seconds, and signs."""

    time_s: FloatArray
    signs: Int8Array


AxisPairs = Sequence[tuple[IdealSteps, SeenSteps]]
"""The planned steps of each axis that moves, and those seen."""


@dataclass(frozen=True, slots=True, eq=False)
class ClockLine:
    """A plan's time in a capture: an instant t of the plan is at offset_s + ratio * t of the capture.

    Attributes:
        offset_s: the capture's time at the plan's t = 0.
        ratio: seconds of the capture in a second of the plan.
        late_steps: by what part of a step the steps of each axis come late, up and down in turn.
    """

    offset_s: float
    ratio: float
    late_steps: FloatArray

    def agrees(self, other: "ClockLine", until_s: float) -> bool:
        """Return whether another line says the same up to an instant."""
        return (
            abs(self.offset_s - other.offset_s) < _SETTLED_S
            and abs(self.ratio - other.ratio) * until_s < _SETTLED_S
            and float(np.abs(self.late_steps - other.late_steps).max(initial=0.0)) < _SETTLED_STEPS
        )


@dataclass(frozen=True, slots=True, eq=False)
class Paired:
    """Steps of the plan and those seen that answer them; arrays of one length.

    Attributes:
        planned_s: instants of the plan.
        measured_s: instants of the capture.
        speeds_hz: speeds of the motion then.
        ways: 2 k for steps up of the k-th axis, 2 k + 1 for steps down.
    """

    planned_s: FloatArray
    measured_s: FloatArray
    speeds_hz: FloatArray
    ways: Int64Array

    def chosen(self, kept: NDArray[np.bool_]) -> "Paired":
        """Return some of the pairs."""
        return Paired(self.planned_s[kept], self.measured_s[kept], self.speeds_hz[kept], self.ways[kept])


def paired_until(pairs: AxisPairs, line: ClockLine, until_s: float) -> Paired:
    """Return the pairs up to an instant of the plan: steps seen, and the planned ones that are nearest on a line."""
    found = []
    for axis, (plan, seen) in enumerate(pairs):
        at, time_s = _nearest_pairs(plan, seen, line, axis, until_s)
        told = (plan.speeds_hz > _SLOW * plan.speeds_hz.max())[at] & (plan.time_s[at] <= until_s)
        found.append(_of_axis(axis, plan, at[told], time_s[told], line))
    return Paired(*(np.concatenate([getattr(part, name) for part in found]) for name in Paired.__slots__))


def _of_axis(axis: int, plan: IdealSteps, at: Int64Array, time_s: FloatArray, line: ClockLine) -> Paired:
    """Return pairs of one axis as they would be if the motion had, at each step, the speed with which it is made.

    Behind the plan's crossing the motion has another speed, by what it accelerates until a late step is made.
    """
    ways = 2 * axis + (plan.signs[at] < 0).astype(np.int64)
    late, speeds_hz = line.late_steps[ways], plan.speeds_hz
    gaps_s = np.maximum(plan.time_s[2:] - plan.time_s[:-2], _LEAST_GAP_S)
    accelerations = np.zeros(plan.time_s.size)
    accelerations[1:-1] = (speeds_hz[2:] - speeds_hz[:-2]) / gaps_s
    v, a = speeds_hz[at], accelerations[at]
    made_hz = np.sqrt(np.maximum(v**2 + 2.0 * a * late, (v / 2.0) ** 2))
    until_made_s = 2.0 * late / (v + made_hz)
    return Paired(plan.time_s[at] + until_made_s - late / made_hz, time_s, made_hz, ways)


def _nearest_pairs(
    plan: IdealSteps, seen: SeenSteps, line: ClockLine, axis: int, until_s: float
) -> tuple[Int64Array, FloatArray]:
    """Return the planned steps that some of the steps seen answer, and the instants of these.

    A step is taken earlier by what its direction is late, at the speed of the planned step that is nearest.
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
    """Return a line with how late each way is on it: as a mean on the circle of a step, since 0.6 looks like -0.4."""
    late_steps = line.late_steps.copy()
    for axis, (plan, seen) in enumerate(pairs):
        due_s = (seen.time_s - line.offset_s) / line.ratio
        within = np.flatnonzero((due_s > plan.time_s[0]) & (due_s < min(until_s, float(plan.time_s[-1]))))
        due_s, signs = due_s[within], seen.signs[within]
        at = nearest(plan.time_s, due_s)
        angles = 2.0 * np.pi * (due_s - plan.time_s[at]) * plan.speeds_hz[at]
        for way, sign in enumerate((1, -1)):
            own = (signs == sign) & (plan.signs[at] == sign)
            if own.any():
                late_steps[2 * axis + way] = np.angle(np.exp(1j * angles[own]).mean()) / (2.0 * np.pi)
    return replace(line, late_steps=late_steps)


def nearest(times_s: FloatArray, wanted_s: FloatArray) -> Int64Array:
    """Return the index of the instant that is nearest to each wanted one."""
    after = np.searchsorted(times_s, wanted_s)
    before = np.maximum(after - 1, 0)
    after = np.minimum(after, times_s.size - 1)
    nearer: Int64Array = np.where(wanted_s - times_s[before] <= times_s[after] - wanted_s, before, after)
    return nearer


def _thinned(indices: Int64Array) -> Int64Array:
    """Return every n-th pair of an axis, of so many that more would not make the fit better."""
    return indices[:: -(-indices.size // _PAIRS_MAX) or 1]


def fitted(paired: Paired, line: ClockLine) -> tuple[ClockLine, Callable[[], tuple[float, float]]]:
    """Return the line through the pairs that are not far off, and what tells the errors of its offset and ratio.

    95 of 100 captures keep these errors. Without two different instants the line before stays, and nothing is known.
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
    """Return how far each pair is off a line, in steps."""
    late_s = paired.measured_s - line.offset_s - line.ratio * paired.planned_s
    residuals: FloatArray = paired.speeds_hz * late_s - line.late_steps[paired.ways]
    return residuals


class _Equations:
    """The normal equations of the pairs, stretch by stretch.

    A pair says, in steps: speed * (offset + ratio * t) + late of its way = speed * how late it came. The unknowns are
    what the line before lacks: its offset at the middle, its ratio, and how late each way is.
    """

    def __init__(self, paired: Paired, line: ClockLine, middle_s: float) -> None:
        self._before, self._middle_s = line, middle_s
        ways, size = line.late_steps.size, 2 + line.late_steps.size
        order = np.argsort(paired.planned_s, kind="stable")
        stretch = np.empty(order.size, np.int64)
        stretch[order] = np.arange(order.size) * _STRETCHES // order.size
        speed, t_s = paired.speeds_hz, paired.planned_s - middle_s
        came = speed * (paired.measured_s - line.offset_s - line.ratio * paired.planned_s)

        def sums(values: FloatArray) -> FloatArray:
            summed: FloatArray = np.bincount(stretch, values, _STRETCHES).astype(np.float64)
            return summed

        def sums_by_way(values: FloatArray) -> FloatArray:
            summed: FloatArray = np.bincount(stretch * ways + paired.ways, values, _STRETCHES * ways).astype(np.float64)
            return summed.reshape(_STRETCHES, ways)

        self._left = np.zeros((_STRETCHES, size, size))
        self._right = np.zeros((_STRETCHES, size))
        for row, first in enumerate((speed, speed * t_s)):
            self._left[:, row, 0], self._left[:, row, 1] = sums(first * speed), sums(first * speed * t_s)
            self._left[:, row, 2:] = self._left[:, 2:, row] = sums_by_way(first)
            self._right[:, row] = sums(first * came)
        self._pairs = paired.planned_s.size
        every = np.arange(2, size)
        self._left[:, every, every] = sums_by_way(np.ones_like(speed))
        self._right[:, 2:] = sums_by_way(came)
        self._ways = every

    def _with_prior(self, left: FloatArray, prior: float) -> FloatArray:
        """Return equations that know, too, how late a rule usually is: `prior` is a pair's error in units of that."""
        known = left.copy()
        known[..., self._ways, self._ways] += prior**2
        return known

    def _solved(self, prior: float) -> FloatArray:
        """Return the unknowns."""
        found: FloatArray = np.linalg.solve(self._with_prior(self._left.sum(axis=0), prior), self._right.sum(axis=0))
        return found

    def line(self, prior: float) -> ClockLine:
        """Return the line that is better than the one before."""
        middle_s, ratio, *late = self._solved(prior).tolist()
        before = self._before
        return ClockLine(before.offset_s + middle_s - ratio * self._middle_s, before.ratio + ratio, np.array(late))

    def usually_late(self, spread_steps: float) -> float:
        """Return how late this controller's steps usually are, as far as the pairs tell; at most what others are."""
        prior = spread_steps / _LATE_STEPS
        known = np.linalg.inv(self._with_prior(self._left.sum(axis=0), prior))
        late, unsure = self._solved(prior)[2:], spread_steps**2 * known.diagonal()[2:]
        told = self._left.sum(axis=0).diagonal()[2:] > 0.0
        return float(np.clip(np.sqrt((late**2 + unsure)[told].mean()), _LEAST_SPREAD, _LATE_STEPS))

    def errors(self, spread_steps: float, prior: float) -> tuple[float, float]:
        """Return the errors of the offset at the plan's t = 0 and of the ratio.

        They are those of a jackknife over the stretches, of what was taken as known before, and of what all steps may
        share.
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
