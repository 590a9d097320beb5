"""The parts of a board that all its axes share."""

from typing import NamedTuple, Protocol

from steptwin.controller.measurements import Measurements, Monitor, ShaftReader
from steptwin.controller.motion import Motion
from steptwin.controller.sync_clock import SyncClock
from steptwin.controller.transmit_queue import TransmitQueue
from steptwin.protocol.cia402 import ErrorCode


class Trip(Protocol):
    """Request the fault reaction of an axis, and of its group if the fault stops the group.

    The reaction begins after the caller has returned, so that faults of the same instant are handled together.
    """

    def __call__(self, axis: int, code: ErrorCode, detail: int = 0) -> None: ...


class BoardContext(NamedTuple):
    """Motion, measurements, clocks and CAN driver of the board, and the way to request a fault reaction."""

    motion: Motion
    measurements: Measurements
    monitor: Monitor
    shaft: ShaftReader
    sync_clock: SyncClock
    transmit: TransmitQueue
    trip: Trip
