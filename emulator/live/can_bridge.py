"""Connect a live board to a bus of python-can: virtual, SocketCAN, socketcand, an adapter.

For the simulated bus, the real one is the host's interface. A frame passes both buses. So it arrives one frame length
later than on a single bus, and so does the answer.
"""

import threading
from collections import deque
from typing import Final, NamedTuple

import can

from steptwin.emulator.live.live_loop import LiveLoop
from steptwin.emulator.live.live_simulation import LiveSimulation, Sender
from steptwin.protocol.frame import COB_ID_MASK, REMOTE, Frame

WINDOW_FRAMES: Final = 16
"""Highest number of frames that wait for the simulated bus; at equal bit rates rarely more than one waits."""
INBOX_MAX: Final = 4096
"""Highest number of received frames in the inbox; further frames are lost, as in a full CAN controller."""
_READ_S: Final = 0.2
"""Interval at which the reading thread checks whether the bridge is closed."""


class _Received(NamedTuple):
    frame: Frame
    now_ns: int


class CanBridge:
    """Passes frames between a python-can bus and a live simulation."""

    def __init__(self, loop: LiveLoop, bus: can.BusABC) -> None:
        self.foreign_frames: int = 0
        """Number of frames dropped because they are not classical data frames with an 11-bit identifier."""
        self.overruns: int = 0
        """Number of frames lost because the inbox was full."""
        self.unsent_frames: int = 0
        """Number of frames that the bus did not accept."""
        self.failure: str | None = None
        """Error that has made the bus unusable; None while it works."""
        self._loop = loop
        self._live: LiveSimulation = loop.live
        self._bus = bus
        self._inbox: deque[_Received] = deque()
        self._waiting_frames = 0
        self._closing = False
        self._live.view = self._show
        loop.hand_on = self._pass_on
        self._reader = threading.Thread(target=self._read, name="can bridge", daemon=True)
        self._reader.start()

    def close(self) -> None:
        """Leave the bus."""
        if self._closing:
            return
        self._closing = True
        self._reader.join()
        self._bus.shutdown()

    # --- in, with a thread, because `select` cannot wait for most interfaces

    def _read(self) -> None:
        while not self._closing:
            try:
                message = self._bus.recv(_READ_S)
            except Exception as error:  # each driver raises its own
                self._fail(error)
                return
            if message is not None:
                self._take(message)

    def _take(self, message: can.Message) -> None:
        classical = not (message.is_extended_id or message.is_error_frame or message.is_fd)
        if not classical or message.arbitration_id > COB_ID_MASK:
            self.foreign_frames += 1
        elif len(self._inbox) >= INBOX_MAX:
            self.overruns += 1
        else:
            remote = REMOTE if message.is_remote_frame else 0
            frame = Frame(message.arbitration_id | remote, bytes(message.data))
            self._inbox.append(_Received(frame, self._loop.now_ns()))
            self._loop.wake()

    def _pass_on(self) -> None:
        while self._inbox and self._waiting_frames < WINDOW_FRAMES:
            self._waiting_frames += 1
            received = self._inbox.popleft()
            self._live.send(received.frame, self, received.now_ns)

    def _fail(self, error: Exception) -> None:
        self.failure = " ".join(str(error).split()) or type(error).__name__
        self._loop.stop()

    # --- out

    def _show(self, frame: Frame, _counts: int, sender: Sender | None) -> None:
        if sender is not None:
            self._waiting_frames -= 1
            return
        remote = bool(frame.cob_id & REMOTE)
        cob_id = frame.cob_id & COB_ID_MASK
        message = can.Message(arbitration_id=cob_id, data=frame.data, is_extended_id=False, is_remote_frame=remote)
        try:
            self._bus.send(message)
        except can.CanError:
            self.unsent_frames += 1
        except Exception as error:
            self._fail(error)
