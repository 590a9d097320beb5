"""Plan moves of all joints from rest to rest along one quintic, as points for the board's PVT queue."""

from typing import NamedTuple

PERIOD_MS = 20
"""Time from point to point."""


class Point(NamedTuple):
    """Positions of all joints, in mm and degrees, and their velocities, in mm/s and deg/s."""

    t_ms: int
    positions: tuple[float, ...]
    velocities: tuple[float, ...]


def plan_move(start: tuple[float, ...], goal: tuple[float, ...], duration_ms: int) -> list[Point]:
    """Return the points from start to goal: after the part u of the time, 10 u^3 - 15 u^4 + 6 u^5 of the way."""
    return [_point(start, goal, duration_ms, t_ms) for t_ms in range(0, duration_ms + 1, PERIOD_MS)]


def _point(start: tuple[float, ...], goal: tuple[float, ...], duration_ms: int, t_ms: int) -> Point:
    u = t_ms / duration_ms
    part = u**3 * (10 - 15 * u + 6 * u**2)
    part_per_s = 30 * u**2 * (1 - u) ** 2 * 1000 / duration_ms
    ways = [end - begin for begin, end in zip(start, goal, strict=True)]
    return Point(
        t_ms,
        tuple(begin + part * way for begin, way in zip(start, ways, strict=True)),
        tuple(part_per_s * way for way in ways),
    )
