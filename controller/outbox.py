"""A node's way to the board's transmit queue: frames that find no place there are counted and reported."""

from typing import Final

from steptwin.controller.axis_errors import AxisErrors
from steptwin.controller.transmit_queue import Service, TransmitQueue
from steptwin.protocol import od
from steptwin.protocol.cia402 import ErrorCode, Overrun
from steptwin.protocol.dictionary import ObjectDictionary
from steptwin.protocol.frame import Frame

QUIET_US: Final = 1_000_000
"""Time without a loss after which the error ends; so a bus that is too busy now and then causes two EMCYs a second."""


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
        self._dictionary.count(od.FRAMES_LOST)
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
