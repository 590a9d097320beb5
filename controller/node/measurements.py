"""Readings of the board's analogue inputs, and the step counts that only the emulated board can give."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple


@dataclass(slots=True)
class BoardReadings:
    """Readings that all axes of the board share; nominal values until the first measurement."""

    supply_10mv: int = 2400
    temperature_decidegc: int = 250


class DriverMonitor(NamedTuple):
    """Counts of one axis' driver since power-up and its mode, which the emulator's object (2F00h) shows."""

    rotor_steps: int
    """Number of steps that the driver has counted, signed."""
    lost_steps: int
    """Steps made less steps counted, both signed: how far the rotor has fallen behind."""
    violations: int
    """Number of pulses that broke a limit of the driver."""
    microsteps: int = 0
    """Microsteps per full step, by the chip's pins or the module's switches; 0: unknown."""


class Shaft(NamedTuple):
    """Where one axis' rotor really is, which the emulator's object (2F00h) shows."""

    position_units: int
    """Since power-up, in wire units."""
    slipped_full_steps: int
    """Full steps by which it has fallen out of step since power-up, signed: four for each electrical turn."""


Monitor = Callable[[int], DriverMonitor]
"""Return the counts of an axis. The emulated board provides this; a real board would need an encoder."""


ShaftReader = Callable[[int], Shaft]
"""Return where an axis' rotor is. Only the emulated board provides this."""


def no_monitor(_axis: int) -> DriverMonitor:
    """Return zeros: without a monitor every step is taken as counted."""
    return DriverMonitor(0, 0, 0)


def no_shaft(_axis: int) -> Shaft:
    """Return zeros: nothing is known of the rotor."""
    return Shaft(0, 0)
