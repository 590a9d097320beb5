"""Documented reactions to harms to the bus: strangers, frames that are lost, disturbed, late or twice, bus-off."""

from collections.abc import Callable
from dataclasses import replace
from math import inf
from typing import Final

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
from steptwin.emulator.faults.harm import Harm
from steptwin.host.faults.reaction import (
    DEAF_BOARD_MS,
    GOES_ON,
    HEARTBEAT_MS,
    HOST_LOST,
    RUN_DRY,
    TICK_MS,
    Documented,
    Motion,
    Reaction,
    stops,
)
from steptwin.host.faults.target import Moment
from steptwin.protocol.cia402 import ErrorCode, State
from steptwin.protocol.frame import COB_HEARTBEAT, COB_ID_MASK, COB_NMT, COB_SYNC, HOST_NODE_ID, Frame
from steptwin.protocol.nmt import NmtCommand

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


ROWS: Final[tuple[Documented, ...]] = (
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
