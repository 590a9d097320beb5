"""Find the corners of a motion in which a stop takes less time than the rounding.

A corner that is passed in hardly more than the time of averaging makes the motion around it slow. So such corners are
weighed: the motion from the one before to the one behind, with the corner rounded and with a stop there. All of them
are timed together, every second corner rounded at a time, which takes time in proportion to their number.
"""

from collections.abc import Callable, Sequence
from typing import Final, NamedTuple

import numpy as np

from steptwin.features.fastest.drives import DrivesOnPath
from steptwin.features.fastest.executed import LimitedPath, lasting_s
from steptwin.features.fastest.rows import machine_average_s
from steptwin.features.fastest.solve import fastest_squares
from steptwin.host.common.arrays import FloatArray
from steptwin.host.robots.robot import Robot

_DOUBTFUL: Final = 4.0
"""Times of averaging within which a corner is passed that may better be a stop."""
_AS_FAST: Final = 0.9
"""Part of the speed on a leg from which on a corner is not slow."""
_FEW: Final = 0.01
"""Part of all corners below which their stops save less than it takes to find them."""


class StoppingPath(NamedTuple):
    """A path that stops at some of its parameters, rising; with the drives that limit it, if any do."""

    path: LimitedPath
    stops: FloatArray
    average_s: float
    drives: DrivesOnPath | None = None


StopIn = Callable[[Sequence[int]], StoppingPath]
"""Returns the path that stops in some of the corners, by their numbers, and rounds the others."""


def doubtful(robot: Robot, path: LimitedPath, at_s: FloatArray, radii_mm: FloatArray) -> list[int]:
    """Return the corners that are passed in hardly more than the time of averaging, which makes the motion slower.

    Corners are rounded so far, 0 where two legs flow into each other, and passed at these parameters of the path. One
    that is passed nearly as fast as the legs beside it costs no time, and a few among very many hardly any.
    """
    rates = path.rates()
    squares = fastest_squares(rates.s, path.limits().rows(robot, rates))
    speeds = np.sqrt(np.interp(at_s, rates.s, squares))
    legs = np.sqrt(np.maximum.reduceat(squares, np.append(0, np.searchsorted(rates.s, at_s))))
    slows = speeds < _AS_FAST * np.maximum(legs[:-1], legs[1:])
    found = np.flatnonzero(
        (radii_mm > 0.0) & slows & (2.0 * radii_mm < _DOUBTFUL * speeds * machine_average_s(robot, rates))
    )
    return found.tolist() if len(found) >= _FEW * len(at_s) else []


def worthwhile(robot: Robot, corners: Sequence[int], stop_in: StopIn) -> tuple[list[int], float]:
    """Return those corners in which a stop takes less time than the rounding, and the time with all as stops, in s.

    `corners` are numbers of corners, rising.
    """
    apart_s = _lasting_s(robot, stop_in(corners))
    stops = list[int]()
    for parity in (0, 1):
        rounded, before = corners[parity::2], np.arange(len(corners))[parity::2]
        joined = before - np.arange(len(rounded))  # each of these corners joins two runs to one
        pairs_s = apart_s[before] + apart_s[before + 1]
        enough_s = np.zeros(len(apart_s) - len(rounded))
        enough_s[joined] = pairs_s
        joined_s = _lasting_s(robot, stop_in(corners[1 - parity :: 2]), enough_s)[joined]
        stops += [each for each, is_slower in zip(rounded, joined_s > pairs_s, strict=True) if is_slower]
    return sorted(stops), float(apart_s.sum())


def _lasting_s(robot: Robot, way: StoppingPath, enough_s: FloatArray | None = None) -> FloatArray:
    return lasting_s(robot, way.path, way.average_s, way.drives, way.stops, enough_s)
