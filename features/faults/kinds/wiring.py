"""Faults of the wiring of a board: limit and home switches, drivers and their motors, the wires to the drivers."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from enum import StrEnum
from math import inf
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, Final

from steptwin.emulator.drivers.axis_wires import NOISE_RATE_MAX_HZ, Condition, Noise, Wire, WireState
from steptwin.features.faults.fault import AxisFault, Fault, Key, KeyKind, Keys
from steptwin.features.faults.reaction import GOES_ON, UNKNOWABLE, Documented, MotionEffect, Reaction, stops
from steptwin.host.common.errors import InputError
from steptwin.protocol.cia402 import SWITCH_INPUTS, DigitalInput, ErrorCode
from steptwin.protocol.drivers import ChipSheet, one_of
from steptwin.protocol.od import MICROSTEPS_CHOICES

if TYPE_CHECKING:
    from steptwin.emulator.board.board import Board
    from steptwin.emulator.board.environment import BoardEnvironment
    from steptwin.emulator.simulation import Simulation
    from steptwin.features.faults.engine import Engine
    from steptwin.features.faults.moment import Moment
    from steptwin.host.client.control_client import ControlState, Protect, SwitchState

# --- switches


@dataclass(frozen=True, slots=True)
class SwitchFault(AxisFault):
    """A fault of a limit or home switch."""

    place_fields = ("axis", "switch")

    switch: Annotated[DigitalInput, Key(kind=KeyKind.SWITCH)]

    def __post_init__(self) -> None:
        Fault.__post_init__(self)
        if self.switch not in SWITCH_INPUTS:
            raise ValueError(f"a switch is one of {', '.join(map(str, SWITCH_INPUTS))}, not {self.switch!r}")


def _closed(fault: "StuckSwitch | SwitchWire", _moment: "Moment") -> bool:
    """Return whether a limit switch sticks closed, or seems to by a broken wire."""
    closed = fault.closed if isinstance(fault, StuckSwitch) else fault.broken is Contact.NORMALLY_CLOSED
    return bool(closed) and fault.switch is not DigitalInput.HOME


def _closed_ahead(fault: "StuckSwitch | SwitchWire", moment: "Moment") -> bool:
    """Return whether a limit switch seems closed, and the axis moves towards it."""
    velocity = moment.axes[fault.axis].velocity
    return _closed(fault, moment) and (velocity > 0 if fault.switch is DigitalInput.POSITIVE_LIMIT else velocity < 0)


_ONCE_TOWARDS: Final = stops(ErrorCode.LIMIT_SWITCH, begins_ms=inf, certain=False)


def switch_text(switch: "SwitchState") -> str:
    """Return the state of a switch as text."""
    return f"{'stuck ' if switch.stuck else ''}{'closed' if switch.closed else 'open'}"


@dataclass(frozen=True, slots=True)
class StuckSwitch(SwitchFault):
    """A switch `-`, `+` or `home` sticks `closed` or `open`, or is `free`.

    Closed (True) is active. A stuck switch stays so wherever the machine is; a free one (None) follows it. An input to
    which no switch is wired can be held closed as well, as by a chafed cable.
    """

    do = "switch"
    reactions = (
        Documented(
            "limit switch stuck closed, the axis moves towards it", stops(ErrorCode.LIMIT_SWITCH), when=_closed_ahead
        ),
        Documented(
            "limit switch stuck closed, the axis rests or moves away",
            _ONCE_TOWARDS,
            "once it moves towards the switch",
            _closed,
        ),
        Documented(
            "switch stuck open, or a home switch stuck closed",
            GOES_ON,
            "a planned motion stays between its limit switches; homing fails (EMCY 0xFF05)",
        ),
    )

    closed: Annotated[bool | None, Key("stuck", choices={"closed": True, "open": False, "free": None})]

    def apply_to(self, board: "Board", _now_counts: int) -> None:
        board.inputs.stick(self.axis, self.switch, closed=self.closed)

    def undo(self, before: "BoardEnvironment") -> "StuckSwitch":
        axis = before.axes[self.axis]
        closed = bool(axis.levels & self.switch) if axis.stuck & self.switch else None
        return StuckSwitch(self.axis, self.switch, closed)

    @classmethod
    def shown(cls, state: "ControlState", values: Mapping[str, Any]) -> str:
        joint, switch = values["joint"], values["switch"]
        return f"switch {switch} of {joint}: {switch_text(state.switches[joint][switch])}"


class Contact(StrEnum):
    """State of a switch's contact while the switch is not pressed; determines the effect of a broken wire."""

    NORMALLY_OPEN = "normally-open"
    """A broken wire seems like a released switch: the input is never active."""
    NORMALLY_CLOSED = "normally-closed"
    """A broken wire seems like a pressed switch: the input is active."""


_WHOLE: Final = "whole"


@dataclass(frozen=True, slots=True)
class SwitchWire(SwitchFault):
    """A switch's wire is `whole`, or broken at a contact that is `normally-open` or `normally-closed`."""

    do = "switch-wire"
    ended_by: ClassVar = {"broken": _WHOLE}
    reactions = (
        Documented(
            "wire of a limit switch broken, its contact closed at rest, the axis moves towards it",
            stops(ErrorCode.LIMIT_SWITCH),
            "as a switch that is stuck closed",
            _closed_ahead,
        ),
        Documented(
            "wire of a limit switch broken, its contact closed at rest, the axis rests or moves away",
            _ONCE_TOWARDS,
            "once it moves towards the switch",
            _closed,
        ),
        Documented(
            "wire of a switch broken, its contact open at rest",
            GOES_ON,
            "the board notices it only when it needs the switch: fit contacts that are closed at rest",
        ),
    )

    broken: Annotated[Contact | None, Key(choices={_WHOLE: None, **{each.value: each for each in Contact}})]

    def apply_to(self, board: "Board", _now_counts: int) -> None:
        closed = None if self.broken is None else self.broken is Contact.NORMALLY_CLOSED
        board.inputs.cut(self.axis, self.switch, closed=closed)

    def undo(self, _before: "BoardEnvironment") -> "SwitchWire":
        return SwitchWire(self.axis, self.switch, None)


BOUNCES_MAX: Final = 1000
WITHIN_US: Final = 5_000
"""Usual time for which a small switch bounces."""


@dataclass(frozen=True, slots=True)
class BouncingSwitch(SwitchFault):
    """A switch is worn: it bounces so often with each change, within 5 ms; 0: no more.

    Attributes:
        bounces: number of bounces after a change.
        within_us: duration of the bouncing.
        seed: seed of the instants.
    """

    do = "bounce"
    ended_by: ClassVar = {"bounces": 0}
    reactions = (
        Documented(
            "a switch bounces",
            GOES_ON,
            "a planned motion stays between its limit switches; homing takes the first edge that a tick shows",
        ),
    )

    bounces: Annotated[int, Key(metavar="BOUNCES", least=0, most=BOUNCES_MAX)]
    within_us: Annotated[int, Key(metavar="US", least=1, written=True)] = WITHIN_US
    seed: Annotated[int, Key(metavar="SEED", least=0)] = 0

    def __post_init__(self) -> None:
        SwitchFault.__post_init__(self)
        if self.within_us < 2 * self.bounces:
            raise ValueError(f"within_us {self.within_us} is too short for {self.bounces} bounces: 2 us for each")

    def apply_to(self, board: "Board", _now_counts: int) -> None:
        board.inputs.let_bounce(self.axis, self.switch, self.bounces, self.within_us, self.seed)

    def undo(self, _before: "BoardEnvironment") -> "BouncingSwitch":
        return BouncingSwitch(self.axis, self.switch, 0)


# --- drivers and motors


def _chip(simulation: "Simulation", number: int, axis: int) -> ChipSheet:
    return simulation.boards[number].drivers.drivers[axis].module.chip


def protect_text(pin: "Protect") -> str:
    """Return the state of a driver's Protect pin as text."""
    if pin.held:
        return "held low"
    return "low: the driver has switched itself off" if pin.low else "free"


@dataclass(frozen=True, slots=True)
class DriverProtect(AxisFault):
    """The Protect pin of a driver is held low, as by a chip that is too hot, or released."""

    do = "protect"
    reactions = (
        Documented(
            "Protect of a driver low",
            stops(ErrorCode.TEMPERATURE, motion=MotionEffect.CUT),
            "this driver has switched itself off; the other axes stop by a ramp",
            lambda fault, _: fault.active,
        ),
        Documented("Protect of a driver free", GOES_ON),
    )

    active: Annotated[bool, Key("held")]

    def check(self, simulation: "Simulation", number: int) -> None:
        chip = _chip(simulation, number, self.axis)
        if chip.fault_output is None:
            raise InputError(f"{chip.name} has no pin that tells of a fault; a TB6560, a DRV8825 and Trinamic's have")

    def apply_to(self, board: "Board", _now_counts: int) -> None:
        board.hold_protect(self.axis, held=self.active)

    def undo(self, before: "BoardEnvironment") -> "DriverProtect":
        return DriverProtect(self.axis, before.axes[self.axis].protect_held)

    @classmethod
    def shown(cls, state: "ControlState", values: Mapping[str, Any]) -> str:
        return f"Protect of {values['joint']}: {protect_text(state.protect[values['joint']])}"


@dataclass(frozen=True, slots=True)
class DriverMode(AxisFault):
    """A driver is set to another microstep mode, or as it was.

    It is set by its switches or by the chip's pins M1 and M2.

    Attributes:
        microsteps: microsteps per full step; None: as set by the board, or by the switches at power-up.
    """

    do = "mode"
    ended_by: ClassVar = {"microsteps": None}
    reactions = (
        Documented(
            "a driver in another microstep mode",
            UNKNOWABLE,
            "its steps are longer or shorter: a limit switch may come; the verdict tells it, `doctor` finds it",
        ),
    )

    microsteps: Annotated[int | None, Key(metavar="N", choices={each: each for each in MICROSTEPS_CHOICES})] = None

    def __post_init__(self) -> None:
        if self.microsteps is not None and self.microsteps not in MICROSTEPS_CHOICES:
            raise ValueError(f"microsteps {self.microsteps} is not one of {', '.join(map(str, MICROSTEPS_CHOICES))}")

    def check(self, simulation: "Simulation", number: int) -> None:
        if self.microsteps is None:
            return
        chip = _chip(simulation, number, self.axis)
        try:
            one_of(self.microsteps, chip.microsteps, f"{chip.name}'s")
        except ValueError as error:
            raise InputError(f"microsteps: {error}") from error

    def apply_to(self, board: "Board", _now_counts: int) -> None:
        board.set_driver_mode(self.axis, self.microsteps)

    def undo(self, _before: "BoardEnvironment") -> "DriverMode":
        return DriverMode(self.axis, None)


OSC_MIN_PF: Final = 64
"""Smallest capacitor at OSC, in whole pF, with which the chip's oscillator keeps its limit."""


@dataclass(frozen=True, slots=True)
class OscCapacitor(AxisFault):
    """The capacitor at a driver chip's OSC pin has another value.

    It has aged or is the wrong one. It sets the chopping rate and the shortest pulse that counts.
    """

    do = "osc"
    over = "the part stays as it is"
    ends = "`osc {joint}` with the capacitor of before"
    reactions = (
        Documented(
            "another capacitor at OSC",
            Reaction(MotionEffect.GOES_ON, verified=False),
            "with a larger one the chip misses pulses; the verdict tells it",
        ),
    )

    osc_pf: Annotated[float, Key(metavar="PF", least=OSC_MIN_PF, most=1e6, unit="pF")]

    def check(self, simulation: "Simulation", number: int) -> None:
        chip = _chip(simulation, number, self.axis)
        if chip.oscillator is None:
            raise InputError(f"{chip.name} has no capacitor at OSC; a TB6560 has")

    def apply_to(self, board: "Board", _now_counts: int) -> None:
        board.drain()
        board.drivers.change_capacitor(self.axis, self.osc_pf)

    def end(self, engine: "Engine") -> None:
        """Fit the usual capacitor again, as the repair of a machine does."""
        board, axis = engine.target.axes[self.axis]
        if (usual := board.drivers.drivers[axis].module.chip.oscillator) is not None:
            engine.target.operate(OscCapacitor(self.axis, usual.osc_pf))


def _tripped_and_reported(fault: "ShortCircuit", moment: "Moment") -> bool:
    """Return whether a short circuit draws current, and the board learns of it."""
    axis = moment.axes[fault.axis]
    return fault.shorted and axis.energised and axis.fault_input is DigitalInput.DRIVER_FAULT


@dataclass(frozen=True, slots=True)
class ShortCircuit(AxisFault):
    """A motor is short-circuited, or whole again: its driver switches itself off, and stays so.

    The short is from one phase to the other or to ground. A driver with a protection switches itself off as soon as
    current flows, until what its source says; another one is destroyed.
    """

    do = "short-circuit"
    ended_by: ClassVar = {"shorted": False}
    reactions = (
        Documented(
            "motor short-circuited, its driver is on and its fault output wired",
            replace(stops(ErrorCode.OUTPUT_STAGE, motion=MotionEffect.CUT), others=(ErrorCode.CAN_OVERRUN,)),
            "the driver has switched itself off, and what ends that depends on it; the other axes stop by a ramp; where"
            " ENABLE ends it the input falls at once, and reports of both may be one too many for the node's queue",
            _tripped_and_reported,
        ),
        Documented(
            "motor short-circuited, and nothing tells it",
            replace(UNKNOWABLE, codes=(ErrorCode.LIMIT_SWITCH, ErrorCode.OUTPUT_STAGE)),
            "the axis has no torque and the board cannot know; the verdict tells it; with a fault output that is wired"
            " it stops once the driver is on",
            lambda fault, _: fault.shorted,
        ),
        Documented("motor whole again", GOES_ON, "a latch of its driver stays"),
    )

    shorted: bool

    def apply_to(self, board: "Board", _now_counts: int) -> None:
        board.short(self.axis, shorted=self.shorted)

    def undo(self, before: "BoardEnvironment") -> "ShortCircuit":
        """Return the repair of the motor; its driver stays off."""
        return ShortCircuit(self.axis, before.axes[self.axis].shorted)


# --- the wires to the drivers

_NOISE_KEYS: Final = (
    Key("rate_hz", KeyKind.NUMBER, "HZ", 0, NOISE_RATE_MAX_HZ, "Hz", optional=True),
    Key("width_us", KeyKind.NUMBER, "US", 0.1, 1e6, "us", parts=1000, optional=True),
    Key("count", KeyKind.WHOLE, "N", 0, optional=True),
    Key("seed", KeyKind.WHOLE, "SEED", 0, optional=True),
)


def _condition(
    state: WireState | None, rate_hz: float | None, width_ns: int | None, count: int | None, seed: int | None
) -> Condition:
    """Return the condition of a wire; a state of None is a noisy one."""
    if state is not None:
        given = [
            key.name
            for key, value in zip(_NOISE_KEYS, (rate_hz, width_ns, count, seed), strict=True)
            if value is not None
        ]
        if given:
            raise ValueError(f"{given[0]}: is for a noisy wire, not for one that is {state}")
        return state
    if rate_hz is None or width_ns is None:
        missing = "rate_hz" if rate_hz is None else "width_us"
        raise ValueError(f"{missing}: is missing: a noisy wire has rate_hz and width_us")
    return Noise(rate_hz, width_ns, count, seed or 0)


def _values(condition: Condition) -> tuple[object, ...]:
    """Return the values of the keys of a condition."""
    if isinstance(condition, WireState):
        return condition, None, None, None, None
    return None, condition.rate_hz, condition.width_ns, condition.count, condition.seed or None


_CONDITIONS: Final = {**{each.value: each for each in WireState}, "noisy": None}


@dataclass(frozen=True, slots=True)
class SetWire(AxisFault):
    """The wire `step`, `dir` or `enable` to a driver is `broken`, shorted `low` or `high`, `noisy` or `whole`; a noisy
    one has `rate_hz` and `width_us`.
    """

    do = "wire"
    place_fields = ("axis", "wire")
    ended_by: ClassVar = {"condition": WireState.WHOLE}
    reactions = (
        Documented(
            "wire to a driver broken, shorted or noisy",
            UNKNOWABLE,
            "a board without feedback from its drivers cannot know; the verdict tells it; a limit switch may come",
            lambda fault, _: fault.condition is not WireState.WHOLE,
        ),
        Documented("wire to a driver whole", GOES_ON),
    )

    wire: Wire
    condition: Annotated[
        Condition,
        Keys((Key("condition", KeyKind.WORD, choices=_CONDITIONS), *_NOISE_KEYS), _condition, _values),
    ]

    def apply_to(self, board: "Board", _now_counts: int) -> None:
        board.set_wire(self.axis, self.wire, self.condition)

    def undo(self, _before: "BoardEnvironment") -> "SetWire":
        return SetWire(self.axis, self.wire, WireState.WHOLE)

    @classmethod
    def ends_by(cls, values: Mapping[str, Any]) -> str | None:
        whole = cls.ending_request(values)
        return f"{values['count']} disturbances or {whole}" if whole and "count" in values else whole
