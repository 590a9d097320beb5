"""Match accepted steps to ideal crossings, and measure how late each step came.

If both sides step up and down in the same order, the k-th step belongs to the k-th crossing. Otherwise a step belongs
to the crossing of its own direction that is nearest in time, if it is also the nearest step to that crossing. All other
steps and crossings are unmatched. So one lost pulse is one unmatched crossing, and later steps keep their partners.
"""

from dataclasses import dataclass
from math import nan

import numpy as np

from steptwin.host.common.arrays import FloatArray
from steptwin.host.verify.counted import CountedSteps
from steptwin.host.verify.oracle import IdealSteps, IndexArray

SLOW_CROSSING = 0.01
"""Crossings slower than this fraction of the axis' fastest have no timing error: near a reversal a small position
error shifts the crossing by a long time.
"""

MICROSECONDS = 1e6


@dataclass(frozen=True, slots=True)
class Matching:
    """Pairs of ideal crossings and accepted steps of one axis.

    Attributes:
        ideal: shape (pairs,), index of each crossing.
        counted: shape (pairs,), index of its step.
        unmatched: number of crossings without a step, plus number of steps without a crossing.
        grazing: number of those that another step rule explains; 0 for the oracle's own rule.
        off_steps: for any step rule, the largest distance of the motion from a threshold when its step was made.
        first_s: time of the first crossing or step without a partner; NaN if all have one.
    """

    ideal: IndexArray
    counted: IndexArray
    unmatched: int
    grazing: int = 0
    off_steps: float = 0.0
    first_s: float = nan


def match_steps(ideal: IdealSteps, counted: CountedSteps) -> Matching:
    """Pair one axis' ideal crossings with its accepted steps."""
    if np.array_equal(ideal.signs, counted.signs):
        index = np.arange(len(ideal.signs))
        return Matching(index, index, 0)
    return match_nearest(ideal, counted)


def match_nearest(ideal: IdealSteps, counted: CountedSteps) -> Matching:
    """Pair the crossings and steps of one axis that are each other's nearest in their direction."""
    pairs = _nearest_pairs(ideal, counted)
    alone_s = np.concatenate([np.delete(ideal.time_s, pairs[0]), np.delete(counted.time_s, pairs[1])])
    return Matching(*pairs, alone_s.size, first_s=float(alone_s.min()) if alone_s.size else nan)


def timing_errors_us(ideal: IdealSteps, counted: CountedSteps, matching: Matching) -> FloatArray:
    """Return the lateness of each matched step, in order; negative is early. Steps at slow crossings are left out."""
    if matching.ideal.size == 0:
        return np.empty(0)
    speeds_hz = ideal.speeds_hz[matching.ideal]
    fast = speeds_hz >= SLOW_CROSSING * ideal.speeds_hz.max()
    late_s = counted.time_s[matching.counted[fast]] - ideal.time_s[matching.ideal[fast]]
    return np.asarray(late_s * MICROSECONDS)


def _nearest_pairs(ideal: IdealSteps, counted: CountedSteps) -> tuple[IndexArray, IndexArray]:
    down, up = (_mutual_pairs(ideal, counted, sign) for sign in (-1, 1))
    crossings, steps = np.concatenate([down[0], up[0]]), np.concatenate([down[1], up[1]])
    order = np.argsort(crossings)
    return crossings[order], steps[order]


def _mutual_pairs(ideal: IdealSteps, counted: CountedSteps, sign: int) -> tuple[IndexArray, IndexArray]:
    """Pair the crossings and steps of one direction that are each other's nearest."""
    crossings, steps = np.flatnonzero(ideal.signs == sign), np.flatnonzero(counted.signs == sign)
    if crossings.size == 0 or steps.size == 0:
        return crossings[:0], steps[:0]
    to_step = _nearest(ideal.time_s[crossings], counted.time_s[steps])
    to_crossing = _nearest(counted.time_s[steps], ideal.time_s[crossings])
    mutual = to_crossing[to_step] == np.arange(crossings.size)
    return crossings[mutual], steps[to_step[mutual]]


def _nearest(times_s: FloatArray, candidates_s: FloatArray) -> IndexArray:
    """Return the index of the nearest candidate for each time; candidates are sorted."""
    right = np.searchsorted(candidates_s, times_s)
    left = np.maximum(right - 1, 0)
    right = np.minimum(right, len(candidates_s) - 1)
    nearer_left = times_s - candidates_s[left] <= candidates_s[right] - times_s
    return np.where(nearer_left, left, right)
