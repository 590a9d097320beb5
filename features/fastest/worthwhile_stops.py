"""Find the corners of a motion in which a stop takes less time than the rounding.

A corner that is passed in hardly more than the time of averaging makes the motion around it slow. Such corners are
weighed by dynamic programming over windows of the parts between them, which takes time in proportion to their number.
"""

from collections.abc import Callable, Sequence
from contextlib import suppress
from typing import Final, NamedTuple, TypeVar

import numpy as np

from steptwin.features.fastest.drives import DrivesOnPath
from steptwin.features.fastest.executed import LimitedPath, TimedPath, UntimedError, lasting_s
from steptwin.features.fastest.rows import machine_average_s
from steptwin.features.fastest.solve import fastest_squares
from steptwin.host.common.arrays import FloatArray
from steptwin.host.robots.robot import Robot

_Way = TypeVar("_Way")

_WINDOW: Final = 3
"""Most parts between corners that are timed as one."""
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


def fastest_with_stops(
    robot: Robot, corners: Sequence[int], stop_in: StopIn, make: Callable[[Sequence[int]], tuple[_Way, TimedPath]]
) -> tuple[_Way, TimedPath]:
    """Return the fastest way with stops in some doubtful corners, and its motion; it is no slower than with all.

    `make` returns the way that stops in corners, and its motion. Times of windows are only nearly right. So the ways
    with all of the stops and with none are made, too, if they may be faster than that with the worthwhile ones.
    """
    if not corners:
        return make(())
    stops, apart_s = worthwhile(robot, corners, stop_in)
    found = make(stops)
    none = stop_in(())
    for others, lasts_s in ((list(corners), apart_s), ([], float(_lasting_s(robot, none)[0]) if stops else np.inf)):
        if others != stops and lasts_s < found[1].law.duration_s:
            with suppress(UntimedError):
                found = min(found, make(others), key=lambda each: each[1].law.duration_s)
    return found


def worthwhile(robot: Robot, corners: Sequence[int], stop_in: StopIn) -> tuple[list[int], float]:
    """Return those corners in which a stop takes less time than the rounding, and the time with all stops, in s.

    `corners` are numbers of corners, rising. Windows of one part between corners, of two and of three are timed from
    rest to rest, all of a size and an offset together, so the work grows with the number of corners. A part that is
    rounded on to those before it adds the difference of two windows. If no stop between two parts is faster, none is.
    """
    parts = len(corners) + 1
    windows = [np.full(parts, np.inf) for _ in range(_WINDOW)]
    for size, times_s in enumerate(windows, 1):
        if size > 2 and (windows[1][:-1] <= windows[0][:-1] + windows[0][1:]).all():
            return [], float(windows[0].sum())
        for first in range(min(size, parts - size + 1)):
            stops = [corner for i, corner in enumerate(corners, 1) if i % size == first % size]
            each_s = _lasting_s(robot, stop_in(stops))
            whole = np.arange(first, parts - size + 1, size)
            times_s[whole] = each_s[(first > 0) + np.arange(len(whole))]
    return _cheapest(corners, windows), float(windows[0].sum())


def _cheapest(corners: Sequence[int], windows: Sequence[FloatArray]) -> list[int]:
    """Return the stops of least time by dynamic programming; the state is the number of parts since the last stop.

    More parts than a window has but one count as so many.
    """
    costs = np.array([windows[0][0], *[np.inf] * (_WINDOW - 2)])
    choices = list[tuple[int, FloatArray]]()
    for i in range(1, len(corners) + 1):
        rounded = np.full((len(costs), len(costs)), np.inf)  # to the state of a row, from that of a column
        for state in range(min(len(costs), i)):
            wider, narrower = windows[state + 1][i - state - 1], windows[state][i - state - 1]
            if np.isfinite(wider) and np.isfinite(narrower):
                rounded[min(state + 1, len(costs) - 1), state] = costs[state] + wider - narrower
        choices.append((int(costs.argmin()), rounded.argmin(axis=1)))
        stopped = costs.min() + windows[0][i]
        costs = rounded.min(axis=1)
        costs[0] = stopped
    state, stops = int(costs.argmin()), list[int]()
    for corner, (best, before) in zip(reversed(corners), reversed(choices), strict=True):
        if state == 0:
            stops.append(corner)
        state = best if state == 0 else int(before[state])
    return sorted(stops)


def _lasting_s(robot: Robot, way: StoppingPath) -> FloatArray:
    return lasting_s(robot, way.path, way.average_s, way.drives, way.stops)
