"""Search a capture for a plan: the offset at which both are most alike, to some steps.

1. The density of signed steps, of plan and capture, is correlated at all offsets. Its bins are as wide as the unknown
   ratio of the clocks blurs the offset: 0.3 % of the motion.
2. Around the best offset the counts are compared, over shorter and shorter parts of the motion's beginning.
"""

from collections.abc import Callable, Iterator, Sequence
from typing import Final, NamedTuple

import numpy as np

from steptwin.host.common.arrays import FloatArray, Int8Array
from steptwin.host.common.errors import InputError
from steptwin.host.verify.clock_line import AxisPairs, ClockLine, SeenSteps
from steptwin.host.verify.oracle import IdealSteps

BIN_S: Final = 1e-3
_PPM_SEARCHED: Final = 3000e-6
"""Ratio up to which the plan is found; far less passes."""
_BINS_MAX: Final = 1 << 24
"""Bins of a correlation, of 130 MB each."""
_LEAST_LIKENESS: Final = 0.3
"""Part of the plan's steps that the best offset must find."""
_WINDOW_S: Final = 1.0
_LEAST_SAMPLES: Final = 100
"""The part of the motion that is looked at last: so long, and steps of all axes."""
_BINS_OFF: Final = 2.0
"""Bins by which the best offset may be off: speeds that are constant for long make it blunt."""
_SHORTER: Final = 4.0
_GRID: Final = 8
"""Offsets and ratios to either side that are tried first."""
_FINE_S: Final = 2e-6
"""Distance of two offsets at which the comparison ends."""
_GRIDS_MAX: Final = 60
_AROUND: Final = np.arange(-2, 3)
_SAMPLES: Final = 200
"""Steps of an axis at which the counts are compared."""


def coarse_offset(ideal: Sequence[IdealSteps], seen: Sequence[SeenSteps]) -> tuple[float | None, FloatArray]:
    """Return the offset at which plan and capture are most alike, and each seen axis' likeness to each plan.

    The likeness is 1 if all steps of the plan are there at this offset, and -1 if all are there the other way.
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
    """Return the time by which an offset is blurred over a motion, since the ratio is not known."""
    return max(BIN_S, _PPM_SEARCHED * lasts_s)


def _drawn_together(seen: Sequence[SeenSteps], gap_s: float) -> tuple[list[SeenSteps], Callable[[float], float]]:
    """Return the steps without the time in which nothing moves for longer, and how much time is left out before one.

    So the work goes by the number of steps and not by the last instant.
    """
    instants = np.sort(np.concatenate([np.zeros(1), *(steps.time_s for steps in seen)]))
    rests_s = np.diff(instants)
    long = np.flatnonzero(rests_s > gap_s)
    until_s, left_out_s = instants[long + 1], np.concatenate(([0.0], np.cumsum(rests_s[long] - gap_s)))
    near = [
        SeenSteps(each.time_s - left_out_s[np.searchsorted(until_s, each.time_s, "right")], each.signs) for each in seen
    ]
    return near, lambda at_s: float(left_out_s[np.searchsorted(until_s - left_out_s[1:], at_s + gap_s / 2.0, "right")])


def alignments(pairs: AxisPairs, coarse_s: float) -> Iterator[tuple[ClockLine, float]]:
    """Yield the lines on which the counts are most like the plan's, and how far each looked: all of it, then less.

    The whole motion tells most, but where many steps are lost, only its beginning does.
    """
    begin_s, end_s = (edge(float(plan.time_s[at]) for plan, _ in pairs) for edge, at in ((min, 0), (max, -1)))
    offset_s, reach_s, lasts_s = coarse_s, _BINS_OFF * _bin_s(end_s), end_s - begin_s
    while True:
        samples = [
            _Samples.of(plan, seen, begin_s + lasts_s) for plan, seen in pairs if plan.time_s[0] <= begin_s + lasts_s
        ]
        line = _most_alike(samples, begin_s, lasts_s, offset_s, reach_s, 2 * len(pairs))
        yield line, begin_s + lasts_s
        if begin_s + lasts_s >= end_s:  # all of it tells a rule whose steps up and down are late alike, too
            ways = [way for each in samples for way in each.one_way()]
            yield _most_alike(ways, begin_s, lasts_s, offset_s, reach_s, 2 * len(pairs)), end_s
        steps = sum(each.at_s.size for each in samples)
        if lasts_s <= _WINDOW_S or steps < _LEAST_SAMPLES:
            return
        offset_s, reach_s = line.offset_s + (line.ratio - 1.0) * begin_s, _BINS_OFF * _bin_s(lasts_s)
        lasts_s /= _SHORTER


class _Samples(NamedTuple):
    """Some steps of one axis' plan, by instants and counts, and the steps seen likewise."""

    at_s: FloatArray
    counts: FloatArray
    signs: Int8Array
    seen_s: FloatArray
    seen_counts: FloatArray

    @classmethod
    def of(cls, plan: IdealSteps, seen: SeenSteps, until_s: float) -> "_Samples":
        """Return samples up to an instant of the plan."""
        size = int(np.searchsorted(plan.time_s, until_s, "right"))
        some = slice(None, size, -(-size // _SAMPLES))
        return cls(plan.time_s[some], _middles(plan.signs)[some], plan.signs[some], seen.time_s, _middles(seen.signs))

    def one_way(self) -> "list[_Samples]":
        """Return those up and those down, where there are any."""
        ways = (self.signs == sign for sign in (1, -1))
        return [
            self._replace(at_s=self.at_s[way], counts=self.counts[way], signs=self.signs[way])
            for way in ways
            if way.any()
        ]

    def off_steps(self, offsets_s: FloatArray, ratios: FloatArray) -> FloatArray:
        """Return by how many steps the counts seen are off the plan's, added, for each offset with its ratio.

        What they are off all the time does not count: that may have been homing, or the controller's step rule.
        """
        due_s = offsets_s[:, np.newaxis] + np.outer(ratios, self.at_s)
        apart = np.interp(due_s, self.seen_s, self.seen_counts) - self.counts
        off: FloatArray = np.abs(apart - np.median(apart, axis=1, keepdims=True)).sum(axis=1)
        return off


def _middles(signs: Int8Array) -> FloatArray:
    """Return the counts at the instants of the steps: between the one before and the one after."""
    counts: FloatArray = np.cumsum(signs, dtype=np.int64) - 0.5 * signs
    return counts


def _most_alike(
    samples: Sequence[_Samples], begin_s: float, lasts_s: float, offset_s: float, reach_s: float, ways: int
) -> ClockLine:
    """Return the line, up to `reach_s` from an offset, on which the counts seen are least off the plan's."""
    middle_s = begin_s + lasts_s / 2.0
    best_s, best = offset_s + middle_s, 1.0
    step_s, step, nodes = reach_s / _GRID, _PPM_SEARCHED / _GRID, np.arange(-_GRID, _GRID + 1)
    for _ in range(_GRIDS_MAX):
        at_s, ratios = (each.ravel() for each in np.meshgrid(best_s + step_s * nodes, best + step * nodes))
        at = int(np.argmin(sum(each.off_steps(at_s - ratios * middle_s, ratios) for each in samples)))
        edge = max(abs(at_s[at] - best_s) / step_s, abs(ratios[at] - best) / step) > 1.5
        best_s, best = float(at_s[at]), float(ratios[at])
        if nodes.size == _AROUND.size and edge:
            continue  # it lies farther along a valley
        if step_s < _FINE_S:
            break
        nodes, step_s, step = _AROUND, step_s / 2.0, step / 2.0
    return ClockLine(best_s - best * middle_s, best, np.zeros(ways))


def apart_steps(pairs: AxisPairs, line: ClockLine) -> float:
    """Return by how much the counts seen are off the plan's on a line, added over some steps of all axes."""
    samples = [_Samples.of(plan, seen, float(plan.time_s[-1])) for plan, seen in pairs]
    offset_s, ratio = np.array([line.offset_s]), np.array([line.ratio])
    return float(sum(way.off_steps(offset_s, ratio)[0] for each in samples for way in each.one_way()))
