"""When a run's motors turn: a choice of `steptwin run` and of campaigns."""

from enum import StrEnum


class MotorsTurn(StrEnum):
    """When the motors of a run turn, if they do."""

    AFTER = "after"
    """After the run, by its record."""
    IN_LOOP = "loop"
    """As it goes, so that the switches follow the rotors."""
