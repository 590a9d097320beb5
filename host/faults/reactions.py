"""The documented reaction to each harm, as one table: the page docs/faults.md shows it, tests walk through it.

The first row whose condition holds is the documented one. A condition may depend on what the machine is doing when the
fault begins: a limit switch stops only an axis that moves towards it. Where it depends on what comes later as well, the
reaction is not certain: both it and none are right.
"""

from collections.abc import Callable, Sequence
from dataclasses import replace
from math import inf
from typing import Final, TypeGuard

from steptwin.emulator.faults.bus import (
    Babble,
    BusFault,
    BusOff,
    BusRepair,
    FrameCorruption,
    FrameDelay,
    FrameDuplicate,
    FrameLoss,
    SenderOff,
    StrangerSends,
)
from steptwin.emulator.faults.drivers import DriverMode, DriverProtect, OscCapacitor
from steptwin.emulator.faults.harm import AxisOperation, Harm, Operation
from steptwin.emulator.faults.host import HostFault, HostFaultKind
from steptwin.emulator.faults.limit_switches import BouncingSwitch, Contact, StuckSwitch, SwitchWire
from steptwin.emulator.faults.machine import (
    BoardTemperature,
    BrownOut,
    EmergencyStop,
    Payload,
    PowerUp,
    SetInput,
    Slip,
    Supply,
    WatchdogReset,
)
from steptwin.emulator.faults.wiring import SetWire, WireState
from steptwin.host.faults.reaction import (
    DEAF_BOARD_MS,
    GOES_ON,
    HEARTBEAT_MS,
    HOST_LOST,
    LOST_BOARD_MS,
    QUEUE_MS,
    RUN_DRY,
    TICK_MS,
    UNKNOWABLE,
    Documented,
    Motion,
    Reaction,
    stops,
)
from steptwin.host.faults.target import Moment
from steptwin.protocol.cia402 import DigitalInput, ErrorCode, State
from steptwin.protocol.frame import COB_HEARTBEAT, COB_ID_MASK, COB_NMT, COB_SYNC, HOST_NODE_ID, Frame
from steptwin.protocol.nmt import NmtCommand

# --- the host


def _host(kind: HostFaultKind) -> Callable[[Harm, Moment], bool]:
    return lambda harm, _: isinstance(harm, HostFault) and harm.kind is kind


_HOST_ROWS: Final[tuple[Documented, ...]] = (
    Documented(
        "host hangs, its heartbeat goes on",
        _host(HostFaultKind.HANG),
        stops(*RUN_DRY, begins_ms=QUEUE_MS, certain=False),
        "the queues bridge it, up to the points that are in them",
    ),
    Documented(
        "host dies",
        _host(HostFaultKind.DEATH),
        stops(*HOST_LOST, begins_ms=HEARTBEAT_MS),
        "records of less than 6 ms run out before the heartbeat is missed",
    ),
    Documented(
        "host dies and starts again",
        _host(HostFaultKind.RESTART),
        Reaction(Motion.RAMP, HOST_LOST, State.OPERATION_ENABLED, HEARTBEAT_MS, certain=False),
        "the new one waits for rest, resets the fault and enables the drives; the motion is not continued",
    ),
    Documented(
        "host is late",
        _host(HostFaultKind.LATE),
        stops(*RUN_DRY, begins_ms=inf, certain=False),
        "the queues bridge it, up to the points that are in them",
    ),
    Documented(
        "host sends points out of order",
        _host(HostFaultKind.DISORDER),
        stops(*RUN_DRY, begins_ms=inf, certain=False),
        "the board reports each gap and the host sends the points again; if it lasts, the queues run dry",
    ),
)


# --- the machine

SUPPLY_RANGE_10MV: Final = range(1000, 3401)
"""Motor supply with drives on: 0x2002:03 and :04 after power-up."""
TEMPERATURE_MAX_DECIDEGC: Final = 850
"""Highest temperature of the board with drives on: 0x2002:05 after power-up."""


def _one_of_several(harm: Harm, moment: Moment) -> bool:
    """Return whether one of several boards is reset."""
    return isinstance(harm, BrownOut | WatchdogReset) and harm.axis is not None and moment.several_boards


_MACHINE_ROWS: Final[tuple[Documented, ...]] = (
    Documented(
        "emergency stop pressed",
        lambda harm, _: isinstance(harm, EmergencyStop) and harm.pressed,
        stops(ErrorCode.ESTOP),
        "stop category 1 of IEC 60204-1",
    ),
    Documented("emergency stop pulled out", lambda harm, _: isinstance(harm, EmergencyStop), GOES_ON),
    Documented(
        "motor supply below 10.00 V",
        lambda harm, _: isinstance(harm, Supply) and harm.supply_10mv < SUPPLY_RANGE_10MV.start,
        stops(ErrorCode.UNDERVOLTAGE, motion=Motion.CUT),
        "without its supply no driver can follow a ramp",
    ),
    Documented(
        "motor supply above 34.00 V",
        lambda harm, _: isinstance(harm, Supply) and harm.supply_10mv >= SUPPLY_RANGE_10MV.stop,
        stops(ErrorCode.OVERVOLTAGE),
    ),
    Documented("motor supply from 10.00 to 34.00 V", lambda harm, _: isinstance(harm, Supply), GOES_ON),
    Documented(
        "board above 85.0 degC",
        lambda harm, _: isinstance(harm, BoardTemperature) and harm.temperature_decidegc > TEMPERATURE_MAX_DECIDEGC,
        stops(ErrorCode.TEMPERATURE),
    ),
    Documented("board up to 85.0 degC", lambda harm, _: isinstance(harm, BoardTemperature), GOES_ON),
    Documented(
        "sensor on or off",
        lambda harm, _: isinstance(harm, SetInput),
        GOES_ON,
        "programs wait for it",
    ),
    Documented(
        "a motor falls out of step",
        lambda harm, _: isinstance(harm, Slip),
        UNKNOWABLE,
        "a board without encoders cannot know; the verdict tells it, and homing ends it; a limit switch may come",
    ),
    Documented(
        "another payload",
        lambda harm, _: isinstance(harm, Payload),
        replace(UNKNOWABLE, codes=(ErrorCode.LIMIT_SWITCH, ErrorCode.GROUP_STOPPED)),
        "a board without encoders cannot know whether its motors keep step; the verdict tells a slip; after it a limit"
        " switch may come",
    ),
    Documented(
        "one of several boards is without supply from now on",
        lambda harm, moment: _one_of_several(harm, moment) and isinstance(harm, BrownOut) and harm.for_ms is None,
        Reaction(Motion.CUT, begins_ms=LOST_BOARD_MS, others=HOST_LOST),
        "its nodes are silent; the host stops the axes of the other boards after 1 s",
    ),
    Documented(
        "one of several boards browns out for a time, or its watchdog resets it",
        _one_of_several,
        Reaction(Motion.CUT, (), State.SWITCH_ON_DISABLED, LOST_BOARD_MS, others=HOST_LOST),
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
)


# --- the wiring: Protect, switches and their wires, drivers' settings, their wires


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


_WIRING_ROWS: Final[tuple[Documented, ...]] = (
    Documented(
        "Protect of a driver low",
        lambda harm, _: isinstance(harm, DriverProtect) and harm.active,
        stops(ErrorCode.TEMPERATURE, motion=Motion.CUT),
        "this driver has switched itself off; the other axes stop by a ramp",
    ),
    Documented("Protect of a driver free", lambda harm, _: isinstance(harm, DriverProtect), GOES_ON),
    Documented(
        "limit switch stuck closed, the axis moves towards it",
        lambda harm, moment: _closed(harm) and _towards(harm, moment),
        stops(ErrorCode.LIMIT_SWITCH),
    ),
    Documented(
        "limit switch stuck closed, the axis rests or moves away",
        lambda harm, _: _closed(harm),
        stops(ErrorCode.LIMIT_SWITCH, begins_ms=inf, certain=False),
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
        stops(ErrorCode.LIMIT_SWITCH),
        "as a switch that is stuck closed",
    ),
    Documented(
        "wire of a limit switch broken, its contact closed at rest, the axis rests or moves away",
        lambda harm, _: _seems_closed(harm),
        stops(ErrorCode.LIMIT_SWITCH, begins_ms=inf, certain=False),
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
        UNKNOWABLE,
        "its steps are longer or shorter: a limit switch may come; the verdict tells it, `doctor` finds it",
    ),
    Documented(
        "another capacitor at OSC",
        lambda harm, _: isinstance(harm, OscCapacitor),
        Reaction(Motion.GOES_ON, verified=False),
        "with a larger one the chip misses pulses; the verdict tells it",
    ),
    Documented(
        "wire to a driver broken, shorted or noisy",
        lambda harm, _: isinstance(harm, SetWire) and harm.condition is not WireState.WHOLE,
        UNKNOWABLE,
        "a board without feedback from its drivers cannot know; the verdict tells it; a limit switch may come",
    ),
    Documented("wire to a driver whole", lambda harm, _: isinstance(harm, SetWire), GOES_ON),
)


# --- the bus

_OF_BAD_BUS: Final = (
    *HOST_LOST,
    ErrorCode.CAN_OVERRUN,
    ErrorCode.CAN_ERROR_PASSIVE,
    ErrorCode.CAN_BUS_OFF_RECOVERED,
)
"""Error codes where frames come late or not at all; the EMCYs themselves may be among these."""
_OF_STRANGERS: Final = (
    *RUN_DRY,
    ErrorCode.COMMUNICATION,
    ErrorCode.HEARTBEAT_LOST,
    ErrorCode.CAN_OVERRUN,
    ErrorCode.CAN_ERROR_PASSIVE,
    ErrorCode.PDO_TOO_SHORT,
    ErrorCode.PDO_TOO_LONG,
)
"""Error codes to which a stranger's frames may lead."""


def _bus(kind: type[BusFault], only: int | None = None) -> Callable[[Harm, Moment], bool]:
    """Return the condition that a fault of the bus is of a kind and, given an identifier, concerns no other frames."""

    def applies(harm: Harm, _moment: Moment) -> bool:
        if not isinstance(harm, kind):
            return False
        return only is None or [cob_id for cob_id in range(COB_ID_MASK + 1) if cob_id in harm.cob_ids] == [only]

    return applies


def _told_to_all(command: NmtCommand) -> Callable[[Harm, Moment], bool]:
    """Return the condition that a stranger sends an NMT command to all nodes."""

    def applies(harm: Harm, _moment: Moment) -> bool:
        return isinstance(harm, StrangerSends | Babble) and harm.frame == Frame(COB_NMT, bytes((command, 0)))

    return applies


def _board_off(harm: Harm, _moment: Moment) -> bool:
    """Return whether the CAN controller of a board goes into bus-off."""
    return isinstance(harm, BusOff) and harm.axis is not None


def _deaf_board(harm: Harm, moment: Moment) -> bool:
    """Return whether SYNC is lost for one of several boards."""
    alone = _bus(FrameLoss, COB_SYNC)(harm, moment)
    return alone and isinstance(harm, FrameLoss) and harm.receiver is not None and moment.several_boards


def _silent_host(harm: Harm, moment: Moment) -> bool:
    """Return whether the host's heartbeat is lost from now on, and nothing else."""
    alone = _bus(FrameLoss, COB_HEARTBEAT + HOST_NODE_ID)(harm, moment)
    return alone and isinstance(harm, BusFault) and harm.rate == 1 and not harm.skip


_BUS_ROWS: Final[tuple[Documented, ...]] = (
    Documented(
        "a stranger stops all nodes (NMT)",
        _told_to_all(NmtCommand.STOP),
        Reaction(Motion.RAMP, (), State.FAULT, TICK_MS, others=(ErrorCode.COMMUNICATION,)),
        "0x6007 acts; a stopped node sends no EMCY: 0x8100 comes when it is started again",
    ),
    Documented(
        "a stranger resets the communication of all nodes (NMT)",
        _told_to_all(NmtCommand.RESET_COMMUNICATION),
        stops(ErrorCode.COMMUNICATION),
        "0x6007 acts; the nodes announce themselves again",
    ),
    Documented(
        "a stranger resets all nodes (NMT)",
        _told_to_all(NmtCommand.RESET_NODE),
        Reaction(Motion.RAMP, (), State.SWITCH_ON_DISABLED, TICK_MS),
        "0x6007 acts; each node is silent until its axis stands, then starts as after power-up",
    ),
    Documented(
        "a stranger sends frames",
        lambda harm, _: isinstance(harm, StrangerSends | Babble),
        Reaction(Motion.GOES_ON, _OF_STRANGERS, certain=False),
        "unless it commands otherwise: a board obeys every station. Babble with a low identifier keeps the points away",
    ),
    Documented(
        "a board's controller leaves the bus",
        _board_off,
        replace(
            stops(ErrorCode.CAN_BUS_OFF_RECOVERED),
            others=(ErrorCode.CAN_ERROR_PASSIVE, ErrorCode.CAN_OVERRUN),
        ),
        "0x6007 and 0x1029 act at once; the EMCY comes when it is back, after 128 x 11 bits; one not acknowledged"
        " meanwhile is error passive; newer reports replace those that wait",
    ),
    Documented(
        "the host's controller leaves the bus",
        lambda harm, _: isinstance(harm, BusOff),
        Reaction(Motion.GOES_ON, (ErrorCode.CAN_ERROR_PASSIVE, ErrorCode.CAN_OVERRUN), certain=False),
        "it is back after 128 x 11 bits, which the queues bridge",
    ),
    Documented(
        "frames come twice, or make their sender leave the bus",
        lambda harm, _: isinstance(harm, FrameDuplicate | SenderOff),
        stops(*_OF_BAD_BUS, begins_ms=inf, certain=False),
        "sequence numbers tell; a sender whose frames all come twice goes into bus-off",
    ),
    Documented(
        "heartbeat of the host lost",
        _silent_host,
        stops(ErrorCode.HEARTBEAT_LOST, begins_ms=HEARTBEAT_MS, certain=False),
        "unless it comes again in time",
    ),
    Documented(
        "SYNC lost for one of several boards",
        _deaf_board,
        stops(*HOST_LOST, begins_ms=DEAF_BOARD_MS, certain=False),
        "the host notices after 1 s that not all axes start, stops those that did, and gives up",
    ),
    Documented(
        "SYNC lost",
        _bus(FrameLoss, COB_SYNC),
        Reaction(Motion.NOT_BEGUN, (ErrorCode.HEARTBEAT_LOST,), State.FAULT, certain=False),
        "the host notices that no axis starts, and gives up",
    ),
    Documented(
        "frames lost",
        _bus(FrameLoss),
        stops(*RUN_DRY, ErrorCode.HEARTBEAT_LOST, begins_ms=inf, certain=False),
        "lost points are sent again; if too many are lost, the queues run dry",
    ),
    Documented(
        "frames disturbed",
        _bus(FrameCorruption),
        stops(*_OF_BAD_BUS, begins_ms=inf, certain=False),
        "CAN repeats them; if none comes through, it is as if they were lost",
    ),
    Documented(
        "frames delayed",
        _bus(FrameDelay),
        stops(*_OF_BAD_BUS, begins_ms=inf, certain=False),
        "the queues bridge it, up to the points that are in them; the host gives a start up that is a second late",
    ),
    Documented("bus repaired", lambda harm, _: isinstance(harm, BusRepair), GOES_ON),
)


DOCUMENTED: Final = (*_MACHINE_ROWS, *_WIRING_ROWS, *_BUS_ROWS, *_HOST_ROWS)
"""Every row; the order matters among those of one kind of harm."""


def documented(harm: Harm, moment: Moment) -> Documented:
    """Return the row for a harm that begins while the machine does this."""
    return next(row for row in DOCUMENTED if row.applies(harm, moment))


def concerned(harm: Harm, boards: Sequence[int]) -> list[int]:
    """Return the axes, whose boards have these numbers, that answer a harm; those of their group stop with them.

    What is done to a board concerns all axes on it.
    """
    axes = range(len(boards))
    if isinstance(harm, AxisOperation):
        return [harm.axis]
    if isinstance(harm, Operation) and harm.place is not None:
        return [each for each in axes if boards[each] == boards[harm.place]]
    return list(axes)
