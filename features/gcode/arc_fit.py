"""Take short lines of G-code in a row for arcs, where all of them are within the distance asked for."""

from collections.abc import Callable, Sequence
from dataclasses import replace
from itertools import pairwise
from typing import Final

import numpy as np

from steptwin.features.gcode.modal import ArcShape, CutMove
from steptwin.host.common.arrays import FloatArray
from steptwin.host.common.planning_time import check_planning_time
from steptwin.host.planning.no_way import NO_WAY

_LINES_MIN, _LINES_MAX = 4, 400
"""Lines that become one arc: three corners are on a circle anyway."""
_CORNER_DEG: Final = 30.0
"""Turn between two lines from which on their corner stays one."""
_SWEEP_MAX_DEG: Final = 300.0
_RADIUS_MAX_MM: Final = 2000.0
_RADIUS_MIN: Final = 4.0
"""Least radius over the distance asked for: a smaller circle could be anywhere."""


def with_arcs(moves: Sequence[CutMove], go_together: Callable[[CutMove, CutMove], bool]) -> list[CutMove]:
    """Return moves with lines of one height in a row taken for arcs.

    `go_together` tells of two moves in a row whether they may become one. From each corner on, the longest arc is taken
    that is longer than a line could be.
    """
    ends = [i for i, (first, second) in enumerate(pairwise(moves), 1) if not _goes_on(first, second, go_together)]
    found = list[CutMove]()
    for begin, end in pairwise([0, *ends, len(moves)]):
        group = moves[begin:end]
        found += _fitted(group) if len(group) >= _LINES_MIN else group
    return found


def _goes_on(first: CutMove, second: CutMove, go_together: Callable[[CutMove, CutMove], bool]) -> bool:
    """Return whether two lines go on at one height, without a corner."""
    if not go_together(first, second) or not first.start[2] == first.goal[2] == second.goal[2]:
        return False
    (x0, y0), (x1, y1), (x2, y2) = first.start[:2], first.goal[:2], second.goal[:2]
    turn = np.arctan2((x1 - x0) * (y2 - y1) - (y1 - y0) * (x2 - x1), (x1 - x0) * (x2 - x1) + (y1 - y0) * (y2 - y1))
    return bool(abs(turn) <= np.deg2rad(_CORNER_DEG))


def _fitted(group: Sequence[CutMove]) -> list[CutMove]:
    """Return lines in a row as arcs and lines."""
    places = np.array([group[0].start[:2], *(move.goal[:2] for move in group)])
    off_mm = group[0].corner.merge_mm
    found, i = list[CutMove](), 0
    while i < len(group):
        check_planning_time()
        ahead = places[i : i + _LINES_MAX + 1]
        straight = i + max(1, _longest(2, ahead, lambda own: _is_line(own, off_mm)))
        curved = i + _longest(_LINES_MIN, ahead, lambda own: _arc(own, off_mm) is not None)
        arc = _arc(places[i : curved + 1], off_mm) if curved > straight else None
        if arc is None:
            found += group[i:straight]
            i = straight
        else:
            found.append(replace(group[i], goal=group[curved - 1].goal, arc=arc))
            i = curved
    return found


def _longest(least: int, places: FloatArray, fits: Callable[[FloatArray], bool]) -> int:
    """Return how many lines through the first places fit, found by doubling and halving; 0 if the least do not."""
    most = len(places) - 1
    if least > most or not fits(places[: least + 1]):
        return 0
    count, step = least, 1
    while count + step <= most and fits(places[: count + step + 1]):
        count, step = count + step, 2 * step
    while step:
        if count + step <= most and fits(places[: count + step + 1]):
            count += step
        step //= 2
    return count


def _is_line(places: FloatArray, off_mm: float) -> bool:
    """Return whether places, of shape (n, 2), are along a line in their order, within a distance."""
    way = places[-1] - places[0]
    length = float(np.hypot(*way))
    if length <= NO_WAY:
        return False
    offsets = places - places[0]
    along, across = offsets @ way / length, offsets @ np.array([-way[1], way[0]]) / length
    return bool((np.diff(along) >= 0.0).all() and (np.abs(across) <= off_mm).all())


def _arc(places: FloatArray, off_mm: float) -> ArcShape | None:
    """Return the arc through the first, middle and last place, if all places and chords are within a distance."""
    centre = _centre(places[0], places[len(places) // 2], places[-1])
    if centre is None:
        return None
    radius = float(np.hypot(*(places[0] - centre)))
    if not _RADIUS_MIN * off_mm <= radius <= _RADIUS_MAX_MM:
        return None
    spokes = np.concatenate([places, (places[1:] + places[:-1]) / 2.0]) - centre
    if (np.abs(np.hypot(*spokes.T) - radius) > off_mm).any():
        return None
    own = spokes[: len(places)]
    steps = np.diff(np.unwrap(np.arctan2(own[:, 1], own[:, 0])))
    sweep = float(steps.sum())
    if not ((steps > 0.0).all() or (steps < 0.0).all()) or abs(sweep) > np.deg2rad(_SWEEP_MAX_DEG):
        return None
    last = float(np.hypot(*own[-1]))
    return ArcShape(float(centre[0]), float(centre[1]), sweep, (last - radius) / radius)


def _centre(first: FloatArray, middle: FloatArray, last: FloatArray) -> FloatArray | None:
    """Return the centre of the circle through three places; None if they are on a line."""
    (ax, ay), (bx, by) = middle - first, last - first
    twice = 2.0 * (ax * by - ay * bx)
    if abs(twice) <= NO_WAY**2:
        return None
    a, b = ax * ax + ay * ay, bx * bx + by * by
    return np.asarray(first + np.array([by * a - ay * b, ax * b - bx * a]) / twice)
