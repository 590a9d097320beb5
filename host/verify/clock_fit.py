"""Fit a plan's time to a capture: the instant of its t = 0, and the ratio between the clocks of plan and analyser.

1. The densities of signed steps of plan and capture are correlated at all offsets; the best one is near the motion. The
   width of their bins is the blur by the unknown ratio of the clocks: 0.3 % of the motion. The sign of each axis'
   contribution shows whether its DIR is inverted.
2. Around the best offset the counts are compared, over ever shorter parts of the motion's beginning.
3. From there steps are paired: the k-th with the k-th if both make the same steps, else mutual nearest ones. The search
   starts at the offset with the most close pairs, within some steps of the coarse one.
4. A weighted least-squares line through the pairs' instants gives offset and ratio; steps at a high speed have a higher
   weight. Pairs far off the line are removed, and the fit is repeated over a growing part of the motion.

A controller with another step rule makes all steps early or late by a fraction of a step, which looks like an offset in
time.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from operator import attrgetter
from typing import Final, NamedTuple

import numpy as np

from steptwin.host.common.arrays import FloatArray, Int8Array
from steptwin.host.common.errors import InputError
from steptwin.host.verify import Evidence, Expectation
from steptwin.host.verify.clock_line import (
    AxisPairs,
    CapturedSteps,
    ClockLine,
    fitted,
    paired_until,
    residual_steps,
    with_late,
)
from steptwin.host.verify.oracle import IdealSteps, ideal_steps
from steptwin.protocol.timer import COUNTS_PER_SECOND

BIN_S: Final = 1e-3
_PPM_SEARCHED: Final = 3000e-6
"""Largest deviation of the clocks' ratio in the search; verification allows far less."""
_BINS_MAX: Final = 1 << 24
"""Highest number of bins of a correlation: 130 MB for each array."""
_LEAST_LIKENESS: Final = 0.3
"""Least correlation of the best offset, as a fraction of the plan's steps."""
_WINDOW_S: Final = 1.0
_LEAST_SAMPLES: Final = 100
"""Shortest part of the motion that is compared: duration, and number of steps of all axes."""
_BINS_OFF: Final = 2.0
"""Error of the best offset in bins: long constant speeds make the maximum flat."""
_SHORTER: Final = 4.0
_GRID: Final = 8
"""Number of offsets and ratios to each side in the first grid."""
_FINE_S: Final = 2e-6
"""Spacing of offsets at which the search ends."""
_GRIDS_MAX: Final = 60
_AROUND: Final = np.arange(-2, 3)
_SAMPLES: Final = 200
"""Number of steps of an axis at which the counts are compared."""


def coarse_offset(ideal: Sequence[IdealSteps], seen: Sequence[CapturedSteps]) -> tuple[float | None, FloatArray]:
    """Return the offset of best correlation, and the correlation of each captured axis with each planned axis.

    The correlation is 1 if all planned steps are found at this offset, and -1 if all are found in the opposite
    direction.
    """
    likeness = np.zeros((len(seen), len(ideal)))
    planned_s = max((float(each.time_s[-1]) for each in ideal if each.time_s.size), default=0.0)
    bin_s = _bin_s(planned_s)
    near, skipped = _drawn_together(seen, planned_s + 2.0 * bin_s)
    end_s = max((float(each.time_s[-1]) for each in near if each.time_s.size), default=0.0)
    size = 1 << int(np.ceil((end_s + planned_s) / bin_s + 2)).bit_length()
    if size > _BINS_MAX:
        raise InputError(
            f"its steps lie scattered over {end_s:.6g} s, and no plan of {planned_s:.6g} s is looked for there: cut it"
        )
    plans, seens = ([_density(each.time_s, each.signs, bin_s, size) for each in all_] for all_ in (ideal, near))
    power = np.array([plan @ plan for plan in plans])
    if not power.any():
        return None, likeness
    alike = np.zeros(size)
    for plan, each in zip(plans, seens, strict=True):
        alike += np.abs(np.fft.irfft(np.conj(np.fft.rfft(plan)) * np.fft.rfft(each), size))
    best = int(np.argmax(alike))
    for j in np.flatnonzero(power):
        likeness[:, j] = [np.roll(each, -best) @ plans[j] / power[j] for each in seens]
    if np.abs(likeness).max(axis=0)[power > 0.0].mean() < _LEAST_LIKENESS:
        return None, likeness
    coarse_s = (best if best <= end_s / bin_s + 1 else best - size) * bin_s
    return coarse_s + skipped(coarse_s), likeness


def _density(time_s: FloatArray, signs: Int8Array, bin_s: float, size: int) -> FloatArray:
    at = (time_s / bin_s).astype(np.int64)
    return np.bincount(at, weights=signs, minlength=size)[:size].astype(np.float64)


def _bin_s(lasts_s: float) -> float:
    """Return the blur of an offset over a motion, caused by the unknown ratio."""
    return max(BIN_S, _PPM_SEARCHED * lasts_s)


def _drawn_together(
    seen: Sequence[CapturedSteps], gap_s: float
) -> tuple[list[CapturedSteps], Callable[[float], float]]:
    """Return the steps with pauses longer than `gap_s` removed, and a function that returns the time removed before.

    So the effort depends on the number of steps, not on the last instant.
    """
    instants = np.sort(np.concatenate([np.zeros(1), *(steps.time_s for steps in seen)]))
    rests_s = np.diff(instants)
    long = np.flatnonzero(rests_s > gap_s)
    until_s, left_out_s = instants[long + 1], np.concatenate(([0.0], np.cumsum(rests_s[long] - gap_s)))
    near = [
        CapturedSteps(each.time_s - left_out_s[np.searchsorted(until_s, each.time_s, "right")], each.signs)
        for each in seen
    ]
    return near, lambda at_s: float(left_out_s[np.searchsorted(until_s - left_out_s[1:], at_s + gap_s / 2.0, "right")])


def alignments(pairs: AxisPairs, coarse_s: float) -> Iterator[tuple[ClockLine, float]]:
    """Yield the lines with the smallest difference in counts, and the part of the motion that each one has used.

    The first one uses the whole motion, which is most exact. If many steps are lost, only the beginning matches.
    """
    begin_s, end_s = (edge(float(plan.time_s[at]) for plan, _ in pairs) for edge, at in ((min, 0), (max, -1)))
    offset_s, reach_s, lasts_s = coarse_s, _BINS_OFF * _bin_s(end_s), end_s - begin_s
    while True:
        samples = [
            _Samples.of(plan, seen, begin_s + lasts_s) for plan, seen in pairs if plan.time_s[0] <= begin_s + lasts_s
        ]
        line = _most_alike(samples, begin_s, lasts_s, offset_s, reach_s, 2 * len(pairs))
        yield line, begin_s + lasts_s
        if begin_s + lasts_s >= end_s:  # the whole motion also shows a rule with equal lateness in both directions
            parts = [part for each in samples for part in each.by_direction()]
            yield _most_alike(parts, begin_s, lasts_s, offset_s, reach_s, 2 * len(pairs)), end_s
        steps = sum(each.at_s.size for each in samples)
        if lasts_s <= _WINDOW_S or steps < _LEAST_SAMPLES:
            return
        offset_s, reach_s = line.offset_s + (line.ratio - 1.0) * begin_s, _BINS_OFF * _bin_s(lasts_s)
        lasts_s /= _SHORTER


class _Samples(NamedTuple):
    """Samples of one axis: instants and counts of the plan and of the capture."""

    at_s: FloatArray
    counts: FloatArray
    signs: Int8Array
    seen_s: FloatArray
    seen_counts: FloatArray

    @classmethod
    def of(cls, plan: IdealSteps, seen: CapturedSteps, until_s: float) -> "_Samples":
        """Return samples up to an instant of the plan."""
        size = int(np.searchsorted(plan.time_s, until_s, "right"))
        some = slice(None, size, -(-size // _SAMPLES))
        return cls(plan.time_s[some], _middles(plan.signs)[some], plan.signs[some], seen.time_s, _middles(seen.signs))

    def by_direction(self) -> "list[_Samples]":
        """Return the samples of steps up and of steps down separately."""
        masks = (self.signs == sign for sign in (1, -1))
        return [
            self._replace(at_s=self.at_s[mask], counts=self.counts[mask], signs=self.signs[mask])
            for mask in masks
            if mask.any()
        ]

    def off_steps(self, offsets_s: FloatArray, ratios: FloatArray) -> FloatArray:
        """Return the sum of differences between captured and planned counts, for each offset with its ratio.

        A constant difference is ignored: homing or the controller's step rule may cause it.
        """
        due_s = offsets_s[:, np.newaxis] + np.outer(ratios, self.at_s)
        apart = np.interp(due_s, self.seen_s, self.seen_counts) - self.counts
        off: FloatArray = np.abs(apart - np.median(apart, axis=1, keepdims=True)).sum(axis=1)
        return off


def _middles(signs: Int8Array) -> FloatArray:
    """Return the counts at the instants of the steps: the mean of those before and after."""
    counts: FloatArray = np.cumsum(signs, dtype=np.int64) - 0.5 * signs
    return counts


def _most_alike(
    samples: Sequence[_Samples], begin_s: float, lasts_s: float, offset_s: float, reach_s: float, directions: int
) -> ClockLine:
    """Return the line with the smallest difference in counts, within `reach_s` of an offset."""
    middle_s = begin_s + lasts_s / 2.0
    best_s, best = offset_s + middle_s, 1.0
    step_s, step, nodes = reach_s / _GRID, _PPM_SEARCHED / _GRID, np.arange(-_GRID, _GRID + 1)
    for _ in range(_GRIDS_MAX):
        at_s, ratios = (each.ravel() for each in np.meshgrid(best_s + step_s * nodes, best + step * nodes))
        at = int(np.argmin(sum(each.off_steps(at_s - ratios * middle_s, ratios) for each in samples)))
        edge = max(abs(at_s[at] - best_s) / step_s, abs(ratios[at] - best) / step) > 1.5
        best_s, best = float(at_s[at]), float(ratios[at])
        if nodes.size == _AROUND.size and edge:
            continue  # the minimum is farther along a valley
        if step_s < _FINE_S:
            break
        nodes, step_s, step = _AROUND, step_s / 2.0, step / 2.0
    return ClockLine(best_s - best * middle_s, best, np.zeros(directions))


def apart_steps(pairs: AxisPairs, line: ClockLine) -> float:
    """Return the sum of differences between captured and planned counts on a line, over some steps of all axes."""
    samples = [_Samples.of(plan, seen, float(plan.time_s[-1])) for plan, seen in pairs]
    offset_s, ratio = np.array([line.offset_s]), np.array([line.ratio])
    return float(sum(part.off_steps(offset_s, ratio)[0] for each in samples for part in each.by_direction()))


_AS_MUCH: Final = 0.2
"""Largest difference in correlation of an axis that still moves as planned."""
_NEAR_STEPS: Final = 0.3
_AS_NEAR: Final = 0.97
"""Least fraction of the best line's close pairs with which another line is equivalent."""
_ALL_NEAR: Final = 0.999
_SAME_SPREAD_STEPS: Final = 1e-3
_PAIRINGS_OF_PART: Final = 3
_PAIRINGS: Final = 20
"""Highest number of iterations of pairing and fitting, for a part of the motion and for all of it."""


@dataclass(frozen=True, slots=True)
class ClockFit:
    """A plan's time in a capture: an instant t of the plan is at offset_s + ratio * t of the capture.

    Attributes:
        offset_s: time of the capture at the plan's t = 0.
        ratio: seconds of the capture per second of the plan.
        offset_uncertainty_s: standard error of the offset.
        ratio_uncertainty: standard error of the ratio.
        pairs: number of pairs of steps in the fit.
        inverted: indices of the axes that turn in the opposite direction.
        swapped: pairs of indices of axes that are exchanged.
        found: False if no offset matches the plan; then both first steps are aligned.
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
        """Deviation of the analyser's clock from the plan, in ppm; positive if it counts more time."""
        return (self.ratio - 1.0) * 1e6

    def plan_s(self, times_s: FloatArray) -> FloatArray:
        """Convert instants of the capture to the plan's time."""
        planned_s: FloatArray = (times_s - self.offset_s) / self.ratio
        return planned_s


def fit_clock(ideal: Sequence[IdealSteps], seen: Sequence[CapturedSteps]) -> ClockFit:
    """Fit a plan's ideal steps to the captured ones, axis by axis; raise InputError if these are too scattered."""
    coarse_s, likeness = coarse_offset(ideal, seen)
    first = [steps.time_s[0] for steps in seen if steps.time_s.size]
    if coarse_s is None or not first:
        planned = min((steps.time_s[0] for steps in ideal if steps.time_s.size), default=0.0)
        return ClockFit(float(min(first, default=0.0) - planned), 1.0, np.inf, np.inf, 0, found=False)
    moving = [i for i, steps in enumerate(ideal) if steps.time_s.size and seen[i].time_s.size]
    swapped = _swapped(likeness, moving)
    of_plan = {i: i for i in moving} | {i: j for pair in swapped for i, j in (pair, pair[::-1])}
    inverted = tuple(i for i in moving if likeness[i, of_plan[i]] < 0.0)
    turned = [
        CapturedSteps(steps.time_s, -steps.signs if i in inverted else steps.signs) for i, steps in enumerate(seen)
    ]
    pairs = [(ideal[of_plan[i]], turned[i]) for i in moving]
    found: list[_Found] = []
    for line, until_s in alignments(pairs, coarse_s):
        found.append(_fitted(pairs, line, until_s))
        if found[-1].near >= _ALL_NEAR * found[-1].pairs:
            break  # the others cannot be better
    line, errors, count = _best(found)
    return ClockFit(line.offset_s, line.ratio, *errors, count, inverted, swapped)


def begun_by_steps(expected: Expectation, evidence: Evidence) -> Evidence:
    """Return evidence whose t = 0 is determined by its steps, for a controller that does not report its start.

    The clock's ratio does not change. If the plan is not found, both first steps are aligned.
    """
    zeros = tuple(round(float(expected.axis_position(axis, np.zeros(1))[0])) for axis in range(len(evidence.axes)))
    ideal = ideal_steps(expected.axis_motion, expected.steps_per_unit, zeros)
    clock = fit_clock(
        ideal, [CapturedSteps(axis.step_counts / COUNTS_PER_SECOND, axis.step_signs) for axis in evidence.axes]
    )
    return replace(evidence, start_counts=max(round(clock.offset_s * COUNTS_PER_SECOND), 0))


def _swapped(likeness: FloatArray, moving: Sequence[int]) -> tuple[tuple[int, int], ...]:
    """Return the pairs of exchanged axes: each moves as planned for the other one."""
    alike = np.abs(np.abs(likeness) - 1.0) < _AS_MUCH
    astray = [i for i in moving if not alike[i, i]]
    return tuple((i, j) for i in astray for j in astray if i < j and alike[i, j] and alike[j, i])


def _best(found: "Sequence[_Found]") -> tuple[ClockLine, tuple[float, float], int]:
    """Return the best line, its errors and the number of its pairs.

    After lost steps the counts differ permanently, but pairs stay close. With an inexact controller few pairs are close
    to any line.
    """
    most = max(each.near for each in found)
    near = [each for each in found if each.near >= _AS_NEAR * most]
    least = min(each.spread_steps for each in near) + _SAME_SPREAD_STEPS
    best = min((each for each in near if each.spread_steps < 2.0 * least), key=attrgetter("apart_steps"))
    return best.line, best.errors, best.pairs


class _Found(NamedTuple):
    """A line and its quality.

    Attributes:
        line: the line.
        errors: errors of its offset and ratio.
        pairs: number of pairs.
        near: number of pairs close to the line.
        spread_steps: typical distance of a pair from the line.
        apart_steps: sum of the differences in counts, over some steps.
    """

    line: ClockLine
    errors: tuple[float, float]
    pairs: int
    near: int
    spread_steps: float
    apart_steps: float


def _fitted(pairs: AxisPairs, line: ClockLine, until_s: float) -> _Found:
    """Extend a line that fits the beginning of the motion to the whole motion."""
    end_s = max(float(plan.time_s[-1]) for plan, _ in pairs)
    line = with_late(pairs, line, until_s)
    while True:
        for _ in range(_PAIRINGS if until_s >= end_s else _PAIRINGS_OF_PART):
            before = line
            paired = paired_until(pairs, line, until_s)
            line, errors = fitted(paired, line)
            if line.agrees(before, until_s):
                break
        if until_s >= end_s:
            off_steps = np.abs(residual_steps(paired, line))
            near, spread = int(np.count_nonzero(off_steps < _NEAR_STEPS)), float(np.median(off_steps))
            return _Found(line, errors(), off_steps.size, near, spread, apart_steps(pairs, line))
        until_s *= 2.0
