"""What a fault does, as data: an operation on the machine, a fault of the bus, or one of the host."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from enum import StrEnum
from typing import Any, Final

from steptwin.emulator.bus_faults import BusFault
from steptwin.emulator.operations import (
    AxisOperation,
    BoardTemperature,
    BouncingSwitch,
    BrownOut,
    DriverMode,
    DriverProtect,
    EmergencyStop,
    Operation,
    Payload,
    PowerUp,
    SetInput,
    SetWire,
    StuckSwitch,
    Supply,
    SwitchWire,
)
from steptwin.emulator.surroundings import Surroundings
from steptwin.emulator.wires import WireState
from steptwin.host.common.errors import InputError


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


@dataclass(frozen=True, slots=True)
class BusRepair:
    """All faults of the bus end."""


Harm = Operation | BusFault | BusRepair | HostFault


def _as_before(operation: StuckSwitch, before: Surroundings) -> StuckSwitch:
    """Return that a switch sticks as it did, or is free."""
    axis, which = before.axes[operation.axis], operation.switch
    return StuckSwitch(operation.axis, which, bool(axis.levels & which) if axis.stuck & which else None)


_OPPOSITES: Final[Mapping[type, Callable[[Any, Surroundings], Operation]]] = {
    EmergencyStop: lambda _, before: EmergencyStop(before.emergency_stop),
    Supply: lambda _, before: Supply(before.supply_10mv),
    BoardTemperature: lambda _, before: BoardTemperature(before.temperature_decidegc),
    DriverProtect: lambda harm, before: DriverProtect(harm.axis, before.axes[harm.axis].protect_held),
    SetInput: lambda harm, before: SetInput(harm.axis, harm.input, on=bool(before.axes[harm.axis].levels & harm.input)),
    StuckSwitch: _as_before,
    SetWire: lambda harm, _: SetWire(harm.axis, harm.wire, WireState.WHOLE),
    BrownOut: lambda harm, _: PowerUp(harm.axis),
    SwitchWire: lambda harm, _: SwitchWire(harm.axis, harm.switch, None),
    BouncingSwitch: lambda harm, _: BouncingSwitch(harm.axis, harm.switch, 0),
    DriverMode: lambda harm, _: DriverMode(harm.axis, None),
    Payload: lambda _, before: Payload(before.payload_kg),
}
"""What ends each type of operation; one without it is done at once."""
_ENDING: Final = (HostFaultKind.HANG, HostFaultKind.LATE, HostFaultKind.DISORDER)
"""Faults of the host that a scenario may end."""


def opposite(operation: Operation, before: Surroundings) -> Operation | None:
    """Return the operation that ends another one, before which the surroundings were so; None: it has no end."""
    make = _OPPOSITES.get(type(operation))
    return None if make is None else make(operation, before)


def momentary(harm: Harm) -> bool:
    """Return whether a harm is done at once, so that nothing ends it."""
    if isinstance(harm, HostFault):
        return harm.kind not in _ENDING
    return not isinstance(harm, BusFault) and type(harm) not in _OPPOSITES


def check_motors(harm: Harm, *, turning: bool) -> None:
    """Raise InputError for a harm that only motors feel, unless they turn with the boards."""
    if isinstance(harm, Payload) and not turning:
        raise InputError(
            f"payload_kg: {harm.payload_kg:g} kg: only motors that turn with the board feel it:"
            " run --motors=loop, serve --motors, or motors=True in a test"
        )


def on_axis(harm: Harm) -> int | None:
    """Return the number, among all axes of the machine, of the axis that an operation concerns; None: all of them."""
    return harm.axis if isinstance(harm, AxisOperation) else None
