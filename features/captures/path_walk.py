"""Walk a path beside counts of steps: where on the path may the machine be after each event?

The path is a line of straight segments in steps, a place on it a number: the vertex before it plus the part of the
segment. A count agrees with a place if no axis is further away than `half`. After each event the machine may be at the
places that agree with the counts and that are reached forwards only, from the places before, through places that agree.
They are a few intervals. If there are none, the counts have left the path. This decides exactly whether path and counts
have a Frechet distance of at most `half`.

With layers, up to that many pulses of one axis may have been lost (`sign` as its motion) or added (against it): a set
of layer m comes from layer m - 1 by a step that no event shows, or by an event that is no step.

The loops are plain functions of numbers, which give the same bits compiled by numba (extra `fast`), for long captures.

Source: H. Alt, M. Godau, "Computing the Frechet distance between two polygonal curves", International Journal of
Computational Geometry & Applications 5, 1995, section 3.
"""

from collections.abc import Callable, Sequence
from functools import cache
from importlib.util import find_spec
from types import FunctionType
from typing import Any, Final, NamedTuple

import numpy as np

from steptwin.host.common.arrays import FloatArray, Int8Array, Int64Array

_INTERVALS: Final = 16
"""Intervals of one set that are kept; further ones, which few self-crossings make, are dropped."""
_LONG: Final = 200_000
"""Number of sets from which on to load numba takes less time than it saves."""


class ReachedPlaces(NamedTuple):
    """Places that may be reached after each event, by their hulls; an empty set has a low above its high.

    Attributes:
        lows: shape (events + 1, layers + 1), in the first row before any event.
        highs: likewise.
    """

    lows: FloatArray
    highs: FloatArray

    def events(self, layer: int = 0) -> int:
        """Return after how many events a layer has places at last; -1 if it never has."""
        alive = np.flatnonzero(self.highs[:, layer] >= self.lows[:, layer])
        return int(alive[-1]) if alive.size else -1

    def at(self, event: int, layer: int = 0) -> tuple[float, float]:
        """Return the hull of the places after an event."""
        return float(self.lows[event, layer]), float(self.highs[event, layer])


def reach(
    points: FloatArray,
    half: float,
    changes: Int8Array,
    count: FloatArray,
    begin: tuple[float, float],
    axis: int = 0,
    sign: int = 1,
    layers: int = 0,
) -> ReachedPlaces:
    """Return where the machine may be after each event.

    Args:
        points: shape (axes, vertices), the path in steps; at least two vertices.
        half: largest distance of a count from the path, in steps.
        changes: shape (events, axes), the steps of each event.
        count: shape (axes,), before the first event.
        begin: hull of the places before the first event.
        axis: axis of pulses lost or added.
        sign: what one of them is short by.
        layers: most of them; 0 for none.
    """
    shape = len(changes) + 1, layers + 1
    found = ReachedPlaces(np.ones(shape), np.zeros(shape))
    is_long = len(changes) * (layers + 1) >= _LONG or compiled_walk.cache_info().currsize > 0
    if is_long and find_spec("numba"):
        steps: Any = changes
        compiled_walk()(points, half, steps, count.copy(), begin, axis, sign, found.lows, found.highs)
        return found
    lows, highs = found.lows.tolist(), found.highs.tolist()
    walk(points.tolist(), half, changes.tolist(), count.tolist(), begin, axis, sign, lows, highs)
    return ReachedPlaces(np.array(lows), np.array(highs))


def reach_back(
    points: FloatArray, half: float, changes: Int8Array, count: FloatArray, end: tuple[float, float], **lost: int
) -> ReachedPlaces:
    """Return from where the end can be reached, before each event: `count` and `end` are those after the last one.

    Of the layers the last one holds at the end, as for `reach`.
    """
    last = points.shape[1] - 1.0
    lost = lost | {"sign": -lost.get("sign", 1)}
    turned = -changes[::-1]
    back = reach(np.ascontiguousarray(points[:, ::-1]), half, turned, count, (last - end[1], last - end[0]), **lost)
    empty = back.highs < back.lows
    lows, highs = last - back.highs, last - back.lows
    lows[empty], highs[empty] = 1.0, 0.0
    return ReachedPlaces(lows[::-1, ::-1], highs[::-1, ::-1])


def agreeing(points: FloatArray, half: float, count: FloatArray, begin: float) -> list[tuple[float, float]]:
    """Return the places that agree with a count, from a place on, as intervals in order."""
    first = min(int(begin), points.shape[1] - 2)
    start, way = points[:, first:-1], np.diff(points[:, first:])
    off = start - count[:, np.newaxis]
    with np.errstate(divide="ignore", invalid="ignore"):
        one, other = (-half - off) / way, (half - off) / way
    flat = way == 0.0
    inside = np.abs(off) <= half
    low = np.where(flat, np.where(inside, 0.0, 2.0), np.minimum(one, other)).max(axis=0)
    high = np.where(flat, 1.0, np.maximum(one, other)).min(axis=0)
    low, high = np.maximum(low, 0.0), np.minimum(high, 1.0)
    found: list[tuple[float, float]] = []
    for i in np.flatnonzero(low <= high).tolist():
        here, there = first + i + float(low[i]), first + i + float(high[i])
        if found and here <= found[-1][1]:
            found[-1] = found[-1][0], there
        else:
            found.append((here, there))
    return [(max(here, begin), there) for here, there in found if there >= begin]


def part(points: Any, half: float, count: Any, segment: int) -> tuple[float, float]:
    """Return the part of a segment that agrees with a count, from 0 to 1; none if it ends before it begins."""
    low, high = 0.0, 1.0
    for x in range(len(points)):
        off = points[x][segment] - count[x]
        way = points[x][segment + 1] - points[x][segment]
        if way > 0.0:
            low, high = max(low, (-half - off) / way), min(high, (half - off) / way)
        elif way < 0.0:
            low, high = max(low, (half - off) / way), min(high, (-half - off) / way)
        elif off > half or off < -half:
            high = -1.0
    return low, high


def advance(
    points: Any, half: float, count: Any, begins: Any, ends: Any, size: int, made_begins: Any, made_ends: Any
) -> int:
    """Write the places that agree with a count and are reached from intervals in order; return their number."""
    last = len(points[0]) - 2
    made, at = 0, -1.0
    for j in range(size):
        low, high = max(begins[j], at), ends[j]
        if high <= at or low > high:
            continue
        i, is_open = min(int(low), last), False
        while i <= last:
            f_low, f_high = part(points, half, count, i)
            if is_open and (f_low > 0.0 or f_high < f_low):
                at, made, is_open = made_ends[made], made + 1, False
            if is_open:
                made_ends[made] = i + f_high
            else:
                here = max(i + f_low, low)
                if f_low <= f_high and here <= i + f_high:
                    if here > high or made == _INTERVALS:
                        break
                    made_begins[made], made_ends[made], is_open = here, i + f_high, True
            if is_open and f_high < 1.0:
                at, made, is_open = made_ends[made], made + 1, False
            i += 1
            if not is_open and i > high:
                break
        if is_open:
            at, made = made_ends[made], made + 1
    return made


def join(
    begins: Any, ends: Any, size: int, more_begins: Any, more_ends: Any, more: int, all_begins: Any, all_ends: Any
) -> int:
    """Write the intervals of two sets in one order; return their number."""
    i = j = 0
    while i + j < size + more:
        if j == more or (i < size and begins[i] <= more_begins[j]):
            all_begins[i + j], all_ends[i + j] = begins[i], ends[i]
            i += 1
        else:
            all_begins[i + j], all_ends[i + j] = more_begins[j], more_ends[j]
            j += 1
    return size + more


def walk(
    points: Any,
    half: float,
    changes: Any,
    count: Any,
    begin: tuple[float, float],
    axis: int,
    sign: int,
    lows: Any,
    highs: Any,
) -> None:
    """Write the hulls of the places after each event, by layers, until no layer has any."""
    layers = len(lows[0])
    begins = [[0.0] * _INTERVALS for _ in range(layers)]
    ends = [[0.0] * _INTERVALS for _ in range(layers)]
    new_begins = [[0.0] * _INTERVALS for _ in range(layers)]
    new_ends = [[0.0] * _INTERVALS for _ in range(layers)]
    sizes = [0] * layers
    two_begins, two_ends = [0.0] * (2 * _INTERVALS), [0.0] * (2 * _INTERVALS)
    all_begins, all_ends = [0.0] * (3 * _INTERVALS), [0.0] * (3 * _INTERVALS)
    begins[0][0], ends[0][0], sizes[0] = begin[0], begin[1], 1
    for k in range(len(lows)):
        if k > 0:
            for x in range(len(count)):
                count[x] += changes[k - 1][x]
        anywhere = False
        before = new_size = 0
        for m in range(layers):
            was = sizes[m]
            if m == 0:
                size = join(begins[0], ends[0], was, begins[0], ends[0], 0, all_begins, all_ends)
            else:  # the step that no event shows comes before this event, or after it
                two = join(
                    begins[m - 1],
                    ends[m - 1],
                    before,
                    new_begins[m - 1],
                    new_ends[m - 1],
                    new_size,
                    two_begins,
                    two_ends,
                )
                size = join(begins[m], ends[m], was, two_begins, two_ends, two, all_begins, all_ends)
                count[axis] += sign
            new_size = advance(points, half, count, all_begins, all_ends, size, new_begins[m], new_ends[m])
            if new_size > 0:
                anywhere = True
                lows[k][m], highs[k][m] = new_begins[m][0], new_ends[m][new_size - 1]
            before, sizes[m] = was, new_size
        count[axis] -= sign * (layers - 1)
        begins, new_begins = new_begins, begins
        ends, new_ends = new_ends, ends
        if not anywhere:
            break


@cache
def compiled_walk() -> Callable[..., None]:
    """Return `walk` as numba compiles it."""
    import numba

    def compiled(function: Any, **called: Any) -> Any:
        linked = FunctionType(function.__code__, {**globals(), **called}, function.__name__)
        linked.__module__ = __name__
        return numba.njit(cache=True, error_model="numpy")(linked)

    made: Callable[..., None] = compiled(walk, advance=compiled(advance, part=compiled(part)), join=compiled(join))
    return made


def counts_after(changes: Int8Array, event: int, count: FloatArray) -> FloatArray:
    """Return the counts after an event, from those before the first one."""
    passed: Int64Array = changes[:event].sum(axis=0, dtype=np.int64)
    return count + passed


class Events(NamedTuple):
    """Steps of all axes by groups that a capture cannot order, at most one step of an axis in each.

    Attributes:
        time_s: shape (events,), of the last step of each.
        changes: shape (events, axes), +1, 0 or -1.
    """

    time_s: FloatArray
    changes: Int8Array


def events_of(times_s: Sequence[FloatArray], signs: Sequence[Int8Array], apart_s: float) -> Events:
    """Return the events of steps, by axis; steps are in one event if each is at most `apart_s` after another."""
    axes = len(times_s)
    time_s = np.concatenate(times_s)
    axis = np.repeat(np.arange(axes), [each.size for each in times_s])
    order = np.argsort(time_s, kind="stable")
    time_s, axis, sign = time_s[order], axis[order], np.concatenate(signs)[order]
    if not time_s.size:
        return Events(time_s, np.empty((0, axes), np.int8))
    first = np.append(True, np.diff(time_s) > apart_s)
    group = np.cumsum(first) - 1
    twice = np.bincount(np.unique(group * axes + axis) // axes) < np.bincount(group)
    begins = np.append(np.flatnonzero(first), time_s.size)
    for begin, end in zip(begins[:-1][twice].tolist(), begins[1:][twice].tolist(), strict=True):
        seen: set[int] = set()
        for i, own in enumerate(axis[begin:end].tolist(), begin):
            if own in seen:
                first[i], seen = True, set()
            seen.add(own)
    event = np.cumsum(first) - 1
    changes = np.zeros((int(event[-1]) + 1, axes), np.int8)
    changes[event, axis] = sign
    last = np.append(np.flatnonzero(first)[1:] - 1, time_s.size - 1)
    return Events(time_s[last], changes)
