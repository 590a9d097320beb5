"""Operations on a machine beside its motion, as data, and the schedule of those at fixed instants."""

from collections import deque
from collections.abc import Iterable
from dataclasses import dataclass
from enum import StrEnum
from typing import Final, NamedTuple

from steptwin.controller.node.pins import MODE_LEVELS
from steptwin.emulator.faults.wires import Condition, Wire
from steptwin.protocol.cia402 import GENERAL_INPUTS, SWITCH_INPUTS, DigitalInput
from steptwin.protocol.frame import Frame

SUPPLIES_10MV: Final = range(1 << 16)
"""Voltages that the board can measure: those of its object 0x2002:02, an unsigned integer of 16 bits."""
TEMPERATURES_DECIDEGC: Final = range(-(1 << 15), 1 << 15)
"""Temperatures that the board can measure: those of its object 0x2002:01, a signed integer of 16 bits."""

CYCLE_FULL_STEPS: Final = 4
"""Full steps in an electrical cycle: after so many the motor's torque at the same field is the same again."""


@dataclass(frozen=True, slots=True)
class EmergencyStop:
    """The emergency stop button is pressed or pulled out; all axes of the board see it."""

    pressed: bool


@dataclass(frozen=True, slots=True)
class DriverProtect:
    """A driver's Protect pin is held low from outside, as a chip in thermal shutdown does itself, or released."""

    axis: int
    active: bool


@dataclass(frozen=True, slots=True)
class Supply:
    """The motor supply gets this voltage, in 10 mV."""

    supply_10mv: int

    def __post_init__(self) -> None:
        _check("supply_10mv", self.supply_10mv, SUPPLIES_10MV)


@dataclass(frozen=True, slots=True)
class BoardTemperature:
    """The board gets this temperature, in 0.1 degC."""

    temperature_decidegc: int

    def __post_init__(self) -> None:
        _check("temperature_decidegc", self.temperature_decidegc, TEMPERATURES_DECIDEGC)


@dataclass(frozen=True, slots=True)
class SetInput:
    """A sensor at one of an axis' general inputs (`GENERAL_INPUTS`) closes or opens; closed is active."""

    axis: int
    input: DigitalInput
    on: bool

    def __post_init__(self) -> None:
        if self.input not in GENERAL_INPUTS:
            raise ValueError(f"a general input is one of {', '.join(map(str, GENERAL_INPUTS))}, not {self.input!r}")


@dataclass(frozen=True, slots=True)
class StuckSwitch:
    """A limit or home switch of an axis sticks closed or open wherever the machine is, or is free again (None).

    Closed is active. An input to which no switch is wired can be held closed as well, as by a chafed cable.
    """

    axis: int
    switch: DigitalInput
    closed: bool | None

    def __post_init__(self) -> None:
        _check_switch(self.switch)


@dataclass(frozen=True, slots=True)
class Slip:
    """A motor falls out of step: its rotor jumps by full steps that no driver has made, as an overload makes it.

    The rotor locks again where the field has the same angle: so it slips by whole electrical cycles of 4 full steps.
    """

    axis: int
    full_steps: int
    """Positive towards higher positions."""

    def __post_init__(self) -> None:
        if not self.full_steps or self.full_steps % CYCLE_FULL_STEPS:
            raise ValueError(
                f"full_steps {self.full_steps} is not a multiple of {CYCLE_FULL_STEPS}, such as {-CYCLE_FULL_STEPS}"
            )


PAYLOAD_MAX_KG: Final = 100.0
"""More than any of these arms carries."""


@dataclass(frozen=True, slots=True)
class Payload:
    """The payload has another mass, from the next ms on: it hangs at the tool when the one before it would.

    Only motors that turn with the boards feel it.
    """

    payload_kg: float

    def __post_init__(self) -> None:
        if not 0.0 <= self.payload_kg <= PAYLOAD_MAX_KG:
            raise ValueError(f"payload_kg {self.payload_kg:g} is not from 0 to {PAYLOAD_MAX_KG:g}")


@dataclass(frozen=True, slots=True)
class SetWire:
    """A wire from the board to an axis' driver breaks, is shorted, becomes noisy, or is whole again."""

    axis: int
    wire: Wire
    condition: Condition


class Contact(StrEnum):
    """What a switch's contact does while nothing presses the switch, which decides what a broken wire looks like."""

    NORMALLY_OPEN = "normally-open"
    """A broken wire looks like a switch that nothing presses: the input is never active."""
    NORMALLY_CLOSED = "normally-closed"
    """A broken wire looks like a pressed switch: the input is active."""


@dataclass(frozen=True, slots=True)
class SwitchWire:
    """The wire of a limit or home switch breaks, or is whole again (None)."""

    axis: int
    switch: DigitalInput
    broken: Contact | None

    def __post_init__(self) -> None:
        _check_switch(self.switch)


BOUNCES_MAX: Final = 1000
WITHIN_US: Final = 5_000
"""Usual time for which a small switch bounces."""


@dataclass(frozen=True, slots=True)
class BouncingSwitch:
    """From now on a limit or home switch bounces each time that it closes or opens.

    Attributes:
        axis: the axis.
        switch: the switch.
        bounces: number of times that it falls back after a change; 0: it does not bounce any more.
        within_us: time within which it does so.
        seed: what the instants are drawn from.
    """

    axis: int
    switch: DigitalInput
    bounces: int
    within_us: int = WITHIN_US
    seed: int = 0

    def __post_init__(self) -> None:
        _check_switch(self.switch)
        if not 0 <= self.bounces <= BOUNCES_MAX:
            raise ValueError(f"bounces {self.bounces} is not from 0 to {BOUNCES_MAX}")
        if self.within_us < max(2 * self.bounces, 1):
            raise ValueError(f"within_us {self.within_us} is too short for {self.bounces} bounces: 2 us for each")


@dataclass(frozen=True, slots=True)
class DriverMode:
    """Somebody sets a driver to another microstep mode: its switches, or the chip's pins M1 and M2.

    Attributes:
        axis: the axis.
        microsteps: microsteps per full step; None: as the board has it, or the switches had it at power-up.
    """

    axis: int
    microsteps: int | None

    def __post_init__(self) -> None:
        if self.microsteps is not None and self.microsteps not in MODE_LEVELS:
            raise ValueError(f"microsteps {self.microsteps} is not one of {', '.join(map(str, MODE_LEVELS))}")


@dataclass(frozen=True, slots=True)
class OscCapacitor:
    """The capacitor at a driver chip's OSC pin has another value, as one that has aged or is the wrong one.

    It sets the chopping rate and the shortest pulse that counts.
    """

    axis: int
    osc_pf: float


@dataclass(frozen=True, slots=True)
class BrownOut:
    """The logic's supply of a board breaks down: processor and drivers lose all that is not in flash.

    Attributes:
        for_ms: time until the firmware runs again, from its beginning; None: until `PowerUp`.
        axis: an axis of the board; None: all boards.
    """

    for_ms: int | None = None
    axis: int | None = None

    def __post_init__(self) -> None:
        _check_time("for_ms", self.for_ms)


RESET_MS: Final = 3
"""Usual duration of a reset, until the firmware runs again."""


@dataclass(frozen=True, slots=True)
class WatchdogReset:
    """The watchdog resets a board's processor, while the drivers keep their supply.

    The processor's pins float: STEP, DIR and the chip's inputs fall by their pull-downs, RESET among them; ENABLE has
    the level of an open terminal.

    Attributes:
        for_ms: time until the firmware runs again, from its beginning: a crystal takes some 2 ms to start (STM32F103,
            DS5319).
        axis: an axis of the board; None: all boards.
    """

    for_ms: int = RESET_MS
    axis: int | None = None

    def __post_init__(self) -> None:
        _check_time("for_ms", self.for_ms)


@dataclass(frozen=True, slots=True)
class PowerUp:
    """A board that is down, by a brown-out or a reset, starts again; nothing happens to one that runs.

    Attributes:
        axis: an axis of the board; None: all boards.
    """

    axis: int | None = None


@dataclass(frozen=True, slots=True)
class BusOff:
    """A CAN controller leaves the bus, as after too many errors, and returns after the recessive bits that it needs.

    Attributes:
        axis: an axis of the board whose controller it is; None: the host's interface.
    """

    axis: int | None


@dataclass(frozen=True, slots=True)
class StrangerSends:
    """A station that is no part of the machine, such as a second master, sends a frame."""

    frame: Frame


BABBLE_PERIODS_US: Final = range(47, 10_000_001)
"""From the duration of the shortest frame at 1 Mbit/s, which fills the bus, to 10 s."""
BABBLE_COUNT_MAX: Final = 1_000_000
"""Most frames of a babble: 47 s of a full bus."""


@dataclass(frozen=True, slots=True)
class Babble:
    """The stranger sends a frame again and again, also before the one before it has found its way.

    Attributes:
        frame: the frame.
        period_us: time from one to the next; it is left out while two wait.
        count: number of times; 0: it does not send this frame any more.
    """

    frame: Frame
    period_us: int
    count: int

    def __post_init__(self) -> None:
        _check("period_us", self.period_us, BABBLE_PERIODS_US)
        _check("count", self.count, range(BABBLE_COUNT_MAX + 1))


AxisOperation = (
    DriverProtect | SetInput | StuckSwitch | SwitchWire | BouncingSwitch | Slip | SetWire | DriverMode | OscCapacitor
)
"""Operations at the connector of one axis."""
BoardOperation = EmergencyStop | Supply | BoardTemperature | AxisOperation
"""Operations on the machine of one board."""
BusOperation = StrangerSends | Babble | BusOff
"""Operations on the bus, whatever the board; but a controller's bus-off may be that of a board."""
PlacedOperation = AxisOperation | BrownOut | WatchdogReset | PowerUp | BusOff
"""Operations that may name an axis, as their place."""
Operation = BoardOperation | BusOperation | BrownOut | WatchdogReset | PowerUp | Payload


def _check(name: str, value: int, valid: range) -> None:
    if value not in valid:
        raise ValueError(f"{name} {value} is not from {valid.start} to {valid.stop - 1}")


def _check_switch(switch: DigitalInput) -> None:
    if switch not in SWITCH_INPUTS:
        raise ValueError(f"a switch is one of {', '.join(map(str, SWITCH_INPUTS))}, not {switch!r}")


def _check_time(name: str, value_ms: int | None) -> None:
    if value_ms is not None and value_ms < 1:
        raise ValueError(f"{name} {value_ms} is not 1 or more")


class Scheduled(NamedTuple):
    """An operation, its instant in counts since boot, and the number of its board."""

    counts: int
    operation: Operation
    board: int = 0


class Consequence(Scheduled):
    """An operation that follows from an earlier one, so that nobody has asked for it."""


class Schedule:
    """Operations in order of time; those of one instant keep the order given."""

    def __init__(self, scheduled: Iterable[Scheduled] = ()) -> None:
        self._waiting: deque[Scheduled] = deque()
        self.next_counts: int | None = None
        """Instant of the next operation; None if there is none."""
        self.add(scheduled)

    def add(self, scheduled: Iterable[Scheduled]) -> None:
        """Add operations; one whose instant has passed is due at once."""
        self._waiting = deque(sorted((*self._waiting, *scheduled), key=lambda item: item.counts))
        self.next_counts = self._waiting[0].counts if self._waiting else None

    def end_babble(self, frame: Frame | None = None) -> None:
        """Forget the next times of babbles that have begun: those of one frame, or all."""

        def ends(item: Scheduled) -> bool:
            babble = item.operation
            return isinstance(item, Consequence) and isinstance(babble, Babble) and frame in (None, babble.frame)

        self._waiting = deque(item for item in self._waiting if not ends(item))
        self.next_counts = self._waiting[0].counts if self._waiting else None

    def take_due(self, now_counts: int) -> list[Scheduled]:
        """Return the operations that are due by now, and remove them."""
        due = []
        while self._waiting and self._waiting[0].counts <= now_counts:
            due.append(self._waiting.popleft())
        self.next_counts = self._waiting[0].counts if self._waiting else None
        return due
