"""Link in real time to a bus: a served board's socketcand port, or any interface of python-can.

The canopen library's network on it turns errors into BusErrors in one line, and no thread outlives it.
"""

import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any, Final

import can
import canopen
from can.broadcastmanager import ThreadBasedCyclicSendTask
from canopen.network import MessageListener, PeriodicMessageTask

from steptwin.host.client.links import address_text
from steptwin.host.client.links.socketcand_bus import SocketcandBus
from steptwin.host.common import listening as socketcand
from steptwin.host.common.bad_input import unknown
from steptwin.host.common.errors import BusError, StepTwinError

# --- buses of python-can


def check_interface(what: str, name: str) -> None:
    """Raise InputError if python-can has no interface of this name; the message calls the name `what`."""
    if name not in can.VALID_INTERFACES:
        raise unknown(what, name, sorted(can.VALID_INTERFACES))


def open_python_can_bus(title: str, interface: str, **arguments: Any) -> can.BusABC:
    """Open a bus, with defaults for arguments that are None; raise BusError, headed by `title`, if it fails."""
    given = {name: value for name, value in arguments.items() if value is not None}
    with bus_errors(title):
        return can.Bus(interface=interface, **given)


@contextmanager
def bus_errors(title: str) -> Iterator[None]:
    """Turn every error of an interface into a BusError, headed by `title`."""
    try:
        yield
    except StepTwinError:
        raise
    except Exception as error:  # each driver raises its own: kvaser's a NameError if canlib is missing
        raise BusError(f"{title}: {reason(error)}") from error


def reason(error: BaseException) -> str:
    """Return the first line of an interface's error."""
    text = str(getattr(error, "strerror", None) or error) or type(error).__name__
    return text.splitlines()[0]


@dataclass(frozen=True, slots=True)
class Connection:
    """The choice of a bus: an interface of python-can, and for socketcand the server's host and TCP port."""

    interface: str
    channel: str | None = None
    bitrate: int | None = None
    """In bit/s, for interfaces that set it; None, here and for the channel, takes the interface's default."""
    host: str | None = None
    port: int | None = None

    @property
    def title(self) -> str:
        """The bus as messages name it."""
        if self.host is not None:
            assert self.port is not None
            return address_text(self.host, self.port)
        return f"{self.interface} {self.channel}" if self.channel else self.interface


def open_bus(connection: Connection) -> can.BusABC:
    """Open the bus; raise BusError, with the interface's reason, if it cannot be opened."""
    if connection.host is not None:
        assert connection.port is not None
        with bus_errors(connection.title):
            try:
                return SocketcandBus(connection.channel or socketcand.CHANNEL, connection.host, connection.port)
            except ConnectionRefusedError as error:
                raise BusError(f"{connection.title}: {error.strerror}: is `steptwin serve` running?").plainly(
                    f"{connection.title}: {error.strerror}: is the machine's board served?"
                ) from error
    return open_python_can_bus(
        connection.title, connection.interface, channel=connection.channel, bitrate=connection.bitrate
    )


# --- the library's network

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


# --- the link

_USUAL_LATENESS_S: Final = 0.01
"""Lateness at the end of a sleep that is time like any other."""


class BusLink:
    """A Link to a real or a served bus; a context manager that closes the bus at its end.

    While this program is held up, time limits stand still: what came in meanwhile has not been looked at.
    """

    def __init__(self, bus: can.BusABC, title: str, network: Callable[[], BusNetwork] | None = None) -> None:
        """Connect to a bus, named `title` in messages; `network` makes another network on it than the usual one."""
        self.network: canopen.Network = network() if network else BusNetwork(bus, title)
        self.network.connect()
        self.held_up_s: float = 0.0
        self._all_held_up_s = 0.0

    def now_s(self) -> float:
        """Return the seconds on a clock that is never set, without those of being held up."""
        return time.perf_counter() - self._all_held_up_s

    def wait(self, dt_s: float) -> None:
        """Sleep; raise BusError if nothing can be received any more."""
        due_s = time.perf_counter() + dt_s
        time.sleep(dt_s)
        late_s = time.perf_counter() - due_s
        if late_s > _USUAL_LATENESS_S:
            self._all_held_up_s += late_s
            self.held_up_s = max(self.held_up_s, late_s)
        self.network.check()

    def __enter__(self) -> "BusLink":
        return self

    def __exit__(self, kind: object, error: object, trace: object) -> None:
        try:
            self.network.disconnect()
        except BusError:  # an error that is raised already says why
            if error is None:
                raise
