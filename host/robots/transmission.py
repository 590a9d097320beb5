"""The transmission from motor steps to the travel of an axis: of its joint, unless joints are coupled."""

from dataclasses import dataclass
from functools import partial
from math import floor
from typing import Final

from steptwin.host.common.bad_input import require_positive
from steptwin.host.common.errors import InputError
from steptwin.host.common.findings import check_all
from steptwin.protocol.objects import UNITS_PER_FULL_STEP

MICROSTEPS: Final = (1, 2, 8, 16)
"""Microsteps per full step that a TB6560's pins M1 and M2 can choose."""


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
        if self.microsteps not in MICROSTEPS:
            raise InputError(f"microsteps: {self.microsteps} is not one of the TB6560's {MICROSTEPS}")

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
