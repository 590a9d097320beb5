"""The parts of an axis that its node, its drive and its modes of operation share."""

from typing import NamedTuple, Protocol

from steptwin.controller.motion.board_motion import BoardMotion
from steptwin.controller.node.axis_errors import AxisErrors
from steptwin.controller.node.measurements import BoardReadings
from steptwin.controller.node.pins import AxisPins
from steptwin.controller.node.position_reference import PositionReference
from steptwin.controller.node.soft_limits import SoftLimits
from steptwin.controller.node.sync_clock import SyncClock
from steptwin.controller.node.transmit_queue import TransmitQueue
from steptwin.protocol.cia402 import ErrorCode
from steptwin.protocol.dictionary import FlashPage, ObjectDictionary
from steptwin.protocol.heartbeat_consumer import HeartbeatConsumer
from steptwin.protocol.pdo import ProcessData


class Trip(Protocol):
    """Request the fault reaction of an axis, and of its group if the fault stops the group.

    The reaction begins after the caller has returned, so that faults of the same instant are handled together.
    """

    def __call__(self, axis: int, code: ErrorCode, detail: int = 0) -> None: ...


class BoardContext(NamedTuple):
    """Motion, measurements, clocks and CAN driver of the board, and the way to request a fault reaction."""

    motion: BoardMotion
    measurements: BoardReadings
    sync_clock: SyncClock
    transmit: TransmitQueue
    trip: Trip


class AxisContext:
    """One axis' dictionary, process data, errors, pins, limits and reference; the time of the call being served."""

    def __init__(self, axis: int, node_id: int, flash_page: FlashPage, board: BoardContext) -> None:
        self.axis = axis
        self.board = board
        self.motion = board.motion
        self.dictionary = ObjectDictionary(node_id, stored=flash_page)
        self.process_data = ProcessData(self.dictionary)
        self.heartbeats = HeartbeatConsumer(self.dictionary)
        self.errors = AxisErrors(self.dictionary, self.heartbeats, self.touch)
        self.pins = AxisPins()
        self.limits = SoftLimits(self.dictionary)
        self.reference = PositionReference(axis, board.motion, self.dictionary)
        self.dictionary.bind(board.measurements)
        self.dictionary.bind(board.motion, axis)
        self.now_us = 0
        """Time of the call being served."""
        self.touched = False
        """True once the call being served has changed anything that the node may have to send."""

    def touch(self) -> None:
        """Make the node look for frames to send when the call being served ends."""
        self.touched = True

    def changed(self, address: int) -> None:
        """Note that the value of an entry has changed: event-driven TPDOs report it."""
        self.touched = True
        self.process_data.changed(address)

    def trip(self, code: ErrorCode, detail: int = 0) -> None:
        """Request this axis' fault reaction (see `Trip`)."""
        self.board.trip(self.axis, code, detail)
