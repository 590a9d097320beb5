"""Search a capture for a plan: the offset of best correlation, with an error of some steps.

1. The densities of signed steps of plan and capture are correlated at all offsets. The width of their bins is the blur
   by the unknown ratio of the clocks: 0.3 % of the motion.
2. Around the best offset the counts are compared, over ever shorter parts of the motion's beginning.
"""

from collections.abc import Callable, Iterator, Sequence
from typing import Final, NamedTuple

import numpy as np

from steptwin.host.common.arrays import FloatArray, Int8Array
from steptwin.host.common.errors import InputError
from steptwin.host.verify.clock_line import AxisPairs, CapturedSteps, ClockLine
from steptwin.host.verify.oracle import IdealSteps

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
