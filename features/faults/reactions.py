"""The documented reaction to each harm, as one table: the page docs/faults.md shows it, tests walk through it.

The first row whose condition holds is the documented one. A condition may depend on what the machine is doing when the
fault begins: a limit switch stops only an axis that moves towards it. Where it depends on what comes later as well, the
reaction is not certain: both it and none are right.
"""

from collections.abc import Callable, Sequence
from dataclasses import replace
from math import inf
from typing import Final

from steptwin.emulator.drivers.axis_wires import WireState
from steptwin.features.faults.kinds.bus import (
    Babble,
    BusFault,
    BusOff,
    BusRepair,
    FrameCorruption,
    FrameDelay,
    FrameDuplicate,
    FrameLoss,
    HostBitRate,
    SenderOff,
    StrangerSends,
)
from steptwin.features.faults.kinds.drivers import DriverMode, DriverProtect, OscCapacitor, ShortCircuit
from steptwin.features.faults.kinds.harm import AxisHarm, Harm, MachineHarm
from steptwin.features.faults.kinds.host import HostFault, HostFaultKind
from steptwin.features.faults.kinds.limit_switches import BouncingSwitch, Contact, StuckSwitch, SwitchWire
from steptwin.features.faults.kinds.machine import (
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
from steptwin.features.faults.kinds.wiring import SetWire
from steptwin.features.faults.moment import Moment
from steptwin.features.faults.reaction import (
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
from steptwin.protocol.cia402 import DigitalInput, ErrorCode, State
from steptwin.protocol.frame import COB_HEARTBEAT, COB_NMT, COB_SYNC, HOST_NODE_ID, Frame
from steptwin.protocol.nmt import NmtCommand

# --- the host


def _host(kind: HostFaultKind) -> Callable[[HostFault, Moment], bool]:
    return lambda harm, _: harm.kind is kind


_HOST_ROWS: Final[tuple[Documented, ...]] = (
    Documented(
        "host hangs, its heartbeat goes on",
        HostFault,
        stops(*RUN_DRY, begins_ms=QUEUE_MS, certain=False),
        "the queues bridge it, up to the points that are in them",
        when=_host(HostFaultKind.HANG),
    ),
    Documented(
        "host dies",
        HostFault,
        stops(*HOST_LOST, begins_ms=HEARTBEAT_MS),
        "records of less than 6 ms run out before the heartbeat is missed",
        when=_host(HostFaultKind.DEATH),
    ),
    Documented(
        "host dies and starts again",
        HostFault,
        Reaction(Motion.RAMP, HOST_LOST, State.OPERATION_ENABLED, HEARTBEAT_MS, certain=False),
        "the new one waits for rest, resets the fault and enables the drives; the motion is not continued",
        when=_host(HostFaultKind.RESTART),
    ),
    Documented(
        "host is late",
        HostFault,
        stops(*RUN_DRY, begins_ms=inf, certain=False),
        "the queues bridge it, up to the points that are in them",
        when=_host(HostFaultKind.LATE),
    ),
    Documented(
        "host sends points out of order",
        HostFault,
        stops(*RUN_DRY, begins_ms=inf, certain=False),
        "the board reports each gap and the host sends the points again; if it lasts, the queues run dry",
        when=_host(HostFaultKind.DISORDER),
    ),
)


# --- the machine

SUPPLY_RANGE_10MV: Final = range(1000, 3401)
"""Motor supply with drives on: 0x2002:03 and :04 after power-up."""
TEMPERATURE_MAX_DECIDEGC: Final = 850
"""Highest temperature of the board with drives on: 0x2002:05 after power-up."""
_RESET: Final = BrownOut | WatchdogReset


def _one_of_several(harm: BrownOut | WatchdogReset, moment: Moment) -> bool:
    """Return whether one of several boards is reset."""
    return harm.axis is not None and moment.several_boards


_MACHINE_ROWS: Final[tuple[Documented, ...]] = (
    Documented(
        "emergency stop pressed",
        EmergencyStop,
        stops(ErrorCode.ESTOP),
        "stop category 1 of IEC 60204-1",
        when=lambda harm, _: harm.pressed,
    ),
    Documented("emergency stop pulled out", EmergencyStop, GOES_ON),
    Documented(
        "motor supply below 10.00 V",
        Supply,
        stops(ErrorCode.UNDERVOLTAGE, motion=Motion.CUT),
        "without its supply no driver can follow a ramp",
        when=lambda harm, _: harm.supply_10mv < SUPPLY_RANGE_10MV.start,
    ),
    Documented(
        "motor supply above 34.00 V",
        Supply,
        stops(ErrorCode.OVERVOLTAGE),
        when=lambda harm, _: harm.supply_10mv >= SUPPLY_RANGE_10MV.stop,
    ),
    Documented("motor supply from 10.00 to 34.00 V", Supply, GOES_ON),
    Documented(
        "board above 85.0 degC",
        BoardTemperature,
        stops(ErrorCode.TEMPERATURE),
        when=lambda harm, _: harm.temperature_decidegc > TEMPERATURE_MAX_DECIDEGC,
    ),
    Documented("board up to 85.0 degC", BoardTemperature, GOES_ON),
    Documented("sensor on or off", SetInput, GOES_ON, "programs wait for it"),
    Documented(
        "a motor falls out of step",
        Slip,
        UNKNOWABLE,
        "a board without encoders cannot know; the verdict tells it, and homing ends it; a limit switch may come",
    ),
    Documented(
        "another payload",
        Payload,
        replace(UNKNOWABLE, codes=(ErrorCode.LIMIT_SWITCH, ErrorCode.GROUP_STOPPED)),
        "a board without encoders cannot know whether its motors keep step; the verdict tells a slip; after it a limit"
        " switch may come",
    ),
    Documented(
        "one of several boards is without supply from now on",
        BrownOut,
        Reaction(Motion.CUT, begins_ms=LOST_BOARD_MS, others=HOST_LOST),
        "its nodes are silent; the host stops the axes of the other boards after 1 s",
        when=lambda harm, moment: _one_of_several(harm, moment) and harm.for_ms is None,
    ),
    Documented(
        "one of several boards browns out for a time, or its watchdog resets it",
        _RESET,
        Reaction(Motion.CUT, (), State.SWITCH_ON_DISABLED, LOST_BOARD_MS, others=HOST_LOST),
        "its own axes stop at once, and are to be homed; the host stops those of the other boards when this board"
        " announces itself again, or after 1 s of silence",
        when=_one_of_several,
    ),
    Documented(
        "a board's logic is without supply from now on",
        BrownOut,
        Reaction(Motion.CUT, begins_ms=TICK_MS),
        "its nodes are silent, which the host notices after 1 s, until `power-up`: then as below",
        when=lambda harm, _: harm.for_ms is None,
    ),
    Documented(
        "a board's logic browns out for a time, or its watchdog resets it",
        _RESET,
        Reaction(Motion.CUT, (), State.SWITCH_ON_DISABLED, TICK_MS),
        "its nodes announce themselves again and know no position; home them",
    ),
    Documented("a board without power gets it", PowerUp, GOES_ON),
)


# --- the wiring: Protect, switches and their wires, drivers' settings, their wires


def _closed(harm: StuckSwitch | SwitchWire, _moment: Moment) -> bool:
    """Return whether a limit switch sticks closed, or its broken wire looks as if it did."""
    closed = harm.closed if isinstance(harm, StuckSwitch) else harm.broken is Contact.NORMALLY_CLOSED
    return bool(closed) and harm.switch is not DigitalInput.HOME


def _closed_ahead(harm: StuckSwitch | SwitchWire, moment: Moment) -> bool:
    """Return whether it is so, and the axis moves towards this switch."""
    velocity = moment.axes[harm.axis].velocity
    return _closed(harm, moment) and (velocity > 0 if harm.switch is DigitalInput.POSITIVE_LIMIT else velocity < 0)


def _tripped_and_told(harm: ShortCircuit, moment: Moment) -> bool:
    """Return whether a short circuit makes current flow, and the board learns of it."""
    axis = moment.axes[harm.axis]
    return harm.shorted and axis.energised and axis.fault_input is DigitalInput.DRIVER_FAULT


_WIRING_ROWS: Final[tuple[Documented, ...]] = (
    Documented(
        "Protect of a driver low",
        DriverProtect,
        stops(ErrorCode.TEMPERATURE, motion=Motion.CUT),
        "this driver has switched itself off; the other axes stop by a ramp",
        when=lambda harm, _: harm.active,
    ),
    Documented("Protect of a driver free", DriverProtect, GOES_ON),
    Documented(
        "motor short-circuited, its driver is on and its fault output wired",
        ShortCircuit,
        replace(stops(ErrorCode.OUTPUT_STAGE, motion=Motion.CUT), others=(ErrorCode.CAN_OVERRUN,)),
        "the driver has switched itself off, and what ends that depends on it; the other axes stop by a ramp; where"
        " ENABLE ends it the input falls at once, and reports of both may be one too many for the node's queue",
        when=_tripped_and_told,
    ),
    Documented(
        "motor short-circuited, and nothing tells it",
        ShortCircuit,
        replace(UNKNOWABLE, codes=(ErrorCode.LIMIT_SWITCH, ErrorCode.OUTPUT_STAGE)),
        "the axis has no torque and the board cannot know; the verdict tells it; with a fault output that is wired it"
        " stops once the driver is on",
        when=lambda harm, _: harm.shorted,
    ),
    Documented("motor whole again", ShortCircuit, GOES_ON, "a latch of its driver stays"),
    Documented(
        "limit switch stuck closed, the axis moves towards it",
        StuckSwitch,
        stops(ErrorCode.LIMIT_SWITCH),
        when=_closed_ahead,
    ),
    Documented(
        "limit switch stuck closed, the axis rests or moves away",
        StuckSwitch,
        stops(ErrorCode.LIMIT_SWITCH, begins_ms=inf, certain=False),
        "once it moves towards the switch",
        when=_closed,
    ),
    Documented(
        "switch stuck open, or a home switch stuck closed",
        StuckSwitch,
        GOES_ON,
        "a planned motion stays between its limit switches; homing fails (EMCY 0xFF05)",
    ),
    Documented(
        "wire of a limit switch broken, its contact closed at rest, the axis moves towards it",
        SwitchWire,
        stops(ErrorCode.LIMIT_SWITCH),
        "as a switch that is stuck closed",
        when=_closed_ahead,
    ),
    Documented(
        "wire of a limit switch broken, its contact closed at rest, the axis rests or moves away",
        SwitchWire,
        stops(ErrorCode.LIMIT_SWITCH, begins_ms=inf, certain=False),
        "once it moves towards the switch",
        when=_closed,
    ),
    Documented(
        "wire of a switch broken, its contact open at rest",
        SwitchWire,
        GOES_ON,
        "the board notices it only when it needs the switch: fit contacts that are closed at rest",
    ),
    Documented(
        "a switch bounces",
        BouncingSwitch,
        GOES_ON,
        "a planned motion stays between its limit switches; homing takes the first edge that a tick shows",
    ),
    Documented(
        "a driver in another microstep mode",
        DriverMode,
        UNKNOWABLE,
        "its steps are longer or shorter: a limit switch may come; the verdict tells it, `doctor` finds it",
    ),
    Documented(
        "another capacitor at OSC",
        OscCapacitor,
        Reaction(Motion.GOES_ON, verified=False),
        "with a larger one the chip misses pulses; the verdict tells it",
    ),
    Documented(
        "wire to a driver broken, shorted or noisy",
        SetWire,
        UNKNOWABLE,
        "a board without feedback from its drivers cannot know; the verdict tells it; a limit switch may come",
        when=lambda harm, _: harm.condition is not WireState.WHOLE,
    ),
    Documented("wire to a driver whole", SetWire, GOES_ON),
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
_STRANGER: Final = StrangerSends | Babble


def _told_to_all(command: NmtCommand) -> Callable[[StrangerSends | Babble, Moment], bool]:
    """Return the condition that a stranger sends an NMT command to all nodes."""
    return lambda harm, _: harm.frame == Frame(COB_NMT, bytes((command, 0)))


def _only(cob_id: int, harm: BusFault) -> bool:
    """Return whether a fault of the bus concerns the frames of one identifier, and no others."""
    return set(harm.cob_ids) == {cob_id}


def _silent_host(harm: FrameLoss, _moment: Moment) -> bool:
    """Return whether the host's heartbeat is lost from now on, and nothing else."""
    return _only(COB_HEARTBEAT + HOST_NODE_ID, harm) and harm.rate == 1 and not harm.skip


def _deaf_board(harm: FrameLoss, moment: Moment) -> bool:
    """Return whether SYNC is lost for one of several boards."""
    return _only(COB_SYNC, harm) and harm.receiver is not None and moment.several_boards


_BUS_ROWS: Final[tuple[Documented, ...]] = (
    Documented(
        "a stranger stops all nodes (NMT)",
        _STRANGER,
        Reaction(Motion.RAMP, (), State.FAULT, TICK_MS, others=(ErrorCode.COMMUNICATION,)),
        "0x6007 acts; a stopped node sends no EMCY: 0x8100 comes when it is started again",
        when=_told_to_all(NmtCommand.STOP),
    ),
    Documented(
        "a stranger resets the communication of all nodes (NMT)",
        _STRANGER,
        stops(ErrorCode.COMMUNICATION),
        "0x6007 acts; the nodes announce themselves again",
        when=_told_to_all(NmtCommand.RESET_COMMUNICATION),
    ),
    Documented(
        "a stranger resets all nodes (NMT)",
        _STRANGER,
        Reaction(Motion.RAMP, (), State.SWITCH_ON_DISABLED, TICK_MS),
        "0x6007 acts; each node is silent until its axis stands, then starts as after power-up",
        when=_told_to_all(NmtCommand.RESET_NODE),
    ),
    Documented(
        "a stranger sends frames",
        _STRANGER,
        Reaction(Motion.GOES_ON, _OF_STRANGERS, certain=False),
        "unless it commands otherwise: a board obeys every station. Babble with a low identifier keeps the points away",
    ),
    Documented(
        "a board's controller leaves the bus",
        BusOff,
        replace(
            stops(ErrorCode.CAN_BUS_OFF_RECOVERED),
            others=(ErrorCode.CAN_ERROR_PASSIVE, ErrorCode.CAN_OVERRUN),
        ),
        "0x6007 and 0x1029 act at once; the EMCY comes when it is back, after 128 x 11 bits; one not acknowledged"
        " meanwhile is error passive; newer reports replace those that wait",
        when=lambda harm, _: harm.axis is not None,
    ),
    Documented(
        "the host's controller leaves the bus",
        BusOff,
        Reaction(Motion.GOES_ON, (ErrorCode.CAN_ERROR_PASSIVE, ErrorCode.CAN_OVERRUN), certain=False),
        "it is back after 128 x 11 bits, which the queues bridge",
    ),
    Documented(
        "the host has the bit rate of the boards",
        HostBitRate,
        GOES_ON,
        when=lambda harm, moment: harm.bitrate == moment.bitrate,
    ),
    Documented(
        "the host has another bit rate than the boards",
        HostBitRate,
        Reaction(Motion.RAMP, (), State.FAULT, HEARTBEAT_MS, certain=False, others=_OF_BAD_BUS),
        "the boards cannot send and leave the bus (0x6007), or miss the host's heartbeat, unless it has theirs again"
        " in time; their EMCYs come through afterwards",
    ),
    Documented(
        "frames come twice, or make their sender leave the bus",
        FrameDuplicate | SenderOff,
        stops(*_OF_BAD_BUS, begins_ms=inf, certain=False),
        "sequence numbers tell; a sender whose frames all come twice goes into bus-off",
    ),
    Documented(
        "heartbeat of the host lost",
        FrameLoss,
        stops(ErrorCode.HEARTBEAT_LOST, begins_ms=HEARTBEAT_MS, certain=False),
        "unless it comes again in time",
        when=_silent_host,
    ),
    Documented(
        "SYNC lost for one of several boards",
        FrameLoss,
        stops(*HOST_LOST, begins_ms=DEAF_BOARD_MS, certain=False),
        "the host notices after 1 s that not all axes start, stops those that did, and gives up",
        when=_deaf_board,
    ),
    Documented(
        "SYNC lost",
        FrameLoss,
        Reaction(Motion.NOT_BEGUN, (ErrorCode.HEARTBEAT_LOST,), State.FAULT, certain=False),
        "the host notices that no axis starts, and gives up",
        when=lambda harm, _: _only(COB_SYNC, harm),
    ),
    Documented(
        "frames lost",
        FrameLoss,
        stops(*RUN_DRY, ErrorCode.HEARTBEAT_LOST, begins_ms=inf, certain=False),
        "lost points are sent again; if too many are lost, the queues run dry",
    ),
    Documented(
        "frames disturbed",
        FrameCorruption,
        stops(*_OF_BAD_BUS, begins_ms=inf, certain=False),
        "CAN repeats them; if none comes through, it is as if they were lost",
    ),
    Documented(
        "frames delayed",
        FrameDelay,
        stops(*_OF_BAD_BUS, begins_ms=inf, certain=False),
        "the queues bridge it, up to the points that are in them; the host gives a start up that is a second late",
    ),
    Documented("bus repaired", BusRepair, GOES_ON),
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
    if isinstance(harm, AxisHarm):
        return [harm.axis]
    if isinstance(harm, MachineHarm) and harm.place is not None:
        return [each for each in axes if boards[each] == boards[harm.place]]
    return list(axes)
