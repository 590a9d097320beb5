"""Faults of the machine itself: emergency stop, supply, temperature, sensors, motors, payload, the boards' logic."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Annotated, Any, Final

from steptwin.emulator import operations
from steptwin.emulator.board.environment import PER_DEGC, PER_V
from steptwin.emulator.drivers.excitation import CYCLE_FULL_STEPS
from steptwin.features.faults.fault import JOINT, AxisFault, BoardFault, Key, KeyKind, Keys, MachineFault
from steptwin.features.faults.reaction import (
    GOES_ON,
    HOST_LOST,
    LOST_BOARD_MS,
    TICK_MS,
    UNKNOWABLE,
    Documented,
    MotionEffect,
    Reaction,
    stops,
)
from steptwin.host.common.errors import InputError
from steptwin.protocol.cia402 import DigitalInput, ErrorCode, State

if TYPE_CHECKING:
    from steptwin.emulator.board.board import Board
    from steptwin.emulator.board.environment import BoardEnvironment
    from steptwin.emulator.simulation import Simulation
    from steptwin.features.faults.moment import Moment
    from steptwin.host.client.control_client import ControlState


@dataclass(frozen=True, slots=True)
class EmergencyStop(BoardFault):
    """The emergency stop is pressed, or pulled out.

    All axes of the board see it.
    """

    do = "estop"
    reactions = (
        Documented(
            "emergency stop pressed",
            stops(ErrorCode.ESTOP),
            "stop category 1 of IEC 60204-1",
            lambda fault, _: fault.pressed,
        ),
        Documented("emergency stop pulled out", GOES_ON),
    )

    pressed: bool

    def apply_to(self, board: "Board", _now_counts: int) -> None:
        board.inputs.emergency_stop = self.pressed

    def undo(self, before: "BoardEnvironment") -> "EmergencyStop":
        return EmergencyStop(before.emergency_stop)

    @classmethod
    def shown(cls, state: "ControlState", _values: Mapping[str, Any]) -> str:
        return f"emergency stop: {'pressed' if state.estop else 'released'}"


SUPPLY_RANGE_10MV: Final = range(1000, 3401)
"""Motor supply with drives on: 0x2002:03 and :04 after power-up."""
TEMPERATURE_MAX_DECIDEGC: Final = 850
"""Highest temperature of the board with drives on: 0x2002:05 after power-up."""


@dataclass(frozen=True, slots=True)
class Supply(BoardFault):
    """The motor supply has this voltage.

    It is any that the board can measure, in 10 mV as in its object 0x2002:02.
    """

    do = "supply"
    reactions = (
        Documented(
            "motor supply below 10.00 V",
            stops(ErrorCode.UNDERVOLTAGE, motion=MotionEffect.CUT),
            "without its supply no driver can follow a ramp",
            lambda fault, _: fault.supply_10mv < SUPPLY_RANGE_10MV.start,
        ),
        Documented(
            "motor supply above 34.00 V",
            stops(ErrorCode.OVERVOLTAGE),
            when=lambda fault, _: fault.supply_10mv >= SUPPLY_RANGE_10MV.stop,
        ),
        Documented("motor supply from 10.00 to 34.00 V", GOES_ON),
    )

    supply_10mv: Annotated[int, Key("supply_v", metavar="VOLTS", least=0, most=655.35, unit="V", parts=PER_V)]

    def apply_to(self, board: "Board", now_counts: int) -> None:
        board.measure(replace(board.measurements, supply_10mv=self.supply_10mv), now_counts)

    def undo(self, before: "BoardEnvironment") -> "Supply":
        return Supply(before.supply_10mv)

    @classmethod
    def shown(cls, state: "ControlState", _values: Mapping[str, Any]) -> str:
        return f"supply: {state.supply_v:.2f} V"


@dataclass(frozen=True, slots=True)
class BoardTemperature(BoardFault):
    """The board has this temperature.

    It is any that the board can measure, in 0.1 degC as in its object 0x2002:01.
    """

    do = "temperature"
    reactions = (
        Documented(
            "board above 85.0 degC",
            stops(ErrorCode.TEMPERATURE),
            when=lambda fault, _: fault.temperature_decidegc > TEMPERATURE_MAX_DECIDEGC,
        ),
        Documented("board up to 85.0 degC", GOES_ON),
    )

    temperature_decidegc: Annotated[
        int, Key("temperature_degc", metavar="DEGC", least=-3276.8, most=3276.7, unit="degC", parts=PER_DEGC)
    ]

    def apply_to(self, board: "Board", now_counts: int) -> None:
        board.measure(replace(board.measurements, temperature_decidegc=self.temperature_decidegc), now_counts)

    def undo(self, before: "BoardEnvironment") -> "BoardTemperature":
        return BoardTemperature(before.temperature_decidegc)

    @classmethod
    def shown(cls, state: "ControlState", _values: Mapping[str, Any]) -> str:
        return f"board: {state.temperature_degc:.1f} degC"


_INPUT: Final = Key("input", KeyKind.INPUT)


@dataclass(frozen=True, slots=True)
class SetInput(AxisFault, operations.InputOperation):
    """A sensor of the robot's file is active, or not.

    It is at one of an axis' general inputs (`GENERAL_INPUTS`); closed is active.
    """

    do = "input"
    place_fields = ("axis", "input")
    reactions = (Documented("sensor on or off", GOES_ON, "programs wait for it"),)

    axis: Annotated[int, Keys((_INPUT,), join=lambda wired: wired[0])]
    input: Annotated[DigitalInput, Keys((_INPUT,), join=lambda wired: wired[1])]
    on: bool

    def __post_init__(self) -> None:
        operations.InputOperation.__post_init__(self)

    def undo(self, before: "BoardEnvironment") -> "SetInput":
        return SetInput(self.axis, self.input, on=bool(before.axes[self.axis].levels & self.input))

    @classmethod
    def shown(cls, state: "ControlState", values: Mapping[str, Any]) -> str:
        return f"input {values['input']}: {'on' if state.inputs[values['input']] else 'off'}"


FULL_STEPS_MAX: Final = 100_000
"""Greatest number of full steps by which a motor slips."""


@dataclass(frozen=True, slots=True)
class Slip(AxisFault):
    """A motor falls out of step by whole electrical cycles: a multiple of 4 full steps.

    Its rotor jumps by steps that no driver has made, as an overload makes it, and locks again where the field has the
    same angle.

    Attributes:
        full_steps: positive towards higher positions.
    """

    do = "slip"
    reactions = (
        Documented(
            "a motor falls out of step",
            UNKNOWABLE,
            "a board without encoders cannot know; the verdict tells it, and homing ends it; a limit switch may come",
        ),
    )

    full_steps: Annotated[int, Key(metavar="FULL_STEPS", most=FULL_STEPS_MAX)]

    def __post_init__(self) -> None:
        if not self.full_steps or self.full_steps % CYCLE_FULL_STEPS:
            near = CYCLE_FULL_STEPS * max(1, round(abs(self.full_steps) / CYCLE_FULL_STEPS))
            raise ValueError(
                f"full_steps: {self.full_steps} is not a multiple of {CYCLE_FULL_STEPS}: a motor slips by whole"
                f" electrical cycles; the nearest is {near if self.full_steps >= 0 else -near}"
            )

    def apply_to(self, board: "Board", _now_counts: int) -> None:
        board.slip(self.axis, self.full_steps)


PAYLOAD_MAX_KG: Final = 100.0
"""More than any of these arms carries."""


@dataclass(frozen=True, slots=True)
class Payload(MachineFault):
    """The payload has another mass; only with motors that turn with the board (`run --motors=loop`,
    `serve --machine motors`).

    It has it from the next ms on, and hangs at the tool when the one before it would.
    """

    do = "payload"
    once = True
    ends = "another `payload`"
    reactions = (
        Documented(
            "another payload",
            replace(UNKNOWABLE, codes=(ErrorCode.LIMIT_SWITCH, ErrorCode.GROUP_STOPPED)),
            "a board without encoders cannot know whether its motors keep step; the verdict tells a slip; after it a"
            " limit switch may come",
        ),
    )

    payload_kg: Annotated[float, Key(metavar="KG", least=0, most=PAYLOAD_MAX_KG, unit="kg")]

    def check(self, simulation: "Simulation", _number: int) -> None:
        self.check_motors(turning=simulation.rotor_watch is not None)

    def check_motors(self, *, turning: bool) -> None:
        if not turning:
            raise InputError(
                f"payload_kg: {self.payload_kg:g} kg: only motors that turn with the board feel it:"
                " run --motors=loop, serve --machine motors, or MotorOptions in a test"
            )

    def apply(self, simulation: "Simulation", _number: int) -> None:
        """Load the rotors if they turn with the boards; otherwise rotors follow the drivers' steps exactly."""
        if simulation.rotor_watch is not None:
            simulation.rotor_watch.load(self.payload_kg)

    def undo(self, before: "BoardEnvironment") -> "Payload":
        return Payload(before.payload_kg)


# --- logic of boards


def _one_of_several(fault: "BrownOut | WatchdogReset", moment: "Moment") -> bool:
    """Return whether one of several boards is reset."""
    return fault.axis is not None and moment.several_boards


_RESETS: Final = (
    Documented(
        "one of several boards browns out for a time, or its watchdog resets it",
        Reaction(MotionEffect.CUT, (), State.SWITCH_ON_DISABLED, LOST_BOARD_MS, others=HOST_LOST),
        "its own axes stop at once, and are to be homed; the host stops those of the other boards when this board"
        " announces itself again, or after 1 s of silence",
        _one_of_several,
    ),
    Documented(
        "a board's logic browns out for a time, or its watchdog resets it",
        Reaction(MotionEffect.CUT, (), State.SWITCH_ON_DISABLED, TICK_MS),
        "its nodes announce themselves again and know no position; home them",
    ),
)


@dataclass(frozen=True, slots=True)
class BrownOut(MachineFault):
    """The logic of a board, or of all boards, is without supply for a time, or until `power-up`.

    Processor and drivers lose all that is not in flash.

    Attributes:
        for_ms: time until the firmware restarts; None: until `PowerUp`.
        axis: an axis of the board; None: all boards.
    """

    do = "brown-out"
    takes_down = True
    reactions = (
        Documented(
            "one of several boards is without supply from now on",
            Reaction(MotionEffect.CUT, begins_ms=LOST_BOARD_MS, others=HOST_LOST),
            "its nodes are silent; the host stops the axes of the other boards after 1 s",
            lambda fault, moment: _one_of_several(fault, moment) and fault.for_ms is None,
        ),
        Documented(
            "a board's logic is without supply from now on",
            Reaction(MotionEffect.CUT, begins_ms=TICK_MS),
            "its nodes are silent, which the host notices after 1 s, until `power-up`: then as below",
            lambda fault, _: fault.for_ms is None,
        ),
        *_RESETS,
    )

    for_ms: Annotated[int | None, Key(metavar="MS", least=1)] = None
    axis: Annotated[int | None, JOINT] = None

    def apply(self, simulation: "Simulation", number: int) -> None:
        simulation.take_down(number, lambda board, now_counts: board.power_down(now_counts), self.for_ms)

    def undo(self, _before: "BoardEnvironment") -> "PowerUp":
        return PowerUp(self.axis)

    @classmethod
    def ends_by(cls, values: Mapping[str, Any]) -> str | None:
        return None if "for_ms" in values else f"`{PowerUp.do}`"


RESET_MS: Final = 3
"""Usual duration of a reset until the firmware restarts."""


@dataclass(frozen=True, slots=True)
class WatchdogReset(MachineFault):
    """The watchdog resets a board's processor, or that of all boards, while the drivers keep their supply.

    The processor's pins float. STEP, DIR and the chip's inputs, RESET among them, fall by their pull-downs; ENABLE has
    the level of an open terminal.

    Attributes:
        for_ms: time until the firmware restarts: a crystal takes some 2 ms to start (STM32F103, DS5319).
        axis: an axis of the board; None: all boards.
    """

    do = "watchdog"
    takes_down = True
    reactions = _RESETS

    for_ms: Annotated[int, Key(metavar="MS", least=1, written=True)] = RESET_MS
    axis: Annotated[int | None, JOINT] = None

    def apply(self, simulation: "Simulation", number: int) -> None:
        simulation.take_down(number, lambda board, now_counts: board.reset(now_counts), self.for_ms)


@dataclass(frozen=True, slots=True)
class PowerUp(MachineFault, operations.BoardStart):
    """A board that is down starts again.

    Nothing happens to one that runs.

    Attributes:
        axis: an axis of the board; None: all boards.
    """

    do = "power-up"
    reactions = (Documented("a board without power gets it", GOES_ON),)

    axis: Annotated[int | None, JOINT] = None
