"""The CAN driver's transmit queue: frames wait here until a mailbox of the controller is free.

Services have priority over process data. Each node may have a few waiting frames of each service; further ones are
lost. Each PDO has one place: a newer frame replaces the waiting one, because late process data is useless (CiA 301,
section 7.5.2.7: synchronous TPDOs that miss the synchronous window may be discarded). So the length of the queue is
bounded, even on a busy bus.
"""

from collections.abc import Collection
from enum import Enum
from typing import Final, NamedTuple

from steptwin.controller.node.axis_errors import AxisErrors
from steptwin.protocol import od
from steptwin.protocol.cia402 import ErrorCode, Overrun
from steptwin.protocol.dictionary import TEXT_BYTES_MAX, ObjectDictionary
from steptwin.protocol.frame import Frame
from steptwin.protocol.sdo_server import SEGMENT_BYTES
from steptwin.protocol.timer import COUNTS_PER_MS, COUNTS_PER_US


class Service(Enum):
    """Services with priority over process data."""

    EMCY = "emcy"
    SDO = "sdo"
    NMT = "nmt"
    """Boot-up message and heartbeat."""
    LSS = "lss"


PLACES: Final = {Service.EMCY: 8, Service.SDO: -(-TEXT_BYTES_MAX // SEGMENT_BYTES), Service.NMT: 2, Service.LSS: 1}
"""Number of places of each service, for each node.

SDO: the segments of the longest entry, which are the longest block of an upload. NMT: a boot-up message and a
heartbeat; a second heartbeat would carry no new information. LSS: a master waits for each answer.
"""
BURST_FRAMES_MAX: Final = 32
"""Longest burst of process data before a pause: all TPDOs of eight nodes.

Services have higher identifiers than most process data. Without pauses, a board that always has process data to send
would keep its own services in their mailboxes and those of other stations off the bus.
"""
PAUSE_COUNTS: Final = 100 * COUNTS_PER_US
"""Length of the pause after the last frame: at 125 kbit/s another station has time to begin a frame."""
PAUSE_COUNTS_MAX: Final = 5 * COUNTS_PER_MS
"""Longest pause, even if mailboxes are still occupied because other stations win every arbitration."""


class _Waiting(NamedTuple):
    node: int
    service: Service
    frame: Frame


class TransmitQueue:
    """Frames of all nodes of a board that wait for a mailbox."""

    def __init__(self) -> None:
        self.services: list[_Waiting] = []
        """Frames of services, the oldest first."""
        self.process_data: dict[tuple[int, int], Frame] = {}
        """Frames of PDOs by node and PDO number, the one that waits longest first."""
        self.due_counts: int | None = None
        """End of the present pause of process data; None if there is no pause."""
        self._in_a_row = 0
        """Process data frames taken since the last pause."""
        self._last_counts = 0
        """Instant when the last process data frame was taken."""

    def __len__(self) -> int:
        return len(self.services) + len(self.process_data)

    def room(self, node: int, service: Service) -> bool:
        """Return whether there is a place for another frame of a node's service."""
        waiting = sum(item.node == node and item.service is service for item in self.services)
        return waiting < PLACES[service]

    def put(self, node: int, service: Service, frame: Frame) -> bool:
        """Queue a service's frame; return False if it is lost because all its places are occupied."""
        if self.services and not self.room(node, service):
            return False
        self.services.append(_Waiting(node, service, frame))
        return True

    def put_process_data(self, node: int, number: int, frame: Frame) -> bool:
        """Queue a PDO; return False if it replaces an older frame of the same PDO, which is lost."""
        waiting = self.process_data
        place = node, number
        fresh = place not in waiting
        waiting[place] = frame
        return fresh

    def drop(self, node: int) -> None:
        """Drop a node's waiting frames after a reset of communication; its next frame is the boot-up message."""
        self.services = [item for item in self.services if item.node != node]
        self.process_data = {place: frame for place, frame in self.process_data.items() if place[0] != node}
        if not self.process_data:
            self.due_counts = None  # nothing waits for the end of the pause

    def waits(self, node: int) -> bool:
        """Return whether a frame of a node waits."""
        return any(item.node == node for item in self.services) or any(node == owner for owner, _ in self.process_data)

    def take(self, mailboxes: Collection[Frame], idle_since_counts: int, now_counts: int) -> Frame | None:
        """Return the frame to put into a free mailbox now; None if all must wait.

        If two mailboxes have the same identifier, bxCAN sends the lower mailbox first, which may hold the newer frame
        (RM0008, section 24.7.1). So a frame waits until no mailbox has its identifier.

        Args:
            mailboxes: frames in the other mailboxes.
            idle_since_counts: instant when the last mailbox became empty, if all are empty.
            now_counts: present instant.
        """
        if not mailboxes and now_counts - idle_since_counts >= PAUSE_COUNTS:
            self._in_a_row = 0
        occupied = {frame.cob_id for frame in mailboxes}
        for i, item in enumerate(self.services):
            if item.frame.cob_id not in occupied:
                del self.services[i]
                return item.frame
        if self.process_data and not self._pauses(None if mailboxes else idle_since_counts, now_counts):
            for place, frame in self.process_data.items():
                if frame.cob_id not in occupied:
                    del self.process_data[place]
                    self._in_a_row += 1
                    self._last_counts = now_counts
                    return frame
        return None

    def _pauses(self, idle_since_counts: int | None, now_counts: int) -> bool:
        """Return whether process data must pause after a burst; set `due_counts` to the end of the pause."""
        self.due_counts = None
        if self._in_a_row < BURST_FRAMES_MAX:
            return False
        end_counts = self._last_counts + PAUSE_COUNTS_MAX
        if idle_since_counts is not None:
            end_counts = min(end_counts, idle_since_counts + PAUSE_COUNTS)
        if end_counts <= now_counts:
            self._in_a_row = 0
            return False
        self.due_counts = end_counts
        return True


QUIET_US: Final = 1_000_000
"""Time without a loss after which the error ends: repeated losses cause at most two EMCYs per second."""


class Outbox:
    """Puts one node's frames into the transmit queue.

    A lost frame is an error "CAN overrun" of this node. The error ends when no frame has been lost for a second and no
    frame of the node waits.
    """

    def __init__(self, node: int, queue: TransmitQueue, dictionary: ObjectDictionary, errors: AxisErrors) -> None:
        self.due_us: int | None = None
        """Time of the next call of `poll`; None if no loss is active."""
        self._node = node
        self._queue = queue
        self._dictionary = dictionary
        self._errors = errors

    def reset(self) -> None:
        """Drop the waiting frames and forget a loss; the caller has already resolved the communication errors."""
        self._queue.drop(self._node)
        self.due_us = None

    def send(self, service: Service, frame: Frame, now_us: int) -> None:
        """Send a service's frame as soon as a mailbox is free."""
        if not self._queue.put(self._node, service, frame):
            self._lost(now_us)

    def send_process_data(self, number: int, frame: Frame, now_us: int) -> None:
        """Send a PDO as soon as a mailbox is free; it replaces an older frame that still waits."""
        if not self._queue.put_process_data(self._node, number, frame):
            self._lost(now_us)

    def has_room(self, service: Service) -> bool:
        """Return whether there is a place for another frame of a service."""
        return self._queue.room(self._node, service)

    def _lost(self, now_us: int) -> None:
        self._dictionary.cell(od.FRAMES_LOST).count()
        self.due_us = now_us + QUIET_US
        self._errors.report(ErrorCode.CAN_OVERRUN, Overrun.TRANSMIT_QUEUE)

    def poll(self, now_us: int) -> None:
        """End the error "CAN overrun" if that is due."""
        if self.due_us is None or now_us < self.due_us:
            return
        if self._queue.waits(self._node):
            self.due_us = now_us + QUIET_US
        else:
            self.due_us = None
            self._errors.resolved(ErrorCode.CAN_OVERRUN, Overrun.TRANSMIT_QUEUE)
