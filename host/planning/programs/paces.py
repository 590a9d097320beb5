"""Pace of a program's step, of the joints or the tool: its time law."""

from dataclasses import dataclass
from enum import StrEnum
from typing import Final

from steptwin.host.common.arrays import FloatArray
from steptwin.host.common.bad_input import whole_ms
from steptwin.host.common.errors import InputError
from steptwin.host.planning.laws import Cubic, Law, Quintic, SCurve, Trapezoid
from steptwin.host.planning.motions.composer import JERK_TIME_S
from steptwin.host.planning.motions.joint_move import limits_along
from steptwin.host.planning.motions.whole import Pace
from steptwin.host.robots.robot import Robot

SPEED_PERCENT: Final = 80.0
"""Default percentage of the joints' limits of speed and acceleration in a joint move."""

RAMP_S: Final = 0.3
"""Default time for the tool's ramp to its speed."""

TURN_SPEED_DEG_S: Final = 90.0
"""Default highest speed of a tool's rotation in space."""

_WHOLE: Final = "a motion that is timed as a whole has none of a step's own"

_RAMPS_IN_DURATION: Final = 3
"""A trapezoid or S-curve of a given duration accelerates for a third of it, and decelerates for another third."""


class LawName(StrEnum):
    """Kind of a joint move's time law."""

    S_CURVE = "s-curve"
    TRAPEZOID = "trapezoid"
    CUBIC = "cubic"
    QUINTIC = "quintic"
    FASTEST = "fastest"


class ProgramLaw(StrEnum):
    """Default law of a program's steps."""

    S_CURVE = "s-curve"
    FASTEST = "fastest"


def check_blend(blend_mm: float | None) -> None:
    """Raise InputError for a negative rounding."""
    if blend_mm is not None and not blend_mm >= 0:
        raise InputError(f"blend_mm: {blend_mm:g} mm is not at least 0")


@dataclass(frozen=True, slots=True)
class OnTheWay:
    """A change of an output while the tool moves on its path.

    Attributes:
        output: name of the output in the robot file.
        on: its new level.
        at_mm: place on the path: after its start, or if negative before its end.
        ahead_s: lead time of the change, for a slow device.

    Raises:
        InputError: the time is negative.
    """

    output: str
    on: bool
    at_mm: float
    ahead_s: float = 0.0

    def __post_init__(self) -> None:
        if not self.ahead_s >= 0:
            raise InputError(f"ahead_s: {self.ahead_s:g} s is not at least 0")

    def place_mm(self, length_mm: float) -> float:
        """Return the place from the start of a path of this length; raise InputError for one beyond it."""
        if not abs(self.at_mm) <= length_mm:
            raise InputError(
                f"outputs.{self.output}: at_mm: {self.at_mm:g} mm is beyond the path, which is {length_mm:.6g} mm long"
            )
        return self.at_mm if self.at_mm >= 0 else length_mm + self.at_mm


@dataclass(frozen=True, slots=True)
class JointPace:
    """The pace of a joint move.

    Attributes:
        law: kind of the time law.
        speed_percent: percentage of the joints' limits of speed and acceleration to use, above 0 and up to 100.
        duration_s: duration in whole milliseconds, in place of the limits; None without one.
        blend_mm: rounding of the corner at its end, if it is blended with the next step; None: it stops.
    """

    law: LawName = LawName.S_CURVE
    speed_percent: float = SPEED_PERCENT
    duration_s: float | None = None
    blend_mm: float | None = None

    def __post_init__(self) -> None:
        check_blend(self.blend_mm)
        if not 0 < self.speed_percent <= 100:
            raise InputError(f"speed_percent: {self.speed_percent:g} is not above 0 and up to 100")
        if self.duration_s is not None and whole_ms("duration_s", self.duration_s) < 1:
            raise InputError(f"duration_s: {self.duration_s:g} s is not at least 0.001 s")

    @property
    def is_whole(self) -> bool:
        """True if the motion is timed as a whole: by the fastest law, or by blending."""
        return self.law is LawName.FASTEST or self.blend_mm is not None

    def limits(self) -> Pace:
        """Return the limits of a motion that is timed as a whole; raise InputError for keys that it cannot have."""
        if self.duration_s is not None:
            raise InputError(f"duration_s: {_WHOLE}; leave it out, or let the step before stop")
        if self.law not in (LawName.FASTEST, LawName.S_CURVE):
            raise InputError(f"law: {self.law.value!r}: {_WHOLE}, by the law 'fastest'")
        return Pace(self.speed_percent)

    @property
    def keys(self) -> tuple[str, ...]:
        """Keys that make it slower."""
        return ("speed_percent",) if self.duration_s is None else ("duration_s",)

    def along(self, robot: Robot, way: FloatArray) -> Law:
        """Return the law, with a distance of 1, for a travel of shape (joints,), in mm and degrees."""
        if self.duration_s is not None:
            return self._lasting(self.duration_s)
        speed, acceleration = (limit * self.speed_percent / 100 for limit in limits_along(robot, way))
        match self.law:
            case LawName.S_CURVE:
                return SCurve.fastest(1.0, speed, acceleration, acceleration / JERK_TIME_S)
            case LawName.TRAPEZOID:
                return Trapezoid.fastest(1.0, speed, acceleration)
            case LawName.CUBIC:
                return Cubic.fastest(1.0, speed, acceleration)
            case LawName.QUINTIC:
                return Quintic.fastest(1.0, speed, acceleration)
            case LawName.FASTEST:
                raise ValueError("a motion that is timed as a whole has no law of one step")

    def _lasting(self, duration_s: float) -> Law:
        ramp_ms = round(1000 * duration_s) // _RAMPS_IN_DURATION
        match self.law:
            case LawName.S_CURVE:
                return SCurve(1.0, duration_s, ramp_ms / 1000, (ramp_ms // 2) / 1000)
            case LawName.TRAPEZOID:
                return Trapezoid(1.0, duration_s, ramp_ms / 1000)
            case LawName.CUBIC:
                return Cubic(1.0, duration_s)
            case LawName.QUINTIC:
                return Quintic(1.0, duration_s)
            case LawName.FASTEST:
                raise ValueError("the fastest motion has no duration that is given")


@dataclass(frozen=True, slots=True)
class ToolPace:
    """Pace of the tool along a path, jerk-limited: two speed limits and the ramp.

    Attributes:
        speed_mm_s: speed along the path.
        ramp_s: time of the tool's ramp to its speed.
        speed_deg_s: highest rotation speed of a tool that turns in space.
        law: the S-curve with its ramp, or the fastest law within the joints' limits.
        blend_mm: rounding of the corner at its end, if it is blended with the next step; None: it stops.
        outputs: outputs that change on the path.
    """

    speed_mm_s: float
    ramp_s: float = RAMP_S
    speed_deg_s: float = TURN_SPEED_DEG_S
    law: LawName = LawName.S_CURVE
    blend_mm: float | None = None
    outputs: tuple[OnTheWay, ...] = ()

    def __post_init__(self) -> None:
        check_blend(self.blend_mm)
        if self.law not in (LawName.S_CURVE, LawName.FASTEST):
            raise InputError(f"law: {self.law.value!r}: the tool's path has 's-curve' or 'fastest'")
        for name in self.keys:
            if not getattr(self, name) > 0:
                raise InputError(f"{name}: {getattr(self, name):g} is not above 0")

    @property
    def keys(self) -> tuple[str, ...]:
        """Keys that make it slower; the last one only for a tool that turns in space."""
        return ("speed_mm_s", "ramp_s", "speed_deg_s")

    @property
    def is_whole(self) -> bool:
        """True if the motion is timed as a whole: by the fastest law, or by blending."""
        return self.law is LawName.FASTEST or self.blend_mm is not None

    def limits(self) -> Pace:
        """Return the limits of a motion that is timed as a whole; raise InputError for keys that it cannot have."""
        if self.ramp_s != RAMP_S:
            raise InputError(f"ramp_s: {_WHOLE}: it speeds up as fast as the joints' limits allow; leave it out")
        return Pace(100.0, self.speed_mm_s, self.speed_deg_s)

    def along(self, length_mm: float, turn_deg: float = 0.0) -> Law:
        """Return the law for a path's length with a rotation of the tool in space."""
        return SCurve.at_speed(length_mm, self._speed_mm_s(length_mm, turn_deg), self.ramp_s)

    def turning(self, turn_deg: float) -> Law:
        """Return the law for a rotation in space on the spot."""
        return SCurve.at_speed(turn_deg, self.speed_deg_s, self.ramp_s)

    def share(self, length_mm: float, turn_deg: float = 0.0) -> Law:
        """Return the law of `along` scaled to a distance of 1, for a move of the joints."""
        return SCurve.at_speed(1.0, self._speed_mm_s(length_mm, turn_deg) / length_mm, self.ramp_s)

    def _speed_mm_s(self, length_mm: float, turn_deg: float) -> float:
        """Return the speed along a path within both limits."""
        if not turn_deg:
            return self.speed_mm_s
        return min(self.speed_mm_s, self.speed_deg_s * length_mm / turn_deg)


StepPace = JointPace | ToolPace
