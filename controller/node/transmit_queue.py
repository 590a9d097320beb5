"""The CAN driver's transmit queue: the places where frames wait until one of the controller's mailboxes is free.

Services go ahead of process data. A service's frames wait in line, a few of each node; one that finds no place is lost.
A PDO has one place: a newer one takes the place of the one that waits, because process data that is late has no worth
(CiA 301, section 7.5.2.7: synchronous TPDOs that miss the synchronous window may be discarded). So the queue holds a
fixed number of frames, whatever the nodes produce and however busy the bus is.
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
    """The services whose frames go ahead of process data."""

    EMCY = "emcy"
    SDO = "sdo"
    NMT = "nmt"
    """Boot-up message and heartbeat."""
    LSS = "lss"


PLACES: Final = {Service.EMCY: 8, Service.SDO: -(-TEXT_BYTES_MAX // SEGMENT_BYTES), Service.NMT: 2, Service.LSS: 1}
"""Frames of each service that may wait, of each node.

The segments of the longest entry are the longest block of an SDO upload. A boot-up message and a heartbeat may wait; a
further heartbeat says nothing new. An LSS master waits for each answer.
"""
BURST_FRAMES_MAX: Final = 32
"""Process data frames in a row before a pause, as many as eight nodes have TPDOs.

Services have higher identifiers than most process data, so a board that always has process data to send would keep
them off the bus: its own in their mailboxes, and other stations' altogether.
"""
PAUSE_COUNTS: Final = 100 * COUNTS_PER_US
"""Length of the pause, from the end of the last frame: enough for another station to begin at 125 kbit/s."""
PAUSE_COUNTS_MAX: Final = 5 * COUNTS_PER_MS
"""Longest pause: process data then go on even if a mailbox is not free: then other stations win every arbitration."""


class _Waiting(NamedTuple):
    node: int
    service: Service
    frame: Frame


class TransmitQueue:
    """The frames of all nodes of a board that wait for a mailbox."""

    def __init__(self) -> None:
        self.services: list[_Waiting] = []
        """The oldest first."""
        self.process_data: dict[tuple[int, int], Frame] = {}
        """By node and number of the PDO, in the order that the PDOs began to wait."""
        self.due_counts: int | None = None
        """Instant when `take` ends a pause of the process data, if a mailbox is free; None if there is no pause."""
        self._in_a_row = 0
        """Process data frames taken since the last pause."""
        self._last_counts = 0
        """Instant when the last of them was taken."""

    def __len__(self) -> int:
        return len(self.services) + len(self.process_data)

    def room(self, node: int, service: Service) -> bool:
        """Return whether a further frame of a node's service has a place."""
        waiting = sum(item.node == node and item.service is service for item in self.services)
        return waiting < PLACES[service]

    def put(self, node: int, service: Service, frame: Frame) -> bool:
        """Let a service's frame wait; return False if it is lost because its places are taken."""
        if self.services and not self.room(node, service):
            return False
        self.services.append(_Waiting(node, service, frame))
        return True

    def put_process_data(self, node: int, number: int, frame: Frame) -> bool:
        """Let a PDO wait; return False if an older frame of the same PDO is lost, whose place it takes."""
        waiting = self.process_data
        place = node, number
        fresh = place not in waiting
        waiting[place] = frame
        return fresh

    def drop(self, node: int) -> None:
        """Forget what waits for a node, whose communication is reset: its next frame is the boot-up message."""
        self.services = [item for item in self.services if item.node != node]
        self.process_data = {place: frame for place, frame in self.process_data.items() if place[0] != node}
        if not self.process_data:
            self.due_counts = None  # nothing waits for the end of the pause

    def waits(self, node: int) -> bool:
        """Return whether any frame of a node waits."""
        return any(item.node == node for item in self.services) or any(node == owner for owner, _ in self.process_data)

    def take(self, mailboxes: Collection[Frame], idle_since_counts: int, now_counts: int) -> Frame | None:
        """Return the frame to put into a free mailbox now; None if all must wait.

        Of two frames with equal identifiers bxCAN sends the one in the lower mailbox first, which may be the newer. So
        a frame waits until no mailbox has its identifier (RM0008, section 24.7.1).

        Args:
            mailboxes: the frames in the other mailboxes.
            idle_since_counts: if there are none, the instant when the last one was sent.
            now_counts: the present instant.
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
        """Return whether process data must wait, after a burst; `due_counts` is the end of the pause."""
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
"""Time without a loss until the error ends; so a bus that is too busy now and then causes two EMCYs a second."""


class Outbox:
    """Puts one node's frames into the transmit queue.

    The first loss is an error, "CAN overrun", of this node. It ends when no frame has been lost for a second and none
    of the node waits.
    """

    def __init__(self, node: int, queue: TransmitQueue, dictionary: ObjectDictionary, errors: AxisErrors) -> None:
        self.due_us: int | None = None
        """Time of the next call of `poll`; None while nothing has been lost."""
        self._node = node
        self._queue = queue
        self._dictionary = dictionary
        self._errors = errors

    def reset(self) -> None:
        """Forget what waits, and a loss; the caller has resolved the communication errors."""
        self._queue.drop(self._node)
        self.due_us = None

    def send(self, service: Service, frame: Frame, now_us: int) -> None:
        """Send a service's frame as soon as a mailbox is free."""
        if not self._queue.put(self._node, service, frame):
            self._lost(now_us)

    def send_process_data(self, number: int, frame: Frame, now_us: int) -> None:
        """Send a PDO as soon as a mailbox is free, in place of an older one that still waits."""
        if not self._queue.put_process_data(self._node, number, frame):
            self._lost(now_us)

    def has_room(self, service: Service) -> bool:
        """Return whether a frame of a service would find a place."""
        return self._queue.room(self._node, service)

    def _lost(self, now_us: int) -> None:
        self._dictionary.cell(od.FRAMES_LOST).count()
        self.due_us = now_us + QUIET_US
        self._errors.report(ErrorCode.CAN_OVERRUN, Overrun.TRANSMIT_QUEUE)

    def poll(self, now_us: int) -> None:
        """End the error if it is due to end."""
        if self.due_us is None or now_us < self.due_us:
            return
        if self._queue.waits(self._node):
            self.due_us = now_us + QUIET_US
        else:
            self.due_us = None
            self._errors.resolved(ErrorCode.CAN_OVERRUN, Overrun.TRANSMIT_QUEUE)
