"""What a fault does, as data: an operation on the machine, a fault of the bus, or one of the host."""

from dataclasses import dataclass
from enum import StrEnum

from steptwin.emulator.bus_faults import BusFault
from steptwin.emulator.operations import (
    BoardTemperature,
    DriverProtect,
    EmergencyStop,
    Operation,
    SetInput,
    Slip,
    StuckSwitch,
    Supply,
)
from steptwin.emulator.surroundings import Surroundings


class HostFaultKind(StrEnum):
    """What goes wrong with the host, the program that drives the machine."""

    HANG = "hang"
    """The program stands still; the bus interface goes on with its heartbeat."""
    DEATH = "death"
    """The program and its heartbeat end; no frame comes any more."""
    RESTART = "restart"
    """It dies; after a time another one takes the machine over, resets its faults and enables it again."""
    LATE = "late"
    """Each of its waits lasts longer, as on a computer that is too slow."""
    DISORDER = "disorder"
    """Each second point of an axis is sent after the point that follows it."""


@dataclass(frozen=True, slots=True)
class HostFault:
    """A fault of the host.

    Attributes:
        kind: what goes wrong.
        by_s: duration of a HANG (0: for ever), time until a RESTART, or what each wait of a LATE host takes longer.
    """

    kind: HostFaultKind
    by_s: float = 0.0

    def __post_init__(self) -> None:
        if self.by_s < 0:
            raise ValueError(f"by_s: {self.by_s:g} s is below 0")


Harm = Operation | BusFault | HostFault


def opposite(operation: Operation, before: Surroundings) -> Operation | None:
    """Return the operation that ends another one, before which the surroundings were so; None: it has no end."""
    match operation:
        case EmergencyStop():
            return EmergencyStop(before.emergency_stop)
        case Supply():
            return Supply(before.supply_10mv)
        case BoardTemperature():
            return BoardTemperature(before.temperature_decidegc)
        case DriverProtect(axis):
            return DriverProtect(axis, before.axes[axis].protect_held)
        case SetInput(axis, which):
            return SetInput(axis, which, on=bool(before.axes[axis].levels & which))
        case StuckSwitch(axis, which):
            stuck = before.axes[axis]
            return StuckSwitch(axis, which, bool(stuck.levels & which) if stuck.stuck & which else None)
        case _:
            return None


def momentary(harm: Harm) -> bool:
    """Return whether a harm is done at once, so that it has no end."""
    if isinstance(harm, HostFault):
        return harm.kind in (HostFaultKind.DEATH, HostFaultKind.RESTART)
    return isinstance(harm, _MOMENTARY)


_MOMENTARY = (Slip,)
"""Operations without an opposite."""


def on_axis(harm: Harm) -> int | None:
    """Return the number, among all axes of the machine, of the axis that an operation concerns; None: all of them."""
    axis: int | None = getattr(harm, "axis", None)
    return axis
