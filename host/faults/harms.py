"""What a fault does, as data: an operation on the machine, a fault of the bus, or one of the host."""

from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass, field, replace
from enum import StrEnum
from typing import Any, Final

from steptwin.emulator.faults.bus_faults import BusFault
from steptwin.emulator.faults.operations import (
    AxisOperation,
    Babble,
    BoardTemperature,
    BouncingSwitch,
    BrownOut,
    DriverMode,
    DriverProtect,
    EmergencyStop,
    Operation,
    OscCapacitor,
    Payload,
    PowerUp,
    SetInput,
    SetWire,
    StuckSwitch,
    Supply,
    SwitchWire,
)
from steptwin.emulator.faults.wires import WireState
from steptwin.emulator.world.surroundings import Surroundings
from steptwin.host.common.errors import InputError
from steptwin.host.common.tables import Reading
from steptwin.host.robots.robot import Robot


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


_TIMED: Final = (HostFaultKind.HANG, HostFaultKind.RESTART, HostFaultKind.LATE)
"""Faults of the host that have a time."""


@dataclass(frozen=True, slots=True)
class HostFault:
    """A fault of the host.

    Attributes:
        kind: what goes wrong.
        by_s: duration of a HANG (0: until the fault ends), time until a RESTART, or what each wait of a LATE host takes
            longer.

    Raises:
        ValueError: a time is missing, negative, or means nothing for this kind.
    """

    kind: HostFaultKind
    by_s: float = 0.0

    def __post_init__(self) -> None:
        if self.by_s < 0:
            raise ValueError(f"by_s: {self.by_s:g} s is below 0")
        if self.by_s and self.kind not in _TIMED:
            raise ValueError(f"by_s: is for {', '.join(_TIMED)}, not for {self.kind}")
        if self.kind is HostFaultKind.LATE and not self.by_s:
            raise ValueError(f"by_s: a host that is {self.kind} by 0 s is not: say by how much, such as 0.05")


@dataclass(frozen=True, slots=True)
class BusRepair:
    """All faults of the bus end, and a stranger's babble."""


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
    Babble: lambda harm, _: replace(harm, count=0),
}
"""What ends each type of operation; one without it is done at once."""
_ENDING: Final = (HostFaultKind.HANG, HostFaultKind.LATE, HostFaultKind.DISORDER)
"""Faults of the host that a scenario may end."""


def opposite(operation: Operation, before: Surroundings) -> Operation | None:
    """Return the operation that ends another one, before which the surroundings were so; None: it has no end."""
    make = _OPPOSITES.get(type(operation))
    return None if make is None else make(operation, before)


def why_endless(harm: Harm) -> str | None:
    """Return why nothing ends a harm, in words; None if a fault may end it."""
    if isinstance(harm, HostFault):
        if harm.kind in _ENDING and not (harm.kind is HostFaultKind.HANG and harm.by_s):
            return None
        return "the host is gone" if harm.kind is HostFaultKind.DEATH else "by_s says how long it lasts"
    if isinstance(harm, BusFault) or type(harm) in _OPPOSITES:
        return None
    return "the part stays as it is" if isinstance(harm, OscCapacitor) else "it is over at once"


def place_of(operation: Operation) -> tuple[object, ...]:
    """Return what an operation changes: those of one place replace each other, as two voltages of one supply."""
    return (type(operation), *(getattr(operation, name, None) for name in ("axis", "input", "switch", "wire", "frame")))


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


@dataclass(frozen=True, slots=True)
class HarmKind:
    """What a kind of request becomes.

    Attributes:
        make: returns the harm for a robot and the values by their keys, None for one that is missing; raises
            InputError.
        readings: of the values for which it is not enough that they are of their kind.
    """

    make: Callable[..., Harm]
    readings: Mapping[str, Reading] = field(default_factory=dict)


Writer = Callable[[Robot, Any], dict[str, Any]]
"""Returns the keys of the request that asks for a harm, `do` among them; those that are None are left out."""


def place(robot: Robot, joint: str | None) -> int | None:
    """Return the axis of a joint that need not be named."""
    return None if joint is None else robot.index_of(joint)


def joint_at(robot: Robot, axis: int | None) -> str | None:
    """Return the joint of an axis; None for None."""
    return None if axis is None else robot.joint_names[axis]


def by_fields(harm: Any) -> dict[str, Any]:
    """Return the name and the fields of a harm for which nobody can ask."""
    return {"do": type(harm).__name__, **asdict(harm)}
