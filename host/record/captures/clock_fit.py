"""Find a plan's time in a capture: when its t = 0 was, and how much faster or slower the analyser's clock runs.

1. The density of signed steps, of plan and capture, is correlated at all offsets; the best is near the motion. The sign
   of each axis' part tells whether its DIR is inverted.
2. From there steps are paired: the k-th with the k-th where both make the same steps, else those that are each other's
   nearest. The offset at which most are near is taken first, within some steps of the coarse one.
3. A weighted line of least squares through the pairs' instants gives offset and ratio; a step at a high speed tells the
   time better. Pairs far off the line are left out, and the fit is repeated, over a growing part of the motion.

Steps of another rule are all early or late by a part of a step, which looks like an offset in time.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from steptwin.host.common.arrays import FloatArray, Int8Array, Int64Array
from steptwin.host.verify import Evidence, Expectation
from steptwin.host.verify.oracle import IdealSteps, ideal_steps
from steptwin.protocol.timer import COUNTS_PER_SECOND

_BIN_S: Final = 1e-3
_PPM_SEARCHED: Final = 3000e-6
"""Ratio up to which the plan is found; far less passes."""
_LEAST_LIKENESS: Final = 0.3
"""Part of the plan's steps that the best offset must find."""
_AS_MUCH: Final = 0.2
"""Difference in likeness up to which an axis moves as a plan says."""
_RATIOS_TRIED: Final = 12
_PPM_TRIED: Final = 400e-6
"""Ratios to either side of 1, and how far they go, that are tried where steps are lost on every axis."""
_STEPS_TRIED: Final = 250
"""Steps of an axis with which each offset and ratio is tried."""
_WINDOW_S: Final = 1.0
"""Part of the motion that is fitted first; it is doubled until the whole motion is."""
_NEAR_STEPS: Final = 0.3
"""Distance, in steps, up to which two steps are paired while offsets are tried."""
_PAIRED_STEPS: Final = 0.75
_PAIRS_MAX: Final = 8_000
"""Pairs of an axis that are fitted."""
_ROUNDS: Final = 12
_PAIRINGS: Final = 40
"""Times that a part of the motion is paired and fitted until both settle."""
_SETTLED_S: Final = 1e-9
_TRIMMED: Final = 6.0
"""Residuals beyond so many medians are left out."""
_SLOW: Final = 0.1
"""Crossings below this part of the axis' peak speed tell no time."""


@dataclass(frozen=True, slots=True)
class ClockFit:
    """A plan's time in a capture: an instant t of the plan is at offset_s + ratio * t of the capture.

    Attributes:
        offset_s: the capture's time at the plan's t = 0.
        ratio: seconds of the capture in a second of the plan.
        offset_uncertainty_s: standard error of the offset.
        ratio_uncertainty: likewise of the ratio.
        pairs: number of pairs of steps that tell it.
        inverted: the axes that turn the other way, by index.
        swapped: pairs of axes, by index, each of which moves as the other should.
        found: False if no offset shows the plan; the first step then stands for its first.
    """

    offset_s: float
    ratio: float
    offset_uncertainty_s: float
    ratio_uncertainty: float
    pairs: int
    inverted: tuple[int, ...] = ()
    swapped: tuple[tuple[int, int], ...] = ()
    found: bool = True

    @property
    def ppm(self) -> float:
        """How much more time the analyser counts than the plan, in parts per million."""
        return (self.ratio - 1.0) * 1e6

    def plan_s(self, times_s: FloatArray) -> FloatArray:
        """Return instants of the capture in the plan's time."""
        planned_s: FloatArray = (times_s - self.offset_s) / self.ratio
        return planned_s


@dataclass(frozen=True, slots=True, eq=False)
class SeenSteps:
    """The steps of one axis in a capture: instants in seconds, and signs."""

    time_s: FloatArray
    signs: Int8Array


def fit_clock(ideal: Sequence[IdealSteps], seen: Sequence[SeenSteps]) -> ClockFit:
    """Fit a plan's ideal steps to those seen, axis by axis."""
    coarse_s, likeness = _coarse(ideal, seen)
    first = [steps.time_s[0] for steps in seen if steps.time_s.size]
    if coarse_s is None or not first:
        planned = min((steps.time_s[0] for steps in ideal if steps.time_s.size), default=0.0)
        return ClockFit(float(min(first, default=0.0) - planned), 1.0, np.inf, np.inf, 0, found=False)
    moving = [i for i, steps in enumerate(ideal) if steps.time_s.size and seen[i].time_s.size]
    inverted = tuple(i for i in moving if likeness[i, i] < 0.0)
    turned = [SeenSteps(steps.time_s, -steps.signs if i in inverted else steps.signs) for i, steps in enumerate(seen)]
    pairs = [(ideal[i], turned[i]) for i in moving]
    return _fitted(pairs, _begun(pairs, coarse_s), inverted, _swapped(likeness, moving))


def begun_by_steps(expected: Expectation, evidence: Evidence) -> Evidence:
    """Return evidence whose t = 0 is where its steps show the plan, for a controller that tells nobody when it begins.

    Its clock is the evidence's. Where the plan is not found, its first step stands for the plan's first.
    """
    zeros = tuple(round(float(expected.axis_position(axis, np.zeros(1))[0])) for axis in range(len(evidence.axes)))
    ideal = ideal_steps(expected.axis_motion, expected.steps_per_unit, zeros)
    clock = fit_clock(
        ideal, [SeenSteps(axis.step_counts / COUNTS_PER_SECOND, axis.step_signs) for axis in evidence.axes]
    )
    return replace(evidence, start_counts=max(round(clock.offset_s * COUNTS_PER_SECOND), 0))


def _coarse(ideal: Sequence[IdealSteps], seen: Sequence[SeenSteps]) -> tuple[float | None, FloatArray]:
    """Return the offset at which plan and capture are most alike, and each seen axis' likeness to each plan.

    The likeness is 1 if all steps of the plan are there at this offset, and -1 if all are there the other way.
    """
    likeness = np.zeros((len(seen), len(ideal)))
    end_s, planned_s = (
        max((float(each.time_s[-1]) for each in all_ if each.time_s.size), default=0.0) for all_ in (seen, ideal)
    )
    bin_s = max(_BIN_S, _PPM_SEARCHED * planned_s)
    size = 1 << int(np.ceil((end_s + planned_s) / bin_s + 2)).bit_length()
    plans, seens = (
        [np.fft.rfft(_density(each.time_s, each.signs, bin_s, size)) for each in all_] for all_ in (ideal, seen)
    )
    power = np.array([np.fft.irfft(np.abs(plan) ** 2, size)[0] for plan in plans])
    if not power.any():
        return None, likeness
    alike = sum(np.abs(np.fft.irfft(np.conj(plan) * each, size)) for plan, each in zip(plans, seens, strict=True))
    best = int(np.argmax(alike))
    for j in np.flatnonzero(power):
        likeness[:, j] = [np.fft.irfft(np.conj(plans[j]) * each, size)[best] / power[j] for each in seens]
    if np.abs(likeness).max(axis=0)[power > 0.0].mean() < _LEAST_LIKENESS:
        return None, likeness
    coarse_s = (best if best <= end_s / bin_s + 1 else best - size) * bin_s
    return (coarse_s if bin_s == _BIN_S else _finer(ideal, seen, coarse_s, 1.5 * bin_s)), likeness


def _finer(ideal: Sequence[IdealSteps], seen: Sequence[SeenSteps], coarse_s: float, reach_s: float) -> float:
    """Return the offset, near a coarse one, at which the motion's beginning alone is most alike, to a bin."""
    begin_s = min(float(plan.time_s[0]) for plan in ideal if plan.time_s.size)
    from_s, until_s = coarse_s + begin_s - reach_s, coarse_s + begin_s + _WINDOW_S + reach_s
    size = 1 << int(np.ceil((_WINDOW_S + 2.0 * reach_s) / _BIN_S + 2)).bit_length()
    alike = np.zeros(size)
    for plan, steps in zip(ideal, seen, strict=True):
        first, last = np.searchsorted(steps.time_s, (from_s, until_s))
        begun = slice(0, int(np.searchsorted(plan.time_s, begin_s + _WINDOW_S)))
        planned = np.fft.rfft(_density(plan.time_s[begun] - begin_s, plan.signs[begun], _BIN_S, size))
        found = np.fft.rfft(_density(steps.time_s[first:last] - from_s, steps.signs[first:last], _BIN_S, size))
        alike += np.abs(np.fft.irfft(np.conj(planned) * found, size))
    lags = round(2.0 * reach_s / _BIN_S) + 1
    return from_s - begin_s + int(np.argmax(alike[:lags])) * _BIN_S


def _density(time_s: FloatArray, signs: Int8Array, bin_s: float, size: int) -> FloatArray:
    at = (time_s / bin_s).astype(np.int64)
    return np.bincount(at, weights=signs, minlength=size)[:size].astype(np.float64)


def _swapped(likeness: FloatArray, moving: Sequence[int]) -> tuple[tuple[int, int], ...]:
    """Return the pairs of axes each of which moves as the other should, and not as itself should."""
    alike = np.abs(np.abs(likeness) - 1.0) < _AS_MUCH
    astray = [i for i in moving if not alike[i, i]]
    return tuple((i, j) for i in astray for j in astray if i < j and alike[i, j] and alike[j, i])


_Pairs = Sequence[tuple[IdealSteps, SeenSteps]]


def _begun(pairs: _Pairs, coarse_s: float) -> tuple[float, float]:
    """Return offset and ratio, near the coarse offset, at which most of the first steps are near planned ones."""
    shifts = [_same_steps(plan, seen, coarse_s) for plan, seen in pairs]
    late = [
        float(seen.time_s[shift] - plan.time_s[0])
        for (plan, seen), shift in zip(pairs, shifts, strict=True)
        if shift is not None
    ]
    if late:
        return float(np.median(late)), 1.0
    begin_s = min(float(plan.time_s[0]) for plan, _ in pairs)
    until_s = begin_s + _WINDOW_S
    fastest_hz = max(
        float(plan.speeds_hz[: np.searchsorted(plan.time_s, until_s)].max(initial=1.0)) for plan, _ in pairs
    )
    reach_s, off_s = 2.0 * _BIN_S, 0.2 / fastest_hz
    offsets_s = coarse_s + np.arange(-reach_s, reach_s + off_s, off_s)
    step = max(off_s / _WINDOW_S, _PPM_TRIED / _RATIOS_TRIED)
    ratios = 1.0 + np.arange(-_PPM_TRIED, _PPM_TRIED + step, step)
    near = np.array([_near(pairs, offsets_s, float(ratio), until_s) for ratio in ratios])
    row, column = np.unravel_index(int(np.argmax(near)), near.shape)
    return float(offsets_s[column]), float(ratios[row])


def _near(pairs: _Pairs, offsets_s: FloatArray, ratio: float, until_s: float) -> Int64Array:
    """Return, for each of n offsets, how many steps up to an instant of the plan have a planned one near."""
    count = np.zeros(offsets_s.size, np.int64)
    for plan, seen in pairs:
        planned = slice(0, int(np.searchsorted(plan.time_s, until_s)))
        first, last = np.searchsorted(seen.time_s, [offsets_s[0], offsets_s[-1] + until_s * ratio])
        if planned.stop and last > first:
            some = slice(first, last, -(-(last - first) // _STEPS_TRIED))
            guess_s = (seen.time_s[some] - offsets_s[:, np.newaxis]) / ratio
            at = _nearest(plan.time_s[planned], guess_s)
            off = np.abs(guess_s - plan.time_s[at]) * plan.speeds_hz[at]
            near = (off < _NEAR_STEPS) & (seen.signs[some] == plan.signs[at])
            count += np.count_nonzero(near, axis=1)
    return count


def _nearest(times_s: FloatArray, wanted_s: FloatArray) -> Int64Array:
    """Return the index of the nearest of sorted times, for each wanted one."""
    after = np.clip(np.searchsorted(times_s, wanted_s), 1, max(times_s.size - 1, 1))
    before = after - 1
    after = np.minimum(after, times_s.size - 1)
    nearer: Int64Array = np.where(wanted_s - times_s[before] <= times_s[after] - wanted_s, before, after)
    return nearer


def _same_steps(plan: IdealSteps, seen: SeenSteps, offset_s: float) -> int | None:
    """Return where in the steps seen the plan's begin, if all of them come there in the same order; None if not."""
    margin_s = 3.0 * _BIN_S + _PPM_SEARCHED * float(plan.time_s[-1])
    begin = int(np.searchsorted(seen.time_s, offset_s + plan.time_s[0] - margin_s))
    rest = seen.signs[begin:]
    if rest.size == plan.signs.size and np.array_equal(rest, plan.signs):
        return begin
    return None


def _fitted(
    pairs: _Pairs, begun: tuple[float, float], inverted: tuple[int, ...], swapped: tuple[tuple[int, int], ...]
) -> ClockFit:
    end_s = max(float(plan.time_s[-1]) for plan, _ in pairs)
    begin_s = min(float(plan.time_s[0]) for plan, _ in pairs)
    (offset_s, ratio), until_s = begun, begin_s + _WINDOW_S
    while True:
        for _ in range(_PAIRINGS):
            before = offset_s, ratio
            planned, measured, weights = _pairs_until(pairs, offset_s, ratio, until_s)
            offset_s, ratio, errors = _line(planned, measured, weights, offset_s)
            if abs(offset_s - before[0]) < _SETTLED_S and abs(ratio - before[1]) * until_s < _SETTLED_S:
                break
        if until_s >= end_s:
            return ClockFit(offset_s, ratio, *errors, planned.size, inverted, swapped)
        until_s *= 2.0


def _pairs_until(
    pairs: _Pairs, offset_s: float, ratio: float, until_s: float
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return the planned and measured instants of the pairs up to an instant of the plan, and their weights."""
    found: list[tuple[FloatArray, FloatArray, FloatArray]] = []
    for plan, seen in pairs:
        shift = _same_steps(plan, seen, offset_s)
        fast = plan.speeds_hz > _SLOW * plan.speeds_hz.max()
        if shift is not None:
            kept = _thinned(np.flatnonzero(fast & (plan.time_s <= until_s)))
            found.append((plan.time_s[kept], seen.time_s[shift + kept], plan.speeds_hz[kept]))
            continue
        first, last = np.searchsorted(seen.time_s, (offset_s - _BIN_S, offset_s + ratio * until_s + _BIN_S))
        some = slice(first, last, -(-(last - first) // _PAIRS_MAX) or 1)
        time_s, signs = seen.time_s[some], seen.signs[some]
        guess_s = (time_s - offset_s) / ratio
        at = _nearest(plan.time_s, guess_s)
        off = np.abs(guess_s - plan.time_s[at]) * plan.speeds_hz[at]
        kept = np.flatnonzero(
            (off < _PAIRED_STEPS) & fast[at] & (plan.time_s[at] <= until_s) & (signs == plan.signs[at])
        )
        found.append((plan.time_s[at[kept]], time_s[kept], plan.speeds_hz[at[kept]]))
    planned, measured, weights = (np.concatenate(parts) for parts in zip(*found, strict=True))
    return planned, measured, weights


def _thinned(indices: Int64Array) -> Int64Array:
    """Return every n-th pair of an axis, of so many that more would not make the fit better."""
    return indices[:: -(-indices.size // _PAIRS_MAX) or 1]


def _line(
    planned_s: FloatArray, measured_s: FloatArray, weights: FloatArray, offset_s: float
) -> tuple[float, float, tuple[float, float]]:
    """Return offset and ratio of the weighted line through the pairs that are not far off, and both standard errors."""
    if planned_s.size < 3 or np.ptp(planned_s) == 0.0:
        return offset_s, 1.0, (np.inf, np.inf)
    kept = np.ones(planned_s.size, bool)
    mean_s = float(np.average(planned_s, weights=weights))
    slope, middle_s, errors = 0.0, 0.0, (np.inf, np.inf)
    late_s = measured_s - planned_s
    for _ in range(_ROUNDS):
        w, x, y = weights[kept] ** 2, planned_s[kept] - mean_s, late_s[kept]
        total = w.sum()
        x_mean, y_mean = (w * x).sum() / total, (w * y).sum() / total
        spread = (w * (x - x_mean) ** 2).sum()
        if spread <= 0.0:
            break
        slope = float((w * (x - x_mean) * (y - y_mean)).sum() / spread)
        middle_s = float(y_mean - slope * x_mean)
        residuals = np.abs(late_s - middle_s - slope * (planned_s - mean_s)) * weights
        variance = float((w * (y - middle_s - slope * x) ** 2).sum() / max(x.size - 2, 1))
        errors = (float(np.sqrt(variance * (1.0 / total + mean_s**2 / spread))), float(np.sqrt(variance / spread)))
        trimmed = residuals <= _TRIMMED * max(float(np.median(residuals[kept])), 1e-9)
        if np.array_equal(trimmed, kept):
            break
        kept = trimmed
    return middle_s - slope * mean_s, 1.0 + slope, errors
