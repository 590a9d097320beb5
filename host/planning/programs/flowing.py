"""Steps of a program that flow into each other: they gather as legs until one of them stops, then all are timed."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from math import ceil
from typing import Final

import numpy as np

from steptwin.features.fastest.chain import ChainDrives, TimedChain, timed_chains
from steptwin.features.fastest.corners import JointLeg, MotionLeg, ToolLeg
from steptwin.features.fastest.drives import DriveAnswer, DriveLimits, LoadChange
from steptwin.features.fastest.pieces import FollowedPath
from steptwin.host.common.arrays import FloatArray
from steptwin.host.common.errors import InputError
from steptwin.host.planning.motions.composer import Composer
from steptwin.host.planning.motions.held import TimeSpan
from steptwin.host.planning.paths import ToolPath
from steptwin.host.planning.programs.paces import OnTheWay, StepPace, ToolPace
from steptwin.host.planning.trajectory import Switching, Trajectory
from steptwin.host.robots.robot import Robot

_WHOLE_MS: Final = 1e-6
"""Part of a millisecond by which a time may be after a whole one and still count as it."""


BranchesOnWay = tuple[str, tuple[tuple[float, str], ...]]
"""The branch on which the arm begins a path, and the times from which on it is on another one, and its name."""


@dataclass(frozen=True, slots=True)
class LegTime:
    """When a step that flowed was made.

    Attributes:
        from_s: time of the sequence when it begins, where the corner before it is passed.
        until_s: time when it ends.
        motion: its part of the motion.
        branches: branches on which the arm is; none for a step that leads no tool along a path.
        passes_mm: distance at which the corner at its end is passed; None at the end of the motion.
        stops: True if it stops at its end although it need not, since that is faster.
        switched: outputs that change on its way.
        drives: what the motors say of the whole motion that ends with it; None elsewhere.
    """

    from_s: float
    until_s: float
    motion: Trajectory
    branches: BranchesOnWay = ("", ())
    passes_mm: float | None = None
    stops: bool = False
    switched: tuple[Switching, ...] = ()
    drives: DriveAnswer | None = None

    @property
    def notes(self) -> tuple[str, ...]:
        """What becomes of the corner at the step's end, and which outputs change, in words."""
        notes = [switching_words(change) for change in self.switched]
        if self.stops:
            notes.append("stops at its end, which is faster than rounding the corner")
        elif self.passes_mm is not None:
            notes.append(f"passes the corner at {self.passes_mm:.3f} mm")
        return tuple(notes)


def switching_words(change: Switching) -> str:
    """Return a change of an output in words."""
    return f"{change.output} {'on' if change.on else 'off'} at {change.from_s:.3f} s"


@dataclass(slots=True)
class FlowingLegs:
    """The legs that have gathered; they begin at `start`, shape (joints,), where the composer stood."""

    robot: Robot
    start: FloatArray
    drives: DriveLimits | None = None
    legs: list[MotionLeg] = field(default_factory=list, init=False)
    radii_mm: list[float] = field(default_factory=list, init=False)
    outputs: list[tuple[OnTheWay, ...]] = field(default_factory=list, init=False)

    def __bool__(self) -> bool:
        return bool(self.legs)

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
            own = TimeSpan(motion, from_s, until_s)
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


LATE_S: Final = 0.01
"""Time by which an output must have changed after it may: a record's begin is seen a few milliseconds later."""


def switch_on_way(
    composer: Composer, outputs: Sequence[OnTheWay], times_s: Sequence[float], begins_s: float
) -> tuple[Switching, ...]:
    """Let outputs change on a motion that begins at a time of the composer's sequence; return the changes.

    `times_s` says when the motion is at the place of each, from its begin on. Raises InputError for a change that would
    come before the motion.
    """
    changes = []
    for each, there_s in zip(outputs, times_s, strict=True):
        own_s = there_s - each.ahead_s
        if own_s < 0:
            raise InputError(
                f"outputs.{each.output}: ahead_s: {each.ahead_s:g} s is {-own_s:.3f} s before the motion begins"
            )
        from_s = ceil(1000 * (begins_s + own_s) - _WHOLE_MS) / 1000
        changes.append(Switching(each.output, each.on, from_s, from_s + LATE_S, on_the_way=True))
    composer.add_switchings(changes)
    return tuple(changes)


def check_none_gathered(legs: FlowingLegs, what: str) -> None:
    """Raise InputError if a step flows on into something that begins at rest."""
    if legs.is_open:
        raise InputError(f"{what} begins at rest, but the step before flows on: leave its blend_mm out")
