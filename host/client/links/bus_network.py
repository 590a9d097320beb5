"""The canopen library's network on a bus in real time: errors become BusErrors, and no thread outlives the network."""

import threading
import time
from typing import Any, Final

import can
import canopen
from can.broadcastmanager import ThreadBasedCyclicSendTask
from canopen.network import MessageListener, PeriodicMessageTask

from steptwin.host.client.links.can_bus import bus_errors

_RECEIVE_CYCLE_S: Final = 0.05
"""Time until the receiving thread notices that it shall end."""
_ENDING_S: Final = 2.0
"""Longest time that disconnecting waits for a thread; only a driver that holds it up, or a busy computer, makes it."""


class _EndOfReceiving(MessageListener):
    """End the receiving thread without a traceback; `BusNetwork.check` raises its error instead."""

    def on_message_received(self, msg: can.Message) -> None:
        """Ignore the frame; the network's own listener takes it."""

    def on_error(self, _exc: Exception) -> None:
        """Pause before the notifier, which has stored the error, tries again."""
        time.sleep(_RECEIVE_CYCLE_S)


class _LastingTask(PeriodicMessageTask):
    """A periodic frame whose thread, where the interface needs one, tries again after an error.

    Without this the thread would end with a traceback; the error shows in every other use of the bus.
    """

    _task: Any

    def _start(self) -> None:
        self._task = self.bus.send_periodic(self.msg, self.period, autostart=False)
        if isinstance(self._task, ThreadBasedCyclicSendTask):
            self._task.on_error = lambda _: True
        self._task.start()

    @property
    def thread(self) -> threading.Thread | None:
        """The thread that sends the frames; None if the interface sends them by itself."""
        return self._task.thread if isinstance(self._task, ThreadBasedCyclicSendTask) else None


class BusNetwork(canopen.Network):
    """The canopen library's network, which raises BusError instead of python-can's errors."""

    NOTIFIER_CYCLE = _RECEIVE_CYCLE_S
    NOTIFIER_SHUTDOWN_TIMEOUT = _ENDING_S

    def __init__(self, bus: can.BusABC, title: str) -> None:
        super().__init__(bus)
        self.listeners.append(_EndOfReceiving(self))
        self._title = title
        self._senders: list[threading.Thread] = []

    def send_message(self, can_id: int, data: bytes, remote: bool = False) -> None:
        """Send a frame; raise BusError if the interface does not take it."""
        with bus_errors(self._title):
            super().send_message(can_id, data, remote)

    def send_periodic(self, can_id: int, data: bytes, period: float, remote: bool = False) -> PeriodicMessageTask:
        """Send a frame every `period` seconds until the task that is returned is stopped."""
        task = _LastingTask(can_id, data, period, self.bus, remote)
        self._senders = [thread for thread in (*self._senders, task.thread) if thread is not None and thread.is_alive()]
        return task

    def check(self) -> None:
        """Raise BusError if the receiving thread has ended."""
        with bus_errors(self._title):
            super().check()

    def disconnect(self) -> None:
        """Close the bus and wait for the ends of its threads.

        Raises:
            BusError: the bus cannot be closed, or the receiving thread has ended before.
        """
        try:
            with bus_errors(self._title):
                super().disconnect()
        finally:
            for thread in self._senders:
                thread.join(_ENDING_S)
