"""Readings of the board's analogue inputs."""

from dataclasses import dataclass


@dataclass(slots=True)
class BoardReadings:
    """Readings that all axes of the board share; nominal values until the first measurement."""

    supply_10mv: int = 2400
    temperature_decidegc: int = 250
