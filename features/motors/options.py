"""Options of an emulated machine's motors."""

from dataclasses import dataclass, field
from enum import StrEnum
from typing import Final

from steptwin.host.twin.machine.machine_options import SPELLING, Spelling


class MotorsTurn(StrEnum):
    """When the motors of a run turn."""

    AFTER = "after"
    """After the run, by its record."""
    IN_LOOP = "loop"
    """During the run, so the switches follow the rotors."""


_MOTORS: Final = Spelling(
    key="motors",
    value="",
    example="True",
    says="Let the motors turn with the board, with the arm's masses: switches follow them; no crystal may be off"
    " (docs/motors.md).",
    served=True,
)


@dataclass(frozen=True, slots=True, kw_only=True)
class MotorOptions:
    """Option of an emulated machine: True if its motors turn with its boards."""

    motors: bool = field(default=False, metadata={SPELLING: _MOTORS})

    def over(self, other: "MotorOptions") -> "MotorOptions":
        """Return `other`, with the values of this object that are not defaults in place of its own."""
        return MotorOptions(motors=self.motors or other.motors)
