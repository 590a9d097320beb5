"""Time a chain of legs as fast as its limits allow; where stopping at a corner is faster than rounding it, it stops.

A path is timed as fast as its drives manage, and their rotors decide. Torques that suffice at a steady speed may not
do: a plan that leaves 30 % of them can make the arm swing on its motors until a rotor slips. So the motion is averaged
over the time that the drives name, and the rotors turn by it. One that slips, or would if it were somewhat faster, is
made gentler and smoother in turn, until they keep step.
"""

from bisect import bisect_right
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Final, NamedTuple

import numpy as np

from steptwin.features.fastest.corners import Flow, MotionLeg, RoundedLegs, flowing
from steptwin.features.fastest.drives import DrivesOnPath, LoadChange, PathLoad
from steptwin.features.fastest.executed import LimitedPath, TimedPath, UntimedError, timed
from steptwin.features.fastest.rows import PathRates, machine_average_s
from steptwin.features.fastest.worthwhile_stops import StoppingPath, doubtful, fastest_with_stops, worthwhile
from steptwin.host.common.errors import InputError
from steptwin.host.common.planning_time import check_planning_time
from steptwin.host.planning.drives import DriveLimits
from steptwin.host.planning.motions.whole import CornerError
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
    smoother, refused = 1.0, ""
    for number, change in enumerate((_Change(), *_CHANGES[:tries]), 1):
        check_planning_time()
        smoother *= change.smoother
        if change.left_percent:
            limits = limits.left_more(change.left_percent)
            drives = drives_along(limits, rates, load)
        own = drives.smoother(smoother)
        found = timed(robot, path, own.average_s, from_ms, own)
        trial = own.tried(found.motion, found.law.at(found.motion.knots_s)[0])
        if not trial.refused:
            return replace(found, drives=replace(trial.answer, tries=number))
        refused = f"{trial.refused} in a motion that leaves {trial.answer.left_percent:.0f} % of the torque"
    changed = f", the last of {tries + 1} that were tried" if tries else ""
    raise WeakDrivesError(
        f"{refused}, averaged over {trial.answer.average_s:.3f} s{changed}: the motors do not keep step"
    )


def drives_along(limits: DriveLimits, rates: PathRates, load: PathLoad) -> DrivesOnPath:
    """Return the drives on a path; raise WeakDrivesError if weights alone need too much."""
    try:
        drives: DrivesOnPath = limits.along(rates, load)
    except InputError as error:
        raise WeakDrivesError(str(error)) from error
    return drives


@dataclass(frozen=True, slots=True, eq=False)
class TimedChain:
    """A part of a chain, from rest to rest. It may stop in some of its corners.

    Attributes:
        first: number of its first leg in the whole chain.
        flow: its path.
        timed: its motion.
    """

    first: int
    flow: Flow
    timed: TimedPath


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
    drives: ChainDrives | None = None,
) -> list[TimedChain]:
    """Return the motion through legs, whose corners are rounded so far, as parts from rest to rest.

    It begins `from_ms` after the whole motion, and stops where that takes less time than the rounded corner. It is one
    part; with drives it is as fast as they manage, averaged over their time, and one part from stop to stop. Raises
    CornerError as `flowing`, and for a part that the drives do not manage, with its first leg.
    """
    return _Chain(robot, RoundedLegs.of(robot, legs, radii_mm), drives).timed(from_ms)


@dataclass(frozen=True, slots=True)
class _Chain:
    """Legs with their limits."""

    robot: Robot
    legs: RoundedLegs
    drives: ChainDrives | None

    def timed(self, from_ms: int) -> list[TimedChain]:
        flow = self.legs.flow()
        at_s, radii_mm = (np.array(each) for each in ([c.s for c in flow.corners], [c.r_mm for c in flow.corners]))
        corners = doubtful(self.robot, flow.path, at_s, radii_mm)
        if self.drives is not None:
            with _at_its_leg(flow, 0):
                stops = worthwhile(self.robot, corners, self._stop_in)[0] if corners else []
            return self._driven(stops, from_ms, self.drives)

        def make(stops: Sequence[int]) -> tuple[Flow, TimedPath]:
            way = self.legs.flow(stops) if stops else flow
            average_s = machine_average_s(self.robot, way.path.rates())
            return way, timed(self.robot, way.path, average_s, from_ms, stops=way.stops)

        with _at_its_leg(flow, 0):
            return [TimedChain(0, *fastest_with_stops(self.robot, corners, self._stop_in, make))]

    def _stop_in(self, stops: Sequence[int]) -> StoppingPath:
        flow = self.legs.flow(stops)
        if self.drives is None:
            return StoppingPath(flow.path, flow.stops, machine_average_s(self.robot, flow.path.rates()))
        drives = self.drives.along(flow, 0)
        on_path = drives_along(drives.limits, flow.path.rates(), drives.load)
        return StoppingPath(flow.path, flow.stops, on_path.average_s, on_path)

    def _driven(self, stops: Sequence[int], from_ms: int, limits: ChainDrives) -> list[TimedChain]:
        """Return the parts from stop to stop, in each of which rotors turn."""
        found = list[TimedChain]()
        for first, end in pairwise([0, *(corner + 1 for corner in stops), len(self.legs.legs)]):
            check_planning_time()
            flow = flowing(self.robot, self.legs.legs[first:end], self.legs.radii_mm[first : end - 1])
            drives = limits.along(flow, first)
            with _at_its_leg(flow, first):
                made = driven(self.robot, flow.path, drives.limits, drives.load, from_ms)
            found.append(TimedChain(first, flow, made))
            from_ms += round(1000 * made.law.duration_s)
        return found


@contextmanager
def _at_its_leg(flow: Flow, first: int) -> Iterator[None]:
    """Let an error of a flow's timing name the leg where it is; the first one has this number."""
    try:
        yield
    except (WeakDrivesError, TooLongError) as error:
        raise CornerError(first, str(error)) from error
    except UntimedError as error:
        starts = [0.0, *(corner.s for corner in flow.corners)]
        leg = bisect_right(starts, error.s) - 1
        raise CornerError(first + leg, f"after {error.s - starts[leg]:.2f} mm {error}") from error
