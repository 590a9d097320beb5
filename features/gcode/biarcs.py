"""Cubic splines in a plane as arcs and lines that flow into each other."""

from itertools import pairwise
from math import atan2, cos, hypot, inf, pi, sin, sqrt
from typing import Final, NamedTuple

OFF_MM: Final = 0.002
"""How far the arcs may be off the spline."""
_PIECES_MAX: Final = 256
_STRAIGHT: Final = 1e-9
"""Sine of the angle below which a chord is tangential."""


class Flat(NamedTuple):
    """A point or a vector of a plane."""

    x: float
    y: float


class SplineArc(NamedTuple):
    """An arc, or a line without a centre, that leads to a place; its sweep is above 0 counter-clockwise."""

    goal: Flat
    centre: Flat | None = None
    sweep_rad: float = 0.0


def spline_arcs(begin: Flat, first: Flat, last: Flat, end: Flat) -> list[SplineArc]:
    """Return pairs of arcs along the cubic spline of four control points, within OFF_MM of it."""
    points = (begin, first, last, end)
    count = 1
    while True:
        parts = [i / count for i in range(count + 1)]
        found = list[SplineArc]()
        off_mm = 0.0
        for low, high in pairwise(parts):
            made = _pair(_at(points, low), _heading(points, low), _at(points, high), _heading(points, high))
            between = (_at(points, low + (high - low) * k / 8) for k in range(1, 8))
            off_mm = max(off_mm, *(_off(made, _at(points, low), place) for place in between))
            found += made
        if off_mm <= OFF_MM or count >= _PIECES_MAX:
            return found
        count *= 2


def _at(points: tuple[Flat, Flat, Flat, Flat], part: float) -> Flat:
    rest = 1.0 - part
    weights = (rest**3, 3 * rest**2 * part, 3 * rest * part**2, part**3)
    x, y = (sum(w * p[i] for w, p in zip(weights, points, strict=True)) for i in (0, 1))
    return Flat(x, y)


def _heading(points: tuple[Flat, Flat, Flat, Flat], part: float) -> float:
    """Return the angle of the tangent; where the spline stands, that of the chord to a place near."""
    rest = 1.0 - part
    weights = (rest**2, 2 * rest * part, part**2)
    steps = [Flat(b.x - a.x, b.y - a.y) for a, b in pairwise(points)]
    x, y = (sum(w * step[i] for w, step in zip(weights, steps, strict=True)) for i in (0, 1))
    if hypot(x, y) <= 1e-12 * sum(hypot(*step) for step in steps):
        near, far = (part, part + 1e-4) if part < 0.5 else (part - 1e-4, part)
        (x0, y0), (x1, y1) = _at(points, near), _at(points, far)
        x, y = x1 - x0, y1 - y0
    return atan2(y, x)


def _pair(begin: Flat, begin_rad: float, end: Flat, end_rad: float) -> list[SplineArc]:
    """Return two arcs between two places and headings, whose tangents at their ends all have the same length."""
    x, y = end.x - begin.x, end.y - begin.y
    (x0, y0), (x1, y1) = (cos(begin_rad), sin(begin_rad)), (cos(end_rad), sin(end_rad))
    along = x * (x0 + x1) + y * (y0 + y1)
    rest = 4.0 - (x0 + x1) ** 2 - (y0 + y1) ** 2
    below = along + sqrt(along**2 + rest * (x * x + y * y))
    if not below > 0.0:
        return []
    length = (x * x + y * y) / below
    before = Flat(begin.x + length * x0, begin.y + length * y0)
    behind = Flat(end.x - length * x1, end.y - length * y1)
    middle = Flat((before.x + behind.x) / 2.0, (before.y + behind.y) / 2.0)
    return [_arc(begin, begin_rad, middle), _arc(middle, atan2(behind.y - before.y, behind.x - before.x), end)]


def _arc(begin: Flat, heading: float, end: Flat) -> SplineArc:
    """Return the arc that leaves a place with a heading and leads to another."""
    chord = hypot(end.x - begin.x, end.y - begin.y)
    half = _wrapped(atan2(end.y - begin.y, end.x - begin.x) - heading)
    if abs(sin(half)) <= _STRAIGHT:
        return SplineArc(end)
    radius = chord / (2.0 * sin(half))
    return SplineArc(end, Flat(begin.x - radius * sin(heading), begin.y + radius * cos(heading)), 2.0 * half)


def _off(pieces: list[SplineArc], begin: Flat, place: Flat) -> float:
    """Return how far a place is off arcs that begin at another, or off their ends."""
    found = list[float]()
    for piece in pieces:
        if piece.centre is None:
            x, y = piece.goal.x - begin.x, piece.goal.y - begin.y
            along = ((place.x - begin.x) * x + (place.y - begin.y) * y) / (x * x + y * y or 1.0)
            along = min(max(along, 0.0), 1.0)
            found.append(hypot(begin.x + along * x - place.x, begin.y + along * y - place.y))
        else:
            radius = hypot(begin.x - piece.centre.x, begin.y - piece.centre.y)
            found.append(abs(hypot(place.x - piece.centre.x, place.y - piece.centre.y) - radius))
        begin = piece.goal
    return min(found, default=inf)


def _wrapped(angle: float) -> float:
    return (angle + pi) % (2.0 * pi) - pi
