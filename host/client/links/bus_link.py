"""Link in real time to a bus: a served board's socketcand port, or any interface of python-can.

Its network of the canopen library converts errors to BusErrors of one line, and ends all threads when it closes.
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
    """Raise InputError if python-can has no interface of this name; `what` describes the name in the message."""
    if name not in can.VALID_INTERFACES:
        raise unknown(what, name, sorted(can.VALID_INTERFACES))


def open_python_can_bus(title: str, interface: str, **arguments: Any) -> can.BusABC:
    """Open a bus; arguments that are None have defaults; raise BusError, beginning with `title`, if it fails."""
    given = {name: value for name, value in arguments.items() if value is not None}
    with bus_errors(title):
        return can.Bus(interface=interface, **given)


@contextmanager
def bus_errors(title: str) -> Iterator[None]:
    """Convert every error of an interface to a BusError that begins with `title`."""
    try:
        yield
    except StepTwinError:
        raise
    except Exception as error:  # each driver raises its own: kvaser's a NameError if canlib is missing
        raise BusError(f"{title}: {reason(error)}") from error


def reason(error: BaseException) -> str:
    """Return the first line of an interface's error message."""
    text = str(getattr(error, "strerror", None) or error) or type(error).__name__
    return text.splitlines()[0]


@dataclass(frozen=True, slots=True)
class Connection:
    """Selection of a bus: an interface of python-can, and for socketcand the server's host and TCP port."""

    interface: str
    channel: str | None = None
    bitrate: int | None = None
    """Bit rate in bit/s for interfaces that set it; None selects the interface's default, also for `channel`."""
    host: str | None = None
    port: int | None = None

    @property
    def title(self) -> str:
        """Name of the bus in messages."""
        if self.host is not None:
            assert self.port is not None
            return address_text(self.host, self.port)
        return f"{self.interface} {self.channel}" if self.channel else self.interface


def open_bus(connection: Connection) -> can.BusABC:
    """Open the bus; raise BusError with the interface's reason if that fails."""
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
"""Time until the receiving thread notices that it must end."""
_ENDING_S: Final = 2.0
"""Longest wait for a thread's end at a disconnect; only a blocking driver or a busy computer needs it."""


class _EndOfReceiving(MessageListener):
    """Ends the receiving thread without a traceback; `BusNetwork.check` raises its error instead."""

    def on_message_received(self, msg: can.Message) -> None:
        """Ignore the frame; the network's own listener handles it."""

    def on_error(self, _exc: Exception) -> None:
        """Pause before the notifier tries again; it has stored the error."""
        time.sleep(_RECEIVE_CYCLE_S)


class _LastingTask(PeriodicMessageTask):
    """A periodic frame whose thread, if the interface needs one, tries again after an error.

    Otherwise the thread would end with a traceback. Every other use of the bus reports the error.
    """

    _task: Any

    def _start(self) -> None:
        self._task = self.bus.send_periodic(self.msg, self.period, autostart=False)
        if isinstance(self._task, ThreadBasedCyclicSendTask):
            self._task.on_error = lambda _: True
        self._task.start()

    @property
    def thread(self) -> threading.Thread | None:
        """Thread that sends the frames; None if the interface sends them by itself."""
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
        """Send a frame; raise BusError if the interface does not accept it."""
        with bus_errors(self._title):
            super().send_message(can_id, data, remote)

    def send_periodic(self, can_id: int, data: bytes, period: float, remote: bool = False) -> PeriodicMessageTask:
        """Send a frame every `period` seconds until the returned task is stopped."""
        task = _LastingTask(can_id, data, period, self.bus, remote)
        self._senders = [thread for thread in (*self._senders, task.thread) if thread is not None and thread.is_alive()]
        return task

    def check(self) -> None:
        """Raise BusError if the receiving thread has ended."""
        with bus_errors(self._title):
            super().check()

    def disconnect(self) -> None:
        """Close the bus and wait until its threads have ended.

        Raises:
            BusError: the bus cannot be closed, or the receiving thread had ended before.
        """
        try:
            with bus_errors(self._title):
                super().disconnect()
        finally:
            for thread in self._senders:
                thread.join(_ENDING_S)


# --- the link

_USUAL_LATENESS_S: Final = 0.01
"""Usual lateness of a sleep; a longer one is a delay of this program."""


class BusLink:
    """A Link to a real or served bus; a context manager that closes the bus at its end.

    A delay of this program does not count for time limits, because it could not read the frames of this time.
    """

    def __init__(self, bus: can.BusABC, title: str, network: Callable[[], BusNetwork] | None = None) -> None:
        """Connect to a bus, named `title` in messages; `network` creates another network than the usual one."""
        self.network: canopen.Network = network() if network else BusNetwork(bus, title)
        self.network.connect()
        self.held_up_s: float = 0.0
        self._all_held_up_s = 0.0

    def now_s(self) -> float:
        """Return the seconds on a monotonic clock, without delays of this program."""
        return time.perf_counter() - self._all_held_up_s

    def wait(self, dt_s: float) -> None:
        """Sleep; raise BusError if the receiving thread has ended."""
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
