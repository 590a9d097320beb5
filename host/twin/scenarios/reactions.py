"""The documented reaction to each harm, as one table: the page docs/faults.md shows it, tests walk through it.

The first row whose condition holds is the documented one. A condition may depend on what the machine is doing when the
fault begins: a limit switch stops only an axis that moves towards it. Where it depends on what comes later as well, the
reaction is not certain: both it and none are right.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from enum import Enum
from math import inf
from typing import Final, TypeGuard

from steptwin.emulator.bus_faults import BusFault, BusFaultKind
from steptwin.emulator.operations import (
    Babble,
    BoardTemperature,
    BouncingSwitch,
    BrownOut,
    BusOff,
    Contact,
    DriverMode,
    DriverProtect,
    EmergencyStop,
    OscCapacitor,
    Payload,
    PowerUp,
    SetInput,
    SetWire,
    Slip,
    StrangerSends,
    StuckSwitch,
    Supply,
    SwitchWire,
    WatchdogReset,
)
from steptwin.emulator.wires import WireState
from steptwin.host.client.heartbeat import TIMEOUT_MS
from steptwin.host.client.waiting import REPLY_TIMEOUT_S, SILENCE_S
from steptwin.host.twin.scenarios.harms import BusRepair, Harm, HostFault, HostFaultKind, on_axis
from steptwin.host.twin.scenarios.moment import Moment
from steptwin.protocol.cia402 import DigitalInput, ErrorCode, State
from steptwin.protocol.frame import COB_HEARTBEAT, COB_ID_MASK, COB_SYNC, HOST_NODE_ID
from steptwin.protocol.pvt import QUEUE_DEPTH

TICK_MS: Final = 0.25
"""The firmware sees its inputs, and begins a ramp, with the next servo tick."""
HEARTBEAT_MS: Final = TIMEOUT_MS + TICK_MS
"""A host is lost when its heartbeat has been missing for this long."""
RECORD_MS: Final = 10
"""Longest record of a planned motion."""
QUEUE_MS: Final = (QUEUE_DEPTH + 1) * RECORD_MS + TICK_MS
"""A full queue and the record in execution last so long."""

HOST_NOTICES_MS: Final = 40.0
"""What a host needs to stop the other boards after a fault on one: the inhibit time of its report and two looks of the
host, 10 ms each, and frames that wait for the bus."""
LOST_BOARD_MS: Final = 1000 * SILENCE_S + 100 + HOST_NOTICES_MS
"""Until a host notices that a board is silent, whose last report may be one period of its event timer, 100 ms, old."""

SUPPLY_RANGE_10MV: Final = range(1000, 3401)
"""Motor supply at which drives stay on: 0x2002:03 and :04 after power-up."""
TEMPERATURE_MAX_DECIDEGC: Final = 850
"""Highest temperature of the board at which drives stay on: 0x2002:05 after power-up."""


class Motion(Enum):
    """What becomes of the motion."""

    GOES_ON = "goes on"
    RAMP = "stops by a ramp"
    CUT = "its pulses end at once"
    NOT_BEGUN = "does not begin"


@dataclass(frozen=True, slots=True)
class Reaction:
    """What the machine does for a fault.

    Attributes:
        motion: what becomes of the motion.
        codes: error codes of EMCY, with one of which each axis concerned reports it; empty: they report nothing.
        state: state of these axes' drives afterwards; None: the same as before.
        begins_ms: time from the fault's beginning within which the ramp begins or the pulses end.
        certain: whether it must come; else none is right as well.
        verified: whether the drivers' counts are as planned as long as the motion goes on; False: `verify` tells.
        others: error codes that axes may report which the fault does not concern.

    Raises:
        ValueError: a state is expected after a motion that goes on.
    """

    motion: Motion
    codes: tuple[ErrorCode, ...] = ()
    state: State | None = None
    begins_ms: float = 0.0
    certain: bool = True
    verified: bool = True
    others: tuple[ErrorCode, ...] = ()

    def __post_init__(self) -> None:
        if self.motion is Motion.GOES_ON and self.state is not None:
            raise ValueError("state: is for a motion that ends; at the end of one that goes on the drives are off")

    @property
    def stops(self) -> bool:
        """True if the motion ends."""
        return self.motion is not Motion.GOES_ON

    @property
    def position_known(self) -> bool:
        """Whether axes that moved know their positions afterwards."""
        return self.motion is not Motion.CUT


GOES_ON: Final = Reaction(Motion.GOES_ON)
_UNKNOWABLE: Final = Reaction(Motion.RAMP, (ErrorCode.LIMIT_SWITCH,), State.FAULT, inf, certain=False, verified=False)
"""A motor is elsewhere than its drive believes: nothing tells that, unless it comes to a limit switch."""


_RUN_DRY: Final = (ErrorCode.PVT_UNDERRUN, ErrorCode.GROUP_STOPPED)
"""Error codes where queues run dry: an axis that rests then is stopped with those that move."""


_HOST_LOST: Final = (ErrorCode.HEARTBEAT_LOST, *_RUN_DRY)
"""Error codes where the host is gone: a full queue of short records runs dry before the heartbeat is missed."""
_OF_BAD_BUS: Final = (
    *_HOST_LOST,
    ErrorCode.CAN_OVERRUN,
    ErrorCode.CAN_ERROR_PASSIVE,
    ErrorCode.CAN_BUS_OFF_RECOVERED,
)
"""Error codes where frames come late or not at all; the EMCYs themselves may be among these."""
_OF_STRANGERS: Final = (
    *_RUN_DRY,
    ErrorCode.HEARTBEAT_LOST,
    ErrorCode.CAN_OVERRUN,
    ErrorCode.CAN_ERROR_PASSIVE,
    ErrorCode.PDO_TOO_SHORT,
    ErrorCode.PDO_TOO_LONG,
)
"""Error codes to which a stranger's frames may lead."""


def _stops(
    *codes: ErrorCode, motion: Motion = Motion.RAMP, begins_ms: float = TICK_MS, certain: bool = True
) -> Reaction:
    return Reaction(motion, codes, State.FAULT, begins_ms, certain)


@dataclass(frozen=True, slots=True)
class Documented:
    """A row of the table.

    Attributes:
        what: the fault, in words.
        applies: returns whether a harm is of this kind while the machine does this.
        reaction: the reaction.
        why: a remark for the page; may be empty.
    """

    what: str
    applies: Callable[[Harm, Moment], bool]
    reaction: Reaction
    why: str = ""


def _host(kind: HostFaultKind) -> Callable[[Harm, Moment], bool]:
    return lambda harm, _: isinstance(harm, HostFault) and harm.kind is kind


def _bus(kind: BusFaultKind, only: int | None = None) -> Callable[[Harm, Moment], bool]:
    """Return the condition that a fault of the bus is of a kind and, given an identifier, concerns no other frames."""

    def applies(harm: Harm, _moment: Moment) -> bool:
        if not isinstance(harm, BusFault) or harm.kind is not kind:
            return False
        return only is None or [cob_id for cob_id in range(COB_ID_MASK + 1) if cob_id in harm.cob_ids] == [only]

    return applies


def _leaves_bus(harm: Harm, _moment: Moment) -> bool:
    """Return whether a CAN controller goes into bus-off, now or with a frame that it sends."""
    return isinstance(harm, BusOff) or (isinstance(harm, BusFault) and harm.kind is BusFaultKind.BUS_OFF)


def _one_of_several(harm: Harm, moment: Moment) -> bool:
    """Return whether one of several boards is reset."""
    return isinstance(harm, BrownOut | WatchdogReset) and harm.axis is not None and moment.several_boards


def _deaf_board(harm: Harm, moment: Moment) -> bool:
    """Return whether SYNC is lost for one of several boards."""
    alone = _bus(BusFaultKind.LOSS, COB_SYNC)(harm, moment)
    return alone and isinstance(harm, BusFault) and harm.receiver is not None and moment.several_boards


def _silent_host(harm: Harm, moment: Moment) -> bool:
    """Return whether the host's heartbeat is lost from now on, and nothing else."""
    alone = _bus(BusFaultKind.LOSS, COB_HEARTBEAT + HOST_NODE_ID)(harm, moment)
    return alone and isinstance(harm, BusFault) and harm.rate == 1 and not harm.skip


def _closed(harm: Harm) -> TypeGuard[StuckSwitch]:
    """Return whether a limit switch sticks closed."""
    return isinstance(harm, StuckSwitch) and bool(harm.closed) and harm.switch is not DigitalInput.HOME


def _seems_closed(harm: Harm) -> TypeGuard[SwitchWire]:
    """Return whether the broken wire of a limit switch looks as if that were closed."""
    if not isinstance(harm, SwitchWire) or harm.switch is DigitalInput.HOME:
        return False
    return harm.broken is Contact.NORMALLY_CLOSED


def _towards(harm: StuckSwitch | SwitchWire, moment: Moment) -> bool:
    """Return whether its axis moves towards a limit switch."""
    velocity = moment.axes[harm.axis].velocity
    return velocity > 0 if harm.switch is DigitalInput.POSITIVE_LIMIT else velocity < 0


DOCUMENTED: Final[tuple[Documented, ...]] = (
    Documented(
        "emergency stop pressed",
        lambda harm, _: isinstance(harm, EmergencyStop) and harm.pressed,
        _stops(ErrorCode.ESTOP),
        "stop category 1 of IEC 60204-1",
    ),
    Documented("emergency stop pulled out", lambda harm, _: isinstance(harm, EmergencyStop), GOES_ON),
    Documented(
        "motor supply below 10.00 V",
        lambda harm, _: isinstance(harm, Supply) and harm.supply_10mv < SUPPLY_RANGE_10MV.start,
        _stops(ErrorCode.UNDERVOLTAGE, motion=Motion.CUT),
        "without its supply no driver can follow a ramp",
    ),
    Documented(
        "motor supply above 34.00 V",
        lambda harm, _: isinstance(harm, Supply) and harm.supply_10mv >= SUPPLY_RANGE_10MV.stop,
        _stops(ErrorCode.OVERVOLTAGE),
    ),
    Documented("motor supply from 10.00 to 34.00 V", lambda harm, _: isinstance(harm, Supply), GOES_ON),
    Documented(
        "board above 85.0 degC",
        lambda harm, _: isinstance(harm, BoardTemperature) and harm.temperature_decidegc > TEMPERATURE_MAX_DECIDEGC,
        _stops(ErrorCode.TEMPERATURE),
    ),
    Documented("board up to 85.0 degC", lambda harm, _: isinstance(harm, BoardTemperature), GOES_ON),
    Documented(
        "Protect of a driver low",
        lambda harm, _: isinstance(harm, DriverProtect) and harm.active,
        _stops(ErrorCode.TEMPERATURE, motion=Motion.CUT),
        "this driver has switched itself off; the other axes stop by a ramp",
    ),
    Documented("Protect of a driver free", lambda harm, _: isinstance(harm, DriverProtect), GOES_ON),
    Documented(
        "limit switch stuck closed, the axis moves towards it",
        lambda harm, moment: _closed(harm) and _towards(harm, moment),
        _stops(ErrorCode.LIMIT_SWITCH),
    ),
    Documented(
        "limit switch stuck closed, the axis rests or moves away",
        lambda harm, _: _closed(harm),
        _stops(ErrorCode.LIMIT_SWITCH, begins_ms=inf, certain=False),
        "once it moves towards the switch",
    ),
    Documented(
        "switch stuck open, or a home switch stuck closed",
        lambda harm, _: isinstance(harm, StuckSwitch),
        GOES_ON,
        "a planned motion stays between its limit switches; homing fails (EMCY 0xFF05)",
    ),
    Documented(
        "wire of a limit switch broken, its contact closed at rest, the axis moves towards it",
        lambda harm, moment: _seems_closed(harm) and _towards(harm, moment),
        _stops(ErrorCode.LIMIT_SWITCH),
        "as a switch that is stuck closed",
    ),
    Documented(
        "wire of a limit switch broken, its contact closed at rest, the axis rests or moves away",
        lambda harm, _: _seems_closed(harm),
        _stops(ErrorCode.LIMIT_SWITCH, begins_ms=inf, certain=False),
        "once it moves towards the switch",
    ),
    Documented(
        "wire of a switch broken, its contact open at rest",
        lambda harm, _: isinstance(harm, SwitchWire),
        GOES_ON,
        "the board notices it only when it needs the switch: fit contacts that are closed at rest",
    ),
    Documented(
        "a switch bounces",
        lambda harm, _: isinstance(harm, BouncingSwitch),
        GOES_ON,
        "a planned motion stays between its limit switches; homing takes the first edge that a tick shows",
    ),
    Documented(
        "a driver in another microstep mode",
        lambda harm, _: isinstance(harm, DriverMode),
        _UNKNOWABLE,
        "its steps are longer or shorter: a limit switch may come; the verdict tells it, `doctor` finds it",
    ),
    Documented(
        "another capacitor at OSC",
        lambda harm, _: isinstance(harm, OscCapacitor),
        Reaction(Motion.GOES_ON, verified=False),
        "with a larger one the chip misses pulses; the verdict tells it",
    ),
    Documented(
        "sensor on or off",
        lambda harm, _: isinstance(harm, SetInput),
        GOES_ON,
        "programs wait for it",
    ),
    Documented(
        "a motor falls out of step",
        lambda harm, _: isinstance(harm, Slip),
        _UNKNOWABLE,
        "a board without encoders cannot know; the verdict tells it, and homing ends it; a limit switch may come",
    ),
    Documented(
        "another payload",
        lambda harm, _: isinstance(harm, Payload),
        replace(_UNKNOWABLE, codes=(ErrorCode.LIMIT_SWITCH, ErrorCode.GROUP_STOPPED)),
        "a board without encoders cannot know whether its motors keep step; the verdict tells a slip; after it a limit"
        " switch may come",
    ),
    Documented(
        "wire to a driver broken, shorted or noisy",
        lambda harm, _: isinstance(harm, SetWire) and harm.condition is not WireState.WHOLE,
        _UNKNOWABLE,
        "a board without feedback from its drivers cannot know; the verdict tells it; a limit switch may come",
    ),
    Documented("wire to a driver whole", lambda harm, _: isinstance(harm, SetWire), GOES_ON),
    Documented(
        "one of several boards is without supply from now on",
        lambda harm, moment: _one_of_several(harm, moment) and isinstance(harm, BrownOut) and harm.for_ms is None,
        Reaction(Motion.CUT, begins_ms=LOST_BOARD_MS, others=_HOST_LOST),
        "its nodes are silent; the host stops the axes of the other boards after 1 s",
    ),
    Documented(
        "one of several boards browns out for a time, or its watchdog resets it",
        _one_of_several,
        Reaction(Motion.CUT, (), State.SWITCH_ON_DISABLED, LOST_BOARD_MS, others=_HOST_LOST),
        "its own axes stop at once, and are to be homed; the host stops those of the other boards when this board"
        " announces itself again, or after 1 s of silence",
    ),
    Documented(
        "a board's logic is without supply from now on",
        lambda harm, _: isinstance(harm, BrownOut) and harm.for_ms is None,
        Reaction(Motion.CUT, begins_ms=TICK_MS),
        "its nodes are silent, which the host notices after 1 s, until `power-up`: then as below",
    ),
    Documented(
        "a board's logic browns out for a time, or its watchdog resets it",
        lambda harm, _: isinstance(harm, BrownOut | WatchdogReset),
        Reaction(Motion.CUT, (), State.SWITCH_ON_DISABLED, TICK_MS),
        "its nodes announce themselves again and know no position; home them",
    ),
    Documented("a board without power gets it", lambda harm, _: isinstance(harm, PowerUp), GOES_ON),
    Documented(
        "a stranger sends frames",
        lambda harm, _: isinstance(harm, StrangerSends | Babble),
        Reaction(Motion.GOES_ON, _OF_STRANGERS, certain=False),
        "unless it commands otherwise: a board obeys every station. Babble with a low identifier keeps the points away",
    ),
    Documented(
        "a controller leaves the bus",
        _leaves_bus,
        Reaction(
            Motion.GOES_ON,
            (ErrorCode.CAN_BUS_OFF_RECOVERED, ErrorCode.CAN_ERROR_PASSIVE, ErrorCode.CAN_OVERRUN),
            certain=False,
        ),
        "it is back after 128 x 11 bits, which a board reports; one not acknowledged meanwhile is error passive; newer"
        " reports replace those that wait",
    ),
    Documented(
        "frames come twice",
        _bus(BusFaultKind.DUPLICATE),
        Reaction(Motion.GOES_ON, (ErrorCode.CAN_ERROR_PASSIVE, ErrorCode.CAN_BUS_OFF_RECOVERED), certain=False),
        "sequence numbers tell; a sender whose frames all come twice goes into bus-off",
    ),
    Documented(
        "heartbeat of the host lost",
        _silent_host,
        _stops(ErrorCode.HEARTBEAT_LOST, begins_ms=HEARTBEAT_MS, certain=False),
        "unless it comes again in time",
    ),
    Documented(
        "SYNC lost for one of several boards",
        _deaf_board,
        _stops(*_HOST_LOST, begins_ms=1000 * REPLY_TIMEOUT_S + HOST_NOTICES_MS, certain=False),
        "the host notices after 1 s that not all axes start, stops those that did, and gives up",
    ),
    Documented(
        "SYNC lost",
        _bus(BusFaultKind.LOSS, COB_SYNC),
        Reaction(Motion.NOT_BEGUN, (ErrorCode.HEARTBEAT_LOST,), State.FAULT, certain=False),
        "the host notices that no axis starts, and gives up",
    ),
    Documented(
        "frames lost",
        _bus(BusFaultKind.LOSS),
        _stops(*_RUN_DRY, ErrorCode.HEARTBEAT_LOST, begins_ms=inf, certain=False),
        "lost points are sent again; if too many are lost, the queues run dry",
    ),
    Documented(
        "frames disturbed",
        _bus(BusFaultKind.CORRUPTION),
        _stops(*_OF_BAD_BUS, begins_ms=inf, certain=False),
        "CAN repeats them; if none comes through, it is as if they were lost",
    ),
    Documented(
        "frames delayed",
        _bus(BusFaultKind.DELAY),
        _stops(*_OF_BAD_BUS, begins_ms=inf, certain=False),
        "the queues bridge it, up to the points that are in them; the host gives a start up that is a second late",
    ),
    Documented("bus repaired", lambda harm, _: isinstance(harm, BusRepair), GOES_ON),
    Documented(
        "host hangs, its heartbeat goes on",
        _host(HostFaultKind.HANG),
        _stops(*_RUN_DRY, begins_ms=QUEUE_MS, certain=False),
        "the queues bridge it, up to the points that are in them",
    ),
    Documented(
        "host dies",
        _host(HostFaultKind.DEATH),
        _stops(*_HOST_LOST, begins_ms=HEARTBEAT_MS),
        "records of less than 6 ms run out before the heartbeat is missed",
    ),
    Documented(
        "host dies and starts again",
        _host(HostFaultKind.RESTART),
        Reaction(Motion.RAMP, _HOST_LOST, State.OPERATION_ENABLED, HEARTBEAT_MS, certain=False),
        "the new one waits for rest, resets the fault and enables the drives; the motion is not continued",
    ),
    Documented(
        "host is late",
        _host(HostFaultKind.LATE),
        _stops(*_RUN_DRY, begins_ms=inf, certain=False),
        "the queues bridge it, up to the points that are in them",
    ),
    Documented(
        "host sends points out of order",
        _host(HostFaultKind.DISORDER),
        _stops(*_RUN_DRY, begins_ms=inf, certain=False),
        "the board reports each gap and the host sends the points again; if it lasts, the queues run dry",
    ),
)


def documented(harm: Harm, moment: Moment) -> Documented:
    """Return the row for a harm that begins while the machine does this."""
    return next(row for row in DOCUMENTED if row.applies(harm, moment))


def concerned(harm: Harm, boards: Sequence[int]) -> list[int]:
    """Return the axes, whose boards have these numbers, that answer a harm; those of their group stop with them.

    What is done to a board concerns all axes on it.
    """
    axes = range(len(boards))
    axis = on_axis(harm)
    if axis is not None:
        return [axis]
    if isinstance(harm, BrownOut | WatchdogReset | PowerUp | BusOff) and harm.axis is not None:
        return [each for each in axes if boards[each] == boards[harm.axis]]
    return list(axes)
