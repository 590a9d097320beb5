"""Harms to the machine itself: emergency stop, supply, temperature, sensors, motors, payload, the boards' logic."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any, ClassVar, Final

from steptwin.emulator import operations
from steptwin.emulator.board.surroundings import PER_DEGC, PER_V
from steptwin.emulator.drivers.excitation import CYCLE_FULL_STEPS
from steptwin.features.faults.kinds.harm import (
    JOINT,
    AxisHarm,
    BoardHarm,
    Harm,
    Key,
    KeyKind,
    MachineHarm,
    keyed,
)
from steptwin.host.common.errors import InputError
from steptwin.protocol.cia402 import DigitalInput

if TYPE_CHECKING:
    from steptwin.emulator.board.board import Board
    from steptwin.emulator.board.surroundings import Surroundings
    from steptwin.emulator.simulation import Simulation

FULL_STEPS_MAX: Final = 100_000
"""Greatest number of full steps by which a motor slips."""
PAYLOAD_MAX_KG: Final = 100.0
"""More than any of these arms carries."""
RESET_MS: Final = 3
"""Usual duration of a reset, until the firmware runs again."""
_OF_BOARD: Final = replace(JOINT, optional=True)
"""Any joint of the board that is meant; none for all boards."""


@dataclass(frozen=True, slots=True)
class EmergencyStop(BoardHarm):
    """The emergency stop button is pressed or pulled out; all axes of the board see it."""

    do: ClassVar[str] = "estop"
    does: ClassVar[str] = "the emergency stop is pressed, or pulled out"

    pressed: bool = field(metadata=keyed(Key("pressed", KeyKind.TRUTH)))

    def apply_to(self, board: "Board", _now_counts: int) -> None:
        """Press the button, or pull it out."""
        board.inputs.emergency_stop = self.pressed

    def undo(self, before: "Surroundings") -> "EmergencyStop":
        """Return the button as it was."""
        return EmergencyStop(before.emergency_stop)


@dataclass(frozen=True, slots=True)
class Supply(BoardHarm):
    """The motor supply gets this voltage, in 10 mV: any that the board can measure, as its object 0x2002:02 has it."""

    do: ClassVar[str] = "supply"
    does: ClassVar[str] = "the motor supply has this voltage"

    supply_10mv: int = field(
        metadata=keyed(Key("supply_v", KeyKind.NUMBER, "VOLTS", least=0, most=655.35, unit="V", parts=PER_V))
    )

    def apply_to(self, board: "Board", now_counts: int) -> None:
        """Let the board measure it."""
        board.measure(replace(board.measurements, supply_10mv=self.supply_10mv), now_counts)

    def undo(self, before: "Surroundings") -> "Supply":
        """Return the voltage as it was."""
        return Supply(before.supply_10mv)


@dataclass(frozen=True, slots=True)
class BoardTemperature(BoardHarm):
    """The board gets this temperature, in 0.1 degC: any that it can measure, as its object 0x2002:01 has it."""

    do: ClassVar[str] = "temperature"
    does: ClassVar[str] = "the board has this temperature"

    temperature_decidegc: int = field(
        metadata=keyed(
            Key("temperature_degc", KeyKind.NUMBER, "DEGC", least=-3276.8, most=3276.7, unit="degC", parts=PER_DEGC)
        )
    )

    def apply_to(self, board: "Board", now_counts: int) -> None:
        """Let the board measure it."""
        board.measure(replace(board.measurements, temperature_decidegc=self.temperature_decidegc), now_counts)

    def undo(self, before: "Surroundings") -> "BoardTemperature":
        """Return the temperature as it was."""
        return BoardTemperature(before.temperature_decidegc)


_INPUT: Final = Key("input", KeyKind.INPUT)


@dataclass(frozen=True, slots=True)
class SetInput(AxisHarm, operations.InputOperation):
    """A sensor at one of an axis' general inputs (`GENERAL_INPUTS`) closes or opens; closed is active."""

    do: ClassVar[str] = "input"
    does: ClassVar[str] = "a sensor of the robot's file is active, or not"

    axis: int = field(metadata=keyed(_INPUT, join=lambda wired: wired[0]))
    input: DigitalInput = field(metadata=keyed(_INPUT, join=lambda wired: wired[1]))
    on: bool = field(metadata=keyed(Key("on", KeyKind.TRUTH)))

    def __post_init__(self) -> None:
        operations.InputOperation.__post_init__(self)

    def undo(self, before: "Surroundings") -> "SetInput":
        """Return the sensor as it was."""
        return SetInput(self.axis, self.input, on=bool(before.axes[self.axis].levels & self.input))


@dataclass(frozen=True, slots=True)
class Slip(AxisHarm):
    """A motor falls out of step: its rotor jumps by full steps that no driver has made, as an overload makes it.

    The rotor locks again where the field has the same angle: so it slips by whole electrical cycles of 4 full steps.
    """

    do: ClassVar[str] = "slip"
    does: ClassVar[str] = "a motor falls out of step by whole electrical cycles: a multiple of 4 full steps"

    full_steps: int = field(metadata=keyed(Key("full_steps", KeyKind.WHOLE, "FULL_STEPS", most=FULL_STEPS_MAX)))
    """Positive towards higher positions."""

    def __post_init__(self) -> None:
        if not self.full_steps or self.full_steps % CYCLE_FULL_STEPS:
            near = CYCLE_FULL_STEPS * max(1, round(abs(self.full_steps) / CYCLE_FULL_STEPS))
            raise ValueError(
                f"full_steps: {self.full_steps} is not a multiple of {CYCLE_FULL_STEPS}: a motor slips by whole"
                f" electrical cycles; the nearest is {near if self.full_steps >= 0 else -near}"
            )

    def apply_to(self, board: "Board", _now_counts: int) -> None:
        """Let the rotor jump at the start of the next tick."""
        board.slip(self.axis, self.full_steps)


@dataclass(frozen=True, slots=True)
class Payload(MachineHarm):
    """The payload has another mass, from the next ms on: it hangs at the tool when the one before it would.

    Only motors that turn with the boards feel it.
    """

    do: ClassVar[str] = "payload"
    does: ClassVar[str] = (
        "the payload has another mass; only with motors that turn with the board (`run --motors=loop`,"
        " `serve --machine motors`)"
    )
    ends: ClassVar[str] = "another `payload`"
    once: ClassVar[bool] = True

    payload_kg: float = field(metadata=keyed(Key("payload_kg", KeyKind.NUMBER, "KG", 0, PAYLOAD_MAX_KG, "kg")))

    def check(self, simulation: "Simulation", _number: int) -> None:
        """Raise InputError unless motors turn with the boards."""
        check_motors(self, turning=simulation.rotor_watch is not None)

    def apply(self, simulation: "Simulation", _number: int) -> None:
        """Load the rotors, if they turn with the boards; else they are where the drivers' steps put them."""
        if simulation.rotor_watch is not None:
            simulation.rotor_watch.load(self.payload_kg)

    def undo(self, before: "Surroundings") -> "Payload":
        """Return the payload as it was."""
        return Payload(before.payload_kg)


def check_motors(harm: Harm, *, turning: bool) -> None:
    """Raise InputError for a harm that only motors feel, unless they turn with the boards."""
    if isinstance(harm, Payload) and not turning:
        raise InputError(
            f"payload_kg: {harm.payload_kg:g} kg: only motors that turn with the board feel it:"
            " run --motors=loop, serve --machine motors, or MotorOptions in a test"
        )


_FOR_MS: Final = Key("for_ms", KeyKind.WHOLE, "MS", least=1, optional=True)


@dataclass(frozen=True, slots=True)
class BrownOut(MachineHarm):
    """The logic's supply of a board breaks down: processor and drivers lose all that is not in flash.

    Attributes:
        for_ms: time until the firmware runs again, from its beginning; None: until `PowerUp`.
        axis: an axis of the board; None: all boards.
    """

    do: ClassVar[str] = "brown-out"
    does: ClassVar[str] = "the logic of a board, or of all boards, is without supply for a time, or until `power-up`"

    for_ms: int | None = field(default=None, metadata=keyed(_FOR_MS))
    axis: int | None = field(default=None, metadata=keyed(_OF_BOARD))

    def apply(self, simulation: "Simulation", number: int) -> None:
        """Switch the supply off, until the time has passed."""
        simulation.take_down(number, lambda board, now_counts: board.power_down(now_counts), self.for_ms)

    def undo(self, _before: "Surroundings") -> "PowerUp":
        """Return the power's return."""
        return PowerUp(self.axis)

    @classmethod
    def ends_by(cls, values: Mapping[str, Any]) -> str | None:
        """Return what ends it."""
        return None if "for_ms" in values else f"`{PowerUp.do}`"


@dataclass(frozen=True, slots=True)
class WatchdogReset(MachineHarm):
    """The watchdog resets a board's processor, while the drivers keep their supply.

    The processor's pins float: STEP, DIR and the chip's inputs fall by their pull-downs, RESET among them; ENABLE has
    the level of an open terminal.

    Attributes:
        for_ms: time until the firmware runs again, from its beginning: a crystal takes some 2 ms to start (STM32F103,
            DS5319).
        axis: an axis of the board; None: all boards.
    """

    do: ClassVar[str] = "watchdog"
    does: ClassVar[str] = (
        "the watchdog resets a board's processor, or that of all boards, while the drivers keep their supply"
    )

    for_ms: int = field(default=RESET_MS, metadata=keyed(replace(_FOR_MS, told=True)))
    axis: int | None = field(default=None, metadata=keyed(_OF_BOARD))

    def apply(self, simulation: "Simulation", number: int) -> None:
        """Hold the processor in reset, until the time has passed."""
        simulation.take_down(number, lambda board, now_counts: board.reset(now_counts), self.for_ms)


@dataclass(frozen=True, slots=True)
class PowerUp(MachineHarm, operations.BoardStart):
    """A board that is down, by a brown-out or a reset, starts again; nothing happens to one that runs.

    Attributes:
        axis: an axis of the board; None: all boards.
    """

    do: ClassVar[str] = "power-up"
    does: ClassVar[str] = "a board that is down starts again"

    axis: int | None = field(default=None, metadata=keyed(_OF_BOARD))


MACHINE: Final = (
    EmergencyStop,
    Supply,
    BoardTemperature,
    SetInput,
    Slip,
    Payload,
    BrownOut,
    WatchdogReset,
    PowerUp,
)
"""The family, in the order of help and docs."""
