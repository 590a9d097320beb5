"""Time a chain of legs as fast as its limits allow; where stopping at a corner is faster than rounding it, it stops.

A path is timed as fast as its drives manage, and their rotors decide. Torques that suffice at a steady speed may not
do: a plan that leaves 30 % of them can make the arm swing on its motors until a rotor slips. So the motion is averaged
over the time that the drives name, and the rotors turn by it. One that slips, or would if it were somewhat faster, is
made gentler and smoother in turn, until they keep step.
"""

from bisect import bisect_right
from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Final, NamedTuple

import numpy as np

from steptwin.host.common.errors import InputError
from steptwin.host.common.planning_time import check_planning_time
from steptwin.host.planning.fastest.corners import CornerError, Flow, MotionLeg, flowing
from steptwin.host.planning.fastest.drives import DriveLimits, DrivesOnPath, LoadChange, PathLoad
from steptwin.host.planning.fastest.executed import LimitedPath, TimedPath, UntimedError, timed
from steptwin.host.planning.fastest.rows import PathRates
from steptwin.host.planning.fastest.solve import fastest_squares
from steptwin.host.planning.peaks import TooLongError
from steptwin.host.robots.robot import Robot


class _Change(NamedTuple):
    """What is changed in a motion that the rotors refuse: its averaging time, by a factor, and the torque left."""

    smoother: float = 1.0
    left_percent: float = 0.0


_CHANGES: Final = (
    *(_Change(left_percent=5.0), _Change(left_percent=5.0), _Change(smoother=1.25)),
    *(_Change(left_percent=5.0), _Change(smoother=1.25), _Change(left_percent=10.0)),
)
"""Changes one after the other: a little more torque that is left costs less time than a longer average."""
TRIES_MAX: Final = len(_CHANGES)


class WeakDrivesError(InputError):
    """The drives do not manage a path at any pace that was tried."""


def driven(
    robot: Robot, path: LimitedPath, limits: DriveLimits, load: PathLoad, from_ms: int = 0, tries: int = TRIES_MAX
) -> TimedPath:
    """Return the fastest motion from rest to rest along a path at which the drives keep step.

    Raises WeakDrivesError if weights alone need too much torque, or if the rotors still refuse the motion after as many
    changes as `tries`; the message says what they did.
    """
    rates = path.rates()
    drives = drives_along(limits, rates, load)
    average_s, refused = drives.average_s, ""
    for number, change in enumerate((_Change(), *_CHANGES[:tries]), 1):
        check_planning_time()
        average_s *= change.smoother
        if change.left_percent:
            limits = limits.left_more(change.left_percent)
            drives = drives_along(limits, rates, load)
        found = timed(robot, path, average_s, from_ms, drives)
        trial = drives.tried(found.motion, found.law.at(found.motion.curve.x)[0], average_s)
        if not trial.refused:
            return replace(found, drives=replace(trial.answer, tries=number))
        refused = f"{trial.refused} in a motion that leaves {trial.answer.left_percent:.0f} % of the torque"
    changed = f", the last of {tries + 1} that were tried" if tries else ""
    raise WeakDrivesError(f"{refused}, averaged over {average_s:.3f} s{changed}: the motors do not keep step")


def drives_along(limits: DriveLimits, rates: PathRates, load: PathLoad) -> DrivesOnPath:
    """Return the drives on a path; raise WeakDrivesError if weights alone need too much."""
    try:
        return limits.along(rates, load)
    except InputError as error:
        raise WeakDrivesError(str(error)) from error


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
        flow: its path.
        timed: its motion.
    """

    first: int
    legs: int
    flow: Flow
    timed: TimedPath

    @property
    def duration_ms(self) -> int:
        """Duration in milliseconds."""
        return round(1000 * self.timed.law.duration_s)


@dataclass(frozen=True, slots=True)
class ChainDrives:
    """The drives of a chain, and when the payload hangs at the tool.

    Attributes:
        limits: the drives.
        held: whether the payload hangs where the chain begins.
        changes: of each leg, by its own parameter; legs behind the last one have none.
    """

    limits: DriveLimits
    held: bool = False
    changes: tuple[tuple[LoadChange, ...], ...] = ()

    def along(self, flow: Flow, first: int) -> "_DrivesOfPart":
        """Return the drives of a part that begins with a leg."""
        before = [change for leg in self.changes[:first] for change in leg]
        moved = (
            LoadChange(flow.s_of(i, change.from_s), flow.s_of(i, change.until_s), change.held)
            for i, changes in enumerate(self.changes[first : first + len(flow.legs)])
            for change in changes
        )
        return _DrivesOfPart(self.limits, PathLoad(before[-1].held if before else self.held, tuple(moved)))


@dataclass(frozen=True, slots=True)
class _DrivesOfPart:
    limits: DriveLimits
    load: PathLoad


def timed_chains(
    robot: Robot,
    legs: Sequence[MotionLeg],
    radii_mm: Sequence[float],
    from_ms: int = 0,
    average_s: float = AVERAGE_S,
    drives: ChainDrives | None = None,
) -> list[TimedChain]:
    """Return the motion through legs, whose corners are rounded so far, as parts from rest to rest.

    It begins `from_ms` after the whole motion. With drives it is as fast as they manage, averaged over their time.

    It is one part, except where a stop takes less time than the rounded corner. Raises CornerError as `flowing`, and
    for a part that the drives do not manage, with its first leg.
    """

    def timed_part(flow: Flow, first: int, end: int, from_ms: int = 0, *, is_sure: bool = False) -> TimedChain:
        try:
            found = _timed(
                robot,
                flow,
                None if drives is None else drives.along(flow, first),
                (average_s, from_ms),
                is_sure=is_sure,
            )
        except (WeakDrivesError, TooLongError) as error:
            raise CornerError(first, str(error)) from error
        except UntimedError as error:
            starts = [0.0, *(corner.s for corner in flow.corners)]
            leg = bisect_right(starts, error.s) - 1
            raise CornerError(first + leg, f"after {error.s - starts[leg]:.2f} mm {error}") from error
        return TimedChain(first, end - first, flow, found)

    def part(first: int, end: int, from_ms: int = 0, *, is_sure: bool = False) -> TimedChain:
        flow = flowing(robot, legs[first:end], radii_mm[first : end - 1])
        return timed_part(flow, first, end, from_ms, is_sure=is_sure)

    flow = flowing(robot, legs, radii_mm)
    whole, doubtful = timed_part(flow, 0, len(legs), from_ms), _doubtful(flow, average_s)
    found, begins = [whole], [0, *(corner + 1 for corner in doubtful), len(legs)]
    for corner in doubtful:
        check_planning_time()
        last = found.pop()
        halves = [part(last.first, corner + 1), part(corner + 1, len(legs))]
        found += halves if _lasts_ms(halves) < last.duration_ms else [last]
    if doubtful:  # one stop alone may save nothing, and all of them some time
        found = min(found, [part(*ends) for ends in pairwise(begins)], key=_lasts_ms)
    if len(found) == 1 and drives is None:
        return found
    sure = list[TimedChain]()
    for each in found:
        sure.append(part(each.first, each.first + each.legs, from_ms + _lasts_ms(sure), is_sure=True))
    return sure


def _timed(
    robot: Robot, flow: Flow, drives: "_DrivesOfPart | None", when: tuple[float, int], *, is_sure: bool
) -> TimedPath:
    """Return the motion of a part; rotors turn by it only if it is sure that it is made."""
    average_s, from_ms = when
    if drives is None:
        return timed(robot, flow.path, average_s, from_ms)
    if is_sure:
        return driven(robot, flow.path, drives.limits, drives.load, from_ms)
    on_path = drives_along(drives.limits, flow.path.rates(), drives.load)
    return timed(robot, flow.path, on_path.average_s, from_ms, on_path)


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
