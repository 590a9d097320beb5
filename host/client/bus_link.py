"""A link in real time to any bus that python-can knows, a served board's socketcand port among them."""

import socket
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from types import TracebackType
from typing import Final

import can
import canopen
from can.interfaces.socketcand import SocketCanDaemonBus
from canopen.network import MessageListener

from steptwin.host.client.can_bus import open_python_can_bus, reason
from steptwin.host.common import socketcand
from steptwin.host.common.errors import BusError

_CONNECT_TIMEOUT_S: Final = 2.0
_RECEIVE_CYCLE_S: Final = 0.05
"""How long taking leave waits for the receiving thread, at most."""
_EMPTY_READS_MAX: Final = 1000
"""So many empty reads one after the other without waiting are no commands cut in pieces: the server is gone."""
_AT_ONCE_S: Final = 0.001


@dataclass(frozen=True, slots=True)
class Connection:
    """Which bus.

    Attributes:
        interface: as python-can calls it.
        channel: of the interface; None: its default.
        bitrate: in bit/s, for interfaces that set it.
        host: of a socketcand server.
        port: of a socketcand server.
    """

    interface: str
    channel: str | None = None
    bitrate: int | None = None
    host: str | None = None
    port: int | None = None

    @property
    def title(self) -> str:
        """Where that is, for people."""
        if self.host is not None:
            return f"{self.host}:{self.port}"
        return f"{self.interface} {self.channel}" if self.channel else self.interface


def open_bus(connection: Connection) -> can.BusABC:
    """Open it; BusError if that fails, whatever the interface has to say."""
    if connection.host is not None:
        with _bus_errors(connection.title):
            assert connection.port is not None
            # python-can tries for ten seconds, without a pause, before it says that nobody is there
            socket.create_connection((connection.host, connection.port), _CONNECT_TIMEOUT_S).close()
            return _SocketcandBus(connection.channel or socketcand.CHANNEL, connection.host, connection.port)
    return open_python_can_bus(
        connection.title, connection.interface, channel=connection.channel, bitrate=connection.bitrate
    )


class _SocketcandBus(SocketCanDaemonBus):
    """python-can's, which takes a connection that the server has ended for one on which there is nothing to read."""

    def __init__(self, channel: str, host: str, port: int) -> None:
        self._empty_reads = 0
        super().__init__(channel, host, port, tcp_tune=True)  # type: ignore[no-untyped-call]

    def _recv_internal(self, timeout: float | None) -> tuple[can.Message | None, bool]:
        begun_s = time.monotonic()
        received: tuple[can.Message | None, bool] = super()._recv_internal(timeout)  # type: ignore[no-untyped-call]
        at_once = time.monotonic() - begun_s < _AT_ONCE_S
        waits = timeout is None or timeout > _AT_ONCE_S
        self._empty_reads = self._empty_reads + 1 if received[0] is None and waits and at_once else 0
        if self._empty_reads > _EMPTY_READS_MAX:
            raise can.CanOperationError("the server has closed the connection")
        return received


class _EndOfReceiving(MessageListener):
    """Lets the receiving thread end without a traceback: `BusNetwork.check` says why it did."""

    def on_message_received(self, msg: can.Message) -> None:
        """Frames are the network's matter."""

    def on_error(self, _exc: Exception) -> None:
        """The notifier has kept it, and tries again: not without a pause."""
        time.sleep(_RECEIVE_CYCLE_S)


class BusNetwork(canopen.Network):
    """The canopen library's network; its errors are the command line's."""

    NOTIFIER_CYCLE = _RECEIVE_CYCLE_S

    def __init__(self, bus: can.BusABC, title: str) -> None:
        super().__init__(bus)
        self.listeners.append(_EndOfReceiving(self))
        self._title = title

    def send_message(self, can_id: int, data: bytes, remote: bool = False) -> None:
        """Send a frame; BusError if the interface does not take it."""
        with _bus_errors(self._title):
            super().send_message(can_id, data, remote)

    def check(self) -> None:
        """Raise BusError if receiving has come to an end."""
        with _bus_errors(self._title):
            super().check()


class BusLink:
    """A connection to a real or a served bus; fulfils Link. A context manager: leaving it closes the bus."""

    def __init__(self, bus: can.BusABC, title: str) -> None:
        self.network: canopen.Network = BusNetwork(bus, title)
        self.network.connect()

    def now_s(self) -> float:
        """Seconds on a clock that nobody sets."""
        return time.monotonic()

    def wait(self, dt_s: float) -> None:
        """Sleep; BusError if nothing can be received any more."""
        time.sleep(dt_s)
        self.network.check()

    def __enter__(self) -> "BusLink":
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        try:
            self.network.disconnect()
        except BusError:  # it has broken down before: that has been said
            if error is None:
                raise


@contextmanager
def _bus_errors(title: str) -> Iterator[None]:
    try:
        yield
    except (can.CanError, OSError, NotImplementedError, ValueError) as error:
        raise BusError(f"{title}: {reason(error)}") from error
