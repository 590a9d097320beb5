"""What a motion controller's configuration says of a machine: each figure with the place where it stands."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Final, NamedTuple

from steptwin.host.robots.joint import Unit


class Figure(NamedTuple):
    """A figure of a configuration.

    Attributes:
        value: the value, in mm or degrees and seconds.
        origin: where it stands, such as `[stepper_x] microsteps`.
        assumed: True if the configuration does not say it and the controller has a default.
    """

    value: float
    origin: str
    assumed: bool = False

    def scaled(self, factor: float) -> "Figure":
        """Return the figure in another unit."""
        return self._replace(value=self.value * factor)


NO_CORNERS: Final = "has no key here: use blend_mm in programs, G64 in G-code"
"""What to do about a controller's speed at corners."""


class Drivers(NamedTuple):
    """The drivers of an axis: the name of their profile, and where the configuration names them."""

    profile: str
    origin: str


@dataclass(frozen=True, slots=True, kw_only=True)
class AxisFound:
    """An axis of a configuration. Positions are in mm or degrees of the axis; None: the file does not say it.

    Attributes:
        name: name of the axis: one letter.
        steps_per_unit: microsteps that move the axis by 1 mm or degree.
        unit: unit of its positions.
        full_steps_per_rev: full steps per turn of the motor.
        microsteps: microsteps per full step.
        lower: least position of the range; likewise `upper`.
        speed_max: highest speed; likewise `acceleration_max`, and `jerk_max`, which most controllers do not have.
        home_direction: -1 or 1, the direction in which the switch lies; 0 without a switch that can be emulated.
        endstop: position of the switch.
        search_speed: speed of the search for the switch; `zero_speed`: across its edge.
        second_motor: what the controller calls a second motor of the axis; empty without one.
        drivers: its drivers.
        current_a: phase current at full torque.
    """

    name: str
    steps_per_unit: Figure
    unit: Unit = Unit.MM
    full_steps_per_rev: Figure | None = None
    microsteps: Figure | None = None
    lower: Figure | None = None
    upper: Figure | None = None
    speed_max: Figure | None = None
    acceleration_max: Figure | None = None
    jerk_max: Figure | None = None
    home_direction: int = 0
    endstop: Figure | None = None
    search_speed: Figure | None = None
    zero_speed: Figure | None = None
    second_motor: str = ""
    drivers: Drivers | None = None
    current_a: Figure | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class Configuration:
    """A machine as its controller's configuration has it.

    Attributes:
        controller: name of the controller, such as `Klipper`.
        axes: its axes, in the order of the robot's joints.
        corexy: True if two motors move X and Y together; None if the file cannot say it.
        pulses_ns: the controller's times by their keys of `[board]`: `steplen_ns` and the like.
        notes: what the user should know, a line each.
        left_out: what was not read because it moves no axis of this machine, or is not understood.
    """

    controller: str
    axes: tuple[AxisFound, ...]
    corexy: bool | None = False
    pulses_ns: Mapping[str, Figure] = field(default_factory=dict)
    notes: tuple[str, ...] = ()
    left_out: tuple[str, ...] = ()
