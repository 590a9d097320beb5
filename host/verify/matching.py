"""Which accepted step answers which ideal crossing, and how late it came.

Where both sides step up and down in the same order, the k-th step answers the k-th crossing. Where they do not, a step
answers the crossing of the same transition (the same two counter values, the same way) that is nearest to it in time,
if it is also the nearest to that crossing; all others on both sides are unmatched.
"""

from dataclasses import dataclass

import numpy as np

from host.trajectory import FloatArray
from host.verify.counted import CountedSteps
from host.verify.evidence import Int8Array, Int64Array
from host.verify.oracle import IdealSteps
from host.verify.roots import IndexArray

SLOW_CROSSING = 0.01
"""Crossings slower than this part of the axis' fastest have no timing error: near a reversal time is ill-defined."""

MICROSECONDS = 1e6


@dataclass(frozen=True, slots=True)
class Matching:
    """Pairs of ideal crossings and accepted steps of one axis.

    Attributes:
        ideal: shape (pairs,), indices of crossings.
        counted: shape (pairs,), the indices of their steps.
        unmatched: how many crossings and steps have no partner, together.
    """

    ideal: IndexArray
    counted: IndexArray
    unmatched: int


def match_steps(ideal: IdealSteps, counted: CountedSteps) -> Matching:
    """Pair one axis' ideal crossings with its accepted steps."""
    if np.array_equal(ideal.signs, counted.signs):
        index = np.arange(len(ideal.signs))
        return Matching(index, index, 0)
    pairs = _nearest_pairs(ideal, counted)
    unmatched = len(ideal.signs) + len(counted.signs) - 2 * len(pairs[0])
    return Matching(*pairs, unmatched)


def timing_errors_us(ideal: IdealSteps, counted: CountedSteps, matching: Matching) -> FloatArray:
    """How late each matched step came, in order, without those at slow crossings; negative is early."""
    if matching.ideal.size == 0:
        return np.empty(0)
    speeds_hz = ideal.speeds_hz[matching.ideal]
    fast = speeds_hz >= SLOW_CROSSING * ideal.speeds_hz.max()
    late_s = counted.time_s[matching.counted[fast]] - ideal.time_s[matching.ideal[fast]]
    return np.asarray(late_s * MICROSECONDS)


def _nearest_pairs(ideal: IdealSteps, counted: CountedSteps) -> tuple[IndexArray, IndexArray]:
    if len(ideal.signs) == 0 or len(counted.signs) == 0:
        return np.empty(0, np.intp), np.empty(0, np.intp)
    ideal_counters = ideal.start_steps + np.concatenate(([0], np.cumsum(ideal.signs, dtype=np.int64)))
    ideal_keys = _transitions(ideal_counters, ideal.signs)
    counted_keys = _transitions(counted.counters, counted.signs)
    # One axis for both: transitions lie so far apart that the nearest neighbour is of the same one if there is one.
    spacing_s = 2.0 * (1.0 + max(ideal.time_s[-1], counted.time_s[-1]))
    lowest = min(ideal_keys.min(), counted_keys.min())
    ideal_places = (ideal_keys - lowest) * spacing_s + ideal.time_s
    counted_places = (counted_keys - lowest) * spacing_s + counted.time_s
    to_counted = _nearest(ideal_places, counted_places)
    to_ideal = _nearest(counted_places, ideal_places)
    index = np.arange(len(ideal_keys))
    mutual = (to_ideal[to_counted] == index) & (counted_keys[to_counted] == ideal_keys)
    return index[mutual], to_counted[mutual]


def _transitions(counters: Int64Array, signs: Int8Array) -> Int64Array:
    """A number for each step's two counter values and its way between them."""
    return 2 * np.minimum(counters[:-1], counters[1:]) + (signs > 0)


def _nearest(places: FloatArray, candidates: FloatArray) -> IndexArray:
    """For each place the index of the nearest candidate."""
    order = np.argsort(candidates, kind="stable")
    ranked = candidates[order]
    right = np.searchsorted(ranked, places)
    left = np.maximum(right - 1, 0)
    right = np.minimum(right, len(ranked) - 1)
    nearest = np.where(places - ranked[left] <= ranked[right] - places, left, right)
    return np.asarray(order[nearest], np.intp)
