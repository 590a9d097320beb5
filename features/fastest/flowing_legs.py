"""Steps of a program that flow into each other: they gather as legs until one of them stops, then all are timed."""

from dataclasses import dataclass, field
from itertools import pairwise
from typing import Final

import numpy as np

from steptwin.features.fastest.again import fastest_again
from steptwin.features.fastest.chain import ChainDrives, TimedChain, timed_chains
from steptwin.features.fastest.corners import JointLeg, MotionLeg, ToolLeg
from steptwin.features.fastest.drives import LoadChange
from steptwin.features.fastest.pieces import FollowedPath
from steptwin.host.common.arrays import FloatArray
from steptwin.host.planning.drives import DriveLimits
from steptwin.host.planning.motion import Motion
from steptwin.host.planning.motions.composer import Composer
from steptwin.host.planning.motions.held import time_span
from steptwin.host.planning.paths import ToolPath
from steptwin.host.planning.programs.flow import LATE_S, BranchesOnWay, LegTime, switch_on_way
from steptwin.host.planning.programs.paces import OnTheWay, StepPace, ToolPace
from steptwin.host.robots.robot import Robot


@dataclass(slots=True)
class FlowingLegs:
    """The legs that have gathered; they begin at `start`, shape (joints,), where the composer stood."""

    robot: Robot
    start: FloatArray
    drives: DriveLimits | None = None
    legs: list[MotionLeg] = field(default_factory=list, init=False)
    radii_mm: list[float] = field(default_factory=list, init=False)
    outputs: list[tuple[OnTheWay, ...]] = field(default_factory=list, init=False)

    def __len__(self) -> int:
        return len(self.legs)

    @property
    def is_open(self) -> bool:
        """True if the last leg flows on."""
        return len(self.radii_mm) == len(self.legs) > 0

    def add_joints(self, here: FloatArray, goal: FloatArray, pace: StepPace) -> FloatArray:
        """Add a move of all joints from here to a position; return where it ends."""
        return self._add(JointLeg(self.robot, here, goal, pace.limits()), goal, pace)

    def add_path(self, here: FloatArray, path: ToolPath, branch: str, pace: ToolPace) -> FloatArray:
        """Add a path of the tool from here on a branch; return the joints at its end."""
        limits = pace.limits()
        followed = FollowedPath.along(self.robot, path, branch, here)
        return self._add(ToolLeg(followed, limits), followed.end, pace)

    def _add(self, leg: MotionLeg, end: FloatArray, pace: StepPace) -> FloatArray:
        self.legs.append(leg)
        self.outputs.append(pace.outputs if isinstance(pace, ToolPace) else ())
        if pace.blend_mm is not None:
            self.radii_mm.append(pace.blend_mm)
        return end

    def make(self, composer: Composer) -> list[LegTime]:
        """Add the motion of all legs to a composer that stands at their start; return the time of each leg.

        A last leg that flows on ends all the same. Raises CornerError for a corner that cannot be rounded.
        """
        times: list[LegTime] = []
        from_ms = round(1000 * composer.now_s)
        radii_mm, drives = self.radii_mm[: len(self.legs) - 1], self._chain_drives(composer)
        parts = timed_chains(self.robot, self.legs, radii_mm, from_ms, drives=drives)
        for part in parts:
            times += self._take(part, composer, stops=part is not parts[-1])
        return times

    def _chain_drives(self, composer: Composer) -> ChainDrives | None:
        """Return the drives of the legs, with the payload that an output takes or leaves on the way."""
        if self.drives is None:
            return None
        held_by = self.robot.dynamics.payload_held_by if self.robot.dynamics else ""
        changes = tuple(
            tuple(_load_change(each, leg) for each in outputs if each.output == held_by)
            for leg, outputs in zip(self.legs, self.outputs, strict=True)
        )
        return ChainDrives(self.drives, not held_by or composer.is_on(held_by), changes)

    def _take(self, part: TimedChain, composer: Composer, *, stops: bool) -> list[LegTime]:
        """Add a part from rest to rest, at whose end it stops or not need be; return the time of each of its legs."""
        begins_s, law, motion, times = composer.now_s, part.timed.law, part.timed.motion, list[LegTime]()
        composer.take(motion)
        flow = part.flow
        passes_s = np.round(law.times_at(np.array([corner.s for corner in flow.corners])), 3).tolist()
        edges_s = [0.0, *passes_s, motion.duration_s]
        for i, (from_s, until_s) in enumerate(pairwise(edges_s)):
            leg, outputs = self.legs[part.first + i], self.outputs[part.first + i]
            there_s = [law.time_at(flow.s_of(i, each.place_mm(leg.length))) for each in outputs]
            changes = switch_on_way(composer, outputs, there_s, begins_s)
            own = time_span(motion, from_s, until_s)
            corner = flow.corners[i] if i < len(flow.corners) else None
            passed = None if corner is None or corner.stops else corner.passes_mm
            at_end = stops if corner is None else corner.stops
            way: BranchesOnWay = ("", ())
            if isinstance(leg, ToolLeg):
                others = ((begins_s + law.time_at(flow.s_of(i, mm)), name) for mm, name in leg.followed.changes)
                way = leg.followed.branch, tuple(others)
            answer = part.timed.drives if corner is None else None
            times.append(LegTime(begins_s + from_s, begins_s + until_s, own, way, passed, at_end, changes, answer))
        return times


_WEIGHED_MM: Final = 10.0
"""Way behind a change of an output on which the payload may hang or not, besides that of the time it may take."""


def _load_change(each: OnTheWay, leg: MotionLeg) -> LoadChange:
    """Return where the payload is taken or left: from the change of its output to a little behind the place."""
    place_mm = each.place_mm(leg.length)
    ahead_mm = each.ahead_s * min(leg.pace.tool_mm_s, leg.length / max(each.ahead_s, LATE_S))
    return LoadChange(place_mm - ahead_mm, place_mm + _WEIGHED_MM, each.on)


class FastestTimer:
    """Times motions as a whole, as fast as the limits allow; implements MotionTimer."""

    def again(self, robot: Robot, motion: Motion, drives: DriveLimits | None = None) -> Motion:
        """Return a motion along a motion's path, in its own time; raise InputError if there is none."""
        return fastest_again(robot, motion, drives)

    def flow(self, robot: Robot, start: FloatArray, drives: DriveLimits | None) -> FlowingLegs:
        """Return a flow without legs that begins at joints of shape (joints,)."""
        return FlowingLegs(robot, start, drives)
