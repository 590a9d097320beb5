"""The words for the levels of digital inputs, outputs and buttons."""

from enum import StrEnum
from typing import Final


class MotorsTurn(StrEnum):
    """When the motors of a run turn, if they do."""

    AFTER = "after"
    """After the run, by its record."""
    IN_LOOP = "loop"
    """As it goes, so that the switches follow the rotors."""


LEVELS: Final = {"on": True, "off": False}
"""Levels by their words."""
