"""What the board's analogue inputs say, and what the emulated machine can tell beyond the pins of a real one."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple


@dataclass(slots=True)
class Measurements:
    """The board's own readings, the same for all its axes; nominal until something is measured."""

    supply_10mv: int = 2400
    temperature_decidegc: int = 250


class DriverMonitor(NamedTuple):
    """What has become of an axis' pulses since power-up, object 0x2F00."""

    rotor_steps: int
    """Steps that the driver has counted."""
    lost_steps: int
    """Steps made less steps counted, both signed: how far the rotor is behind."""
    violations: int
    """Pulses that broke a limit of the driver."""


Monitor = Callable[[int], DriverMonitor]
"""Tells of an axis. The emulated board has one; a real board would need an encoder."""


def no_monitor(_axis: int) -> DriverMonitor:
    """Without one, every step is taken for counted."""
    return DriverMonitor(0, 0, 0)
