"""Time a chain of legs as fast as its limits allow; where stopping at a corner is faster than rounding it, it stops."""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import accumulate, pairwise
from typing import Final

import numpy as np

from steptwin.host.planning.fastest.corners import Corner, Flow, MotionLeg, flowing
from steptwin.host.planning.fastest.executed import TimedPath, timed
from steptwin.host.planning.fastest.solve import fastest_squares
from steptwin.host.robots.robot import Robot

AVERAGE_S: Final = 0.05
"""Usual time over which a motion is averaged: half of what a joint move's S-curve takes to its acceleration."""

_DOUBTFUL: Final = 4.0
"""Times of averaging within which a corner is passed that may better be a stop."""


@dataclass(frozen=True, slots=True, eq=False)
class TimedChain:
    """A part of a chain, from rest to rest.

    Attributes:
        first: number of its first leg in the whole chain.
        legs: number of its legs.
        corners: the corners between them.
        timed: its motion.
    """

    first: int
    legs: int
    corners: tuple[Corner, ...]
    timed: TimedPath

    @property
    def duration_ms(self) -> int:
        """Duration in milliseconds."""
        return round(1000 * self.timed.law.duration_s)


def timed_chains(
    robot: Robot, legs: Sequence[MotionLeg], radii_mm: Sequence[float], from_ms: int = 0, average_s: float = AVERAGE_S
) -> list[TimedChain]:
    """Return the motion through legs, whose corners are rounded so far, as parts from rest to rest.

    It begins `from_ms` after the whole motion.

    It is one part, except where a stop takes less time than the rounded corner. Raises CornerError as `flowing`.
    """

    def timed_part(flow: Flow, first: int, end: int, from_ms: int = 0) -> TimedChain:
        return TimedChain(first, end - first, flow.corners, timed(robot, flow.path, average_s, from_ms))

    def part(first: int, end: int, from_ms: int = 0) -> TimedChain:
        return timed_part(flowing(robot, legs[first:end], radii_mm[first : end - 1]), first, end, from_ms)

    flow = flowing(robot, legs, radii_mm)
    whole, doubtful = timed_part(flow, 0, len(legs), from_ms), _doubtful(flow, average_s)
    found, begins = [whole], [0, *(corner + 1 for corner in doubtful), len(legs)]
    for corner in doubtful:
        last = found.pop()
        halves = [part(last.first, corner + 1), part(corner + 1, len(legs))]
        found += halves if _lasts_ms(halves) < last.duration_ms else [last]
    if doubtful:  # one stop alone may save nothing, and all of them some time
        found = min(found, [part(*ends) for ends in pairwise(begins)], key=_lasts_ms)
    if len(found) == 1:
        return found
    starts_ms = accumulate((each.duration_ms for each in found), initial=from_ms)
    return [part(each.first, each.first + each.legs, at_ms) for each, at_ms in zip(found, starts_ms, strict=False)]


def _lasts_ms(parts: Sequence[TimedChain]) -> int:
    return sum(part.duration_ms for part in parts)


def _doubtful(flow: Flow, average_s: float) -> list[int]:
    """Return the corners that are passed in hardly more than the time of averaging, which makes the motion slower."""
    rates = flow.path.rates()
    squares = fastest_squares(rates.s, flow.path.limits().rows(flow.path.robot, rates))
    speeds = np.sqrt(np.interp([corner.s for corner in flow.corners], rates.s, squares)).tolist()
    return [
        i
        for i, (corner, speed) in enumerate(zip(flow.corners, speeds, strict=True))
        if corner.r_mm and 2.0 * corner.r_mm < _DOUBTFUL * speed * average_s
    ]
