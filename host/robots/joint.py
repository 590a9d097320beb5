"""A joint of a robot, which one axis of the board drives through a transmission."""

from collections.abc import Collection, Mapping
from dataclasses import asdict, astuple, dataclass, field, replace
from enum import StrEnum
from functools import cache, partial
from math import floor
from typing import Annotated, Any, Final

from steptwin.host.common.bad_input import at_least, at_most, prefixed, require_positive
from steptwin.host.common.errors import InputError
from steptwin.host.common.file_limits import NAME_CHARS_MAX
from steptwin.host.common.file_models import FileTable
from steptwin.host.common.file_values import Name, Positive
from steptwin.host.common.findings import check_all
from steptwin.host.robots.motor import JointLink, JointMotor
from steptwin.host.robots.switches import JointHoming, JointSwitches
from steptwin.protocol.drivers import one_of
from steptwin.protocol.od import MICROSTEPS_CHOICES, UNITS_PER_FULL_STEP


@dataclass(frozen=True, slots=True)
class Transmission:
    """The ratio between motor steps and joint travel; raises InputError for a value out of range.

    Attributes:
        full_steps_per_rev: full steps of the motor in one turn; 200 for the usual 1.8 deg.
        microsteps: microsteps per full step, as set at the driver.
        travel_per_turn: joint travel per turn of the driven shaft: 360 degrees, or a screw's lead or a pulley's
            circumference in mm.
        ratio: motor turns per turn of the driven shaft.
    """

    full_steps_per_rev: int
    microsteps: int
    travel_per_turn: float
    ratio: float = 1.0

    def __post_init__(self) -> None:
        check_all(
            self._check_microsteps, partial(require_positive, self, "full_steps_per_rev", "travel_per_turn", "ratio")
        )

    def _check_microsteps(self) -> None:
        try:
            one_of(self.microsteps, MICROSTEPS_CHOICES, "the drivers'")
        except ValueError as error:
            raise InputError(f"microsteps: {error}") from error

    @property
    def travel_per_rev(self) -> float:
        """Joint travel in mm or degrees per motor turn."""
        return self.travel_per_turn / self.ratio

    @property
    def steps_per_unit(self) -> float:
        """Steps per mm or degree, rounded only once: computed from the ratio, since most 360/ratio are inexact."""
        return self.full_steps_per_rev * self.microsteps * self.ratio / self.travel_per_turn

    def to_units(self, position: float) -> int:
        """Return an axis position, in mm or degrees, in wire units, rounded half up as in `Robot.to_units`."""
        return floor(position * self.wire_units_per_unit + 0.5)

    @property
    def wire_units_per_unit(self) -> float:
        """Wire units per mm or degree; exact from `steps_per_unit`, since both factors are powers of two."""
        return self.steps_per_unit / self.microsteps * UNITS_PER_FULL_STEP


WIRE_POSITION_MAX: Final = (1 << 31) - 1
"""Largest position on the wire, where positions are i32 wire units."""


class Unit(StrEnum):
    """The unit of a joint's position; its speeds are in this unit per second."""

    MM = "mm"
    DEG = "deg"


@dataclass(frozen=True, slots=True)
class SecondMotor(FileTable):
    """A second motor of a joint, with an axis of its own and a drive like that of the first.

    Attributes:
        name: name of its axis.
        skew_max: how far the two motors may be apart, in the joint's unit.
        square_offset: how much farther up its switches close than the joint's when the machine is square.
    """

    name: Annotated[str, Name(NAME_CHARS_MAX)]
    skew_max: Positive
    square_offset: float = 0.0


@dataclass(frozen=True, slots=True)
class Joint:
    """A joint: positions in `unit`, speed in unit/s, acceleration in unit/s^2.

    Raises:
        InputError: `lower` is not below `upper`, or the wire's i32 positions do not reach them; a limit switch is
            between them; the switches or the limits do not allow the homing; a limit or a switch is beyond an end stop.
    """

    name: str
    unit: Unit
    lower: float
    upper: float
    speed_max: float
    acceleration_max: float
    transmission: Transmission
    switches: JointSwitches = field(default_factory=JointSwitches)
    homing: JointHoming | None = None
    axis_speed_max: float | None = None
    """Highest speed of the axis if it is coupled to other joints; None: `speed_max`."""
    axis_acceleration_max: float | None = None
    """Highest acceleration of the axis if it is coupled to other joints; None: `acceleration_max`."""
    motor: JointMotor | None = None
    """The motor of the axis, for the model of motors; None: unknown."""
    link: JointLink | None = None
    """The body that the joint moves, for the same model; None: unknown."""
    second_motor: SecondMotor | None = None
    """The second motor of the joint; None: one motor drives it alone."""
    current_a: float | None = None
    """Phase current of the joint's own driver at full torque; None: that of the board's settings."""
    jerk_max: float | None = None
    """Highest jerk of fastest motions, in unit/s^3; None: the file does not limit it."""
    tables: Mapping[str, Any] = field(default_factory=dict, hash=False)
    """Tables of features, by name."""

    def __post_init__(self) -> None:
        check_all(
            self._check_range,
            partial(require_positive, self, "speed_max", "acceleration_max"),
            self._check_optional_limits,
            self._check_wire,
            lambda: self.switches.check_negative(self.lower, self.unit),
            lambda: self.switches.check_positive(self.upper, self.unit),
            self._check_homing,
            self._check_stops,
            self._check_second_motor,
        )

    def _check_range(self) -> None:
        if not self.lower < self.upper:
            raise InputError(f"upper: {self.upper:g} {self.unit} is not above lower, {self.lower:g} {self.unit}")

    def _check_optional_limits(self) -> None:
        keys = ("axis_speed_max", "axis_acceleration_max", "jerk_max")
        check_all(*(partial(require_positive, self, key) for key in keys if getattr(self, key) is not None))

    def _check_wire(self) -> None:
        farthest = max(abs(self.lower), abs(self.upper))
        reach = WIRE_POSITION_MAX / self.transmission.wire_units_per_unit
        if farthest > reach:
            bound = "upper" if farthest == abs(self.upper) else "lower"
            limit = f"the wire's {at_most(reach)} {self.unit}"
            raise InputError(f"{bound}: {farthest:g} {self.unit} from zero is beyond {limit}")

    def _check_homing(self) -> None:
        homing = self.homing
        if homing:
            check_all(
                lambda: self.switches.check_method(homing.method),
                lambda: homing.check_speed(self.speed_max),
                lambda: homing.check_acceleration(self.acceleration_max),
            )

    def _check_stops(self) -> None:
        if self.link:
            switches = {f"switches.{key}": at for key, at in asdict(self.switches).items()}
            with prefixed("link."):
                self.link.check_stops({"lower": self.lower, "upper": self.upper, **switches}, self.unit)

    def _check_second_motor(self) -> None:
        if self.second_motor:
            switches = second_switches(self, self.second_motor)
            with prefixed("second_motor.square_offset: "):
                switches.check_negative(self.lower, self.unit)
                switches.check_positive(self.upper, self.unit)

    @property
    def step_rate_max_hz(self) -> float:
        """The step rate at the axis' highest speed, which is the joint's unless joints are coupled."""
        return (self.axis_speed_max or self.speed_max) * self.transmission.steps_per_unit


def second_switches(joint: Joint, motor: SecondMotor) -> JointSwitches:
    """Return the switches of a joint's second motor: like the joint's, all shifted by its offset."""
    return JointSwitches(*(None if at is None else at + motor.square_offset for at in astuple(joint.switches)))


@cache
def second_axis(joint: Joint, motor: SecondMotor) -> Joint:
    """Return the axis of a joint's second motor, as if it were a joint of its own that carries nothing."""
    return replace(joint, name=motor.name, switches=second_switches(joint, motor), link=None, second_motor=None)


_ROUNDING: Final = 1e-12
"""Part of a ratio that is taken for a rounding error of its computation."""


def with_fewer_steps(joint: Joint, part: float, choices: Collection[int]) -> tuple[Transmission, str]:
    """Return a drive that makes at most this part of the joint's steps, and the robot file's keys and values.

    The drive keeps as many microsteps as it can, of the driver's choices. If the fewest are still too many, it has a
    longer travel per motor turn as well: a longer lead of the screw, or a smaller ratio of the gears.
    """
    old = joint.transmission
    microsteps = max((number for number in choices if number <= part * old.microsteps), default=min(choices))
    drive = replace(old, microsteps=microsteps)
    changed = [f"microsteps = {microsteps}"] if drive != old else []
    part *= (1 + _ROUNDING) * old.microsteps / microsteps
    if part >= 1:
        return drive, changed[0]
    if joint.unit is Unit.MM:
        longer = at_least(old.travel_per_turn / part)
        drive, setting = replace(drive, travel_per_turn=float(longer)), f"travel_per_turn = {longer}"
    else:
        smaller = at_most(old.ratio * part)
        drive, setting = replace(drive, ratio=float(smaller)), f"ratio = {smaller}"
    return drive, " with ".join([*changed, setting])
