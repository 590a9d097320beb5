"""Pair the steps that a method made with the ideal crossings, also where it leaves out or adds steps.

Between two passages of the same threshold in the same direction a motion must turn around twice. So a step and a
crossing belong together if they pass the same threshold in the same direction and each is the other's nearest in time.
A step that comes many intervals late, or a step left out at a reversal, does not shift any other pair.
"""

from dataclasses import dataclass

import numpy as np

from steptwin.host.common.arrays import FloatArray, Int8Array, Int64Array
from steptwin.host.verify.roots import IndexArray


@dataclass(frozen=True, slots=True, eq=False)
class Pairing:
    """Indices of the paired crossings and steps, both of shape (pairs,), in order of the crossings."""

    ideal: IndexArray
    made: IndexArray
    missing: int
    """Number of crossings without a step."""
    extra: int
    """Number of steps without a crossing."""


def pair(
    start_steps: int, ideal_s: FloatArray, ideal_signs: Int8Array, made_s: FloatArray, made_signs: Int8Array
) -> Pairing:
    """Pair the crossings and the steps of one axis; both are sorted by time."""
    if not (len(ideal_s) and len(made_s)):
        none = np.empty(0, np.intp)
        return Pairing(none, none, len(ideal_s), len(made_s))
    span_s = 4 * (max(ideal_s[-1], made_s[-1]) - min(ideal_s[0], made_s[0]) + 1)
    ideal_keys, made_keys = _passages(start_steps, ideal_signs), _passages(start_steps, made_signs)
    keys = np.unique(np.concatenate((ideal_keys, made_keys)), return_inverse=True)[1]
    # Shift every threshold and direction into a time span of its own, so that one search finds all nearest neighbours.
    ideal_at, made_at = keys[: len(ideal_s)] * span_s + ideal_s, keys[len(ideal_s) :] * span_s + made_s
    to_made, to_ideal = _nearest(ideal_at, made_at), _nearest(made_at, ideal_at)
    mutual = to_ideal[to_made] == np.arange(len(ideal_s))
    ideal = np.flatnonzero(mutual & (np.abs(ideal_at - made_at[to_made]) < span_s / 2))
    return Pairing(ideal, to_made[ideal], len(ideal_s) - len(ideal), len(made_s) - len(ideal))


def _passages(start_steps: int, signs: Int8Array) -> Int64Array:
    """Return for each step a number that identifies its threshold and its direction."""
    after = start_steps + np.cumsum(signs, dtype=np.int64)
    passages: Int64Array = 2 * np.minimum(after, after - signs) + (signs > 0)
    return passages


def _nearest(values: FloatArray, candidates: FloatArray) -> IndexArray:
    """Return for each value the index of the nearest candidate; both may be unsorted."""
    order = np.argsort(candidates, kind="stable")
    ordered = candidates[order]
    right = np.minimum(np.searchsorted(ordered, values), len(ordered) - 1)
    left = np.maximum(right - 1, 0)
    nearer_left = np.abs(values - ordered[left]) <= np.abs(ordered[right] - values)
    nearest: IndexArray = order[np.where(nearer_left, left, right)]
    return nearest
