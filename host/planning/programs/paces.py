"""Pace of a program's step, of the joints or the tool: its time law."""

from dataclasses import dataclass
from enum import StrEnum
from typing import Annotated, Any, ClassVar, Final

from steptwin.host.common.arrays import FloatArray
from steptwin.host.common.bad_input import whole_ms
from steptwin.host.common.errors import InputError
from steptwin.host.common.file_models import FileReading, FileTable, documented
from steptwin.host.common.file_values import NotNegative, Positive, ReadBy, Within, check_limits
from steptwin.host.common.findings import judged
from steptwin.host.common.tables import Table
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

    @classmethod
    def read(cls, value: object, _: FileReading) -> "OnTheWay":
        """Return the change that a table such as `{ glue = true, at_mm = 3.0 }` means."""
        table = Table(value, "table")
        names = [key for key in table if key not in ("at_mm", "ahead_s")]
        if len(names) != 1:
            raise InputError(f"names {len(names)} outputs; one change is such as {{ glue = true, at_mm = 3.0 }}")
        ahead_s = table.number("ahead_s") if "ahead_s" in table else 0.0
        return cls(names[0], table.truth(names[0]), table.number("at_mm"), ahead_s)

    @staticmethod
    def schema() -> dict[str, Any]:
        """Return the JSON schema of such a table."""
        _, described = documented(OnTheWay)
        numbers = {key: {"type": "number", "description": described[key]} for key in ("at_mm", "ahead_s")}
        own = {"type": "object", "properties": numbers, "required": ["at_mm"]}
        return {**own, "additionalProperties": {"type": "boolean"}}

    def place_mm(self, length_mm: float) -> float:
        """Return the place from the start of a path of this length; raise InputError for one beyond it."""
        if not abs(self.at_mm) <= length_mm:
            raise InputError(
                f"outputs.{self.output}: at_mm: {self.at_mm:g} mm is beyond the path, which is {length_mm:.6g} mm long"
            )
        return self.at_mm if self.at_mm >= 0 else length_mm + self.at_mm


@dataclass(frozen=True, slots=True, kw_only=True)
class MotionPace(FileTable):
    """What the paces of the joints and of the tool have in common.

    Attributes:
        law: time law; by default that of the program, or s-curve.
        blend_mm: how far the corner at its end is rounded, where the motion flows on into the next step; without it the
            motion stops.
    """

    moves: ClassVar[bool] = True
    law: LawName = LawName.S_CURVE
    blend_mm: NotNegative | None = None

    @classmethod
    def made_of(cls, values: dict[str, Any], reading: FileReading) -> Any:
        """Return the pace, with the law of the whole program if the step names none."""
        if "law" in values and values["law"] is None and "duration_s" not in reading.table:
            values["law"] = LawName(reading.read["law"]) if reading.read.get("law") else None
        law = values.get("law")
        if values.get("blend_mm") is not None and law not in (None, LawName.FASTEST):
            raise InputError(
                f"law: {law.value!r} beside blend_mm; a motion that flows on is timed as a whole, 'fastest'"
            )
        return judged(cls, values, reading.findings)

    @property
    def is_whole(self) -> bool:
        """True if the motion is timed as a whole: by the fastest law, or by blending."""
        return self.law is LawName.FASTEST or self.blend_mm is not None


@dataclass(frozen=True, slots=True, kw_only=True)
class JointPace(MotionPace):
    """The pace of a joint move.

    Attributes:
        speed_percent: part of the joints' limits of speed and acceleration that the move uses.
        duration_s: duration in whole milliseconds, in place of speed_percent.
    """

    speed_percent: Annotated[float, Within(0.0, 100.0, open=True)] = SPEED_PERCENT
    duration_s: float | None = None

    @classmethod
    def made_of(cls, values: dict[str, Any], reading: FileReading) -> Any:
        """Return the pace, as that of any motion; it has a speed or a duration."""
        if values.get("speed_percent") is not None and values.get("duration_s") is not None:
            raise InputError("speed_percent: beside duration_s; a joint move takes one of them")
        return super(JointPace, cls).made_of(values, reading)

    def __post_init__(self) -> None:
        check_limits(self)
        if self.duration_s is not None and whole_ms("duration_s", self.duration_s) < 1:
            raise InputError(f"duration_s: {self.duration_s:g} s is not at least 0.001 s")

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


@dataclass(frozen=True, slots=True, kw_only=True)
class ToolPace(MotionPace):
    """The pace of the tool along a path, jerk-limited: two speeds, of which the slower rules, and the ramp.

    Attributes:
        speed_mm_s: speed along the path.
        ramp_s: time that the tool takes to its speed.
        speed_deg_s: highest speed at which a tool turns that turns in space.
        outputs: outputs that change on the way, such as `{ glue = true, at_mm = 3.0, ahead_s = 0.1 }`.
    """

    speed_mm_s: Positive
    ramp_s: Positive = RAMP_S
    speed_deg_s: Positive = TURN_SPEED_DEG_S
    outputs: tuple[Annotated[OnTheWay, ReadBy(OnTheWay.read, OnTheWay.schema)], ...] = ()

    def __post_init__(self) -> None:
        check_limits(self)
        if self.law not in (LawName.S_CURVE, LawName.FASTEST):
            raise InputError(f"law: {self.law.value!r}: the tool's path has 's-curve' or 'fastest'")

    @property
    def keys(self) -> tuple[str, ...]:
        """Keys that make it slower; the last one only for a tool that turns in space."""
        return ("speed_mm_s", "ramp_s", "speed_deg_s")

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
