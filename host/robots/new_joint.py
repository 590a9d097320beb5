"""A joint of a new robot's file: what its user says of it, and the speed that follows from this and the drivers."""

from dataclasses import dataclass, replace
from math import floor, inf, log10
from typing import Any, Final, Self

from steptwin.host.common.bad_input import prefixed, unknown
from steptwin.host.common.errors import InputError
from steptwin.host.common.numbers import finite_number
from steptwin.host.robots.board_settings import BoardSettings, pulses_for
from steptwin.host.robots.joint import Transmission, Unit
from steptwin.host.robots.new_motors import MASS, MOTOR, mass_kg, motor_model
from steptwin.protocol.drivers import GENERIC, PROFILES

BOARD: Final = BoardSettings(
    osc_pf=330,
    steplen_ns=33_000,
    stepspace_ns=33_666,
    dirsetup_ns=15_000,
    dirhold_ns=15_000,
    step_rate_max_hz=15_000,
)
"""Drivers as the robots that StepTwin brings have them."""
USUAL_DRIVERS: Final = BOARD.profile.name
DRIVERS: Final = tuple(PROFILES)
"""Drivers that a new file may have; those of a manual need their times in the file."""


def board_with(drivers: str) -> BoardSettings:
    """Return a board with drivers of a name, with their times; raise InputError, with the choices, for unknown ones."""
    if drivers == USUAL_DRIVERS:
        return BOARD
    if drivers == GENERIC:
        raise InputError(
            f"{drivers!r} needs its manual's times in the file (docs/driver.md): begin with {', '.join(DRIVERS)}"
        )
    if drivers not in PROFILES:
        raise unknown("driver", drivers, DRIVERS)
    return board_of(drivers)


def board_of(drivers: str) -> BoardSettings:
    """Return a board with the drivers of a profile, with the pulses that they need."""
    times: dict[str, Any] = {**pulses_for(PROFILES[drivers])}
    return BoardSettings(osc_pf=None, driver_profile=drivers, **times)


FULL_STEPS_PER_REV: Final = 200
_RATE_PART: Final = 0.8
"""Part of the driver's highest step rate that a joint's highest speed takes."""
_MOTOR_SPEED_MAX_REV_S: Final = 8.0
"""Motor speed above which a stepper of this size has little torque left."""
_ROTARY_SPEED_MAX_DEG_S: Final = 180.0
"""A moderate speed for a joint that carries an arm."""
_RISE_S: Final = 0.2
"""Time from rest to the highest speed."""
_BEYOND: Final = 5.0
"""Distance in mm or degrees from the end of the range to the limit switch."""
_SEARCH_PART: Final = 0.25
_ZERO_PART: Final = 0.1
"""Speed of the search for the limit switch, and the slow speed across its edge as a part of that."""
_HOMING_METHOD: Final = 17


@dataclass(frozen=True, slots=True)
class NewJoint:
    """A joint of a new robot: what the file asks its user; the rest of the joint follows from it.

    Attributes:
        name: name, which the kind gives.
        unit: unit of its positions.
        what: what it is, in a few words.
        lower: least position; likewise upper.
        turn: a screw's lead or a pulley's circumference in mm, or the ratio of a rotary joint's transmission.
        microsteps: microsteps per full step.
        home: position after homing, or the nearest one in the range.
        speed_most: highest speed that the joint may have, where something else than motor and driver limits it.
        motor: its motor, a model of `MOTORS`; None: not said.
        mass_kg: mass that it moves, without what the next joints move; None: not said.
        board: the drivers; one that has not the microsteps gets the next lower ones.
    """

    name: str
    unit: Unit
    what: str
    lower: float
    upper: float
    turn: float
    microsteps: int
    home: float = 0.0
    speed_most: float = inf
    motor: str | None = None
    mass_kg: float | None = None
    board: BoardSettings = BOARD

    def on(self, board: BoardSettings) -> Self:
        """Return the joint with a driver of a board, whose microsteps are at most these, or else its least."""
        made = board.profile.chip.microsteps
        return replace(
            self, board=board, microsteps=max((each for each in made if each <= self.microsteps), default=made[0])
        )

    @property
    def turn_key(self) -> str:
        """The key of `turn` in the file."""
        return "travel_per_turn" if self.unit is Unit.MM else "ratio"

    @property
    def questions(self) -> dict[str, tuple[str, float]]:
        """Questions of the file to its user: the meaning and the present value, by key."""
        turn = "lead of the screw or circumference of the pulley" if self.unit is Unit.MM else "motor turns per turn"
        return {
            "lower": (f"least position in {self.unit}", self.lower),
            "upper": (f"greatest position in {self.unit}", self.upper),
            self.turn_key: (turn, self.turn),
            "microsteps": (f"microsteps, {self.microsteps_made}", float(self.microsteps)),
        }

    @property
    def microsteps_made(self) -> str:
        """Those that the driver makes, in words."""
        *others, last = self.board.profile.chip.microsteps
        return f"{', '.join(map(str, others))} or {last}"

    @property
    def settings(self) -> dict[str, str]:
        """The values that may be set, by their key in the file: their names here."""
        keys = ("lower", "upper", self.turn_key, "microsteps", "home", MOTOR, MASS)
        return {key: "turn" if key == self.turn_key else key for key in keys}

    @property
    def transmission(self) -> Transmission:
        """The transmission; InputError if a value is out of range."""
        try:
            self.board.profile.mode(self.microsteps)
        except ValueError as error:
            raise InputError(f"microsteps: {error}") from error
        if self.unit is Unit.MM:
            return Transmission(FULL_STEPS_PER_REV, self.microsteps, self.turn)
        return Transmission(FULL_STEPS_PER_REV, self.microsteps, 360.0, self.turn)

    @property
    def speed_max(self) -> float:
        """A highest speed that driver and motor can follow, in two digits."""
        transmission = self.transmission
        by_rate = _RATE_PART * self.board.driver_rate_max_hz / transmission.steps_per_unit
        by_motor = _MOTOR_SPEED_MAX_REV_S * transmission.travel_per_rev
        moderate = _ROTARY_SPEED_MAX_DEG_S if self.unit is Unit.DEG else by_motor
        return _two_digits(min(by_rate, by_motor, moderate, self.speed_most))

    @property
    def acceleration_max(self) -> float:
        """The acceleration that reaches the highest speed in a moderate time."""
        return _two_digits(self.speed_max / _RISE_S)

    @property
    def switches(self) -> dict[str, float]:
        """Where the limit switches close, by their keys."""
        return {"negative_limit": self.lower - _BEYOND, "positive_limit": self.upper + _BEYOND}

    @property
    def homing(self) -> dict[str, float]:
        """How the joint is homed, by the keys of the file."""
        search = _two_digits(_SEARCH_PART * self.speed_max)
        return {
            "method": _HOMING_METHOD,
            "search_speed": search,
            "zero_speed": _two_digits(_ZERO_PART * search),
            "acceleration": self.acceleration_max,
        }


def read_joint(joint: NewJoint, key: str, text: str) -> NewJoint:
    """Return a joint with one of its values changed."""
    if key not in joint.settings:
        raise unknown(f"{joint.name}: key", key, joint.settings)
    with prefixed(f"{joint.name}.{key}: "):
        if key == MOTOR:
            return replace(joint, motor=motor_model(text))
        if key == MASS:
            return replace(joint, mass_kg=mass_kg(text))
        value = finite_number(text.removeprefix("1/") if key == "microsteps" else text)
    changes: dict[str, Any] = {
        joint.settings[key]: int(value) if key == "microsteps" and value == int(value) else value
    }
    changed = replace(joint, **changes)
    with prefixed(f"{joint.name}."):
        _ = changed.transmission
    return changed


def _two_digits(value: float) -> float:
    """Return a value above 0 rounded down to two digits."""
    unit = 10.0 ** (floor(log10(value)) - 1)
    return float(f"{floor(value / unit * (1 + 1e-12)) * unit:.3g}")
