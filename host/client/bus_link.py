"""Link in real time to a bus: a served board's socketcand port, or any interface of python-can."""

import socket
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
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
"""Longest time that disconnecting waits for the receiving thread."""
_EMPTY_READS_MAX: Final = 1000
"""Largest number of empty reads in a row while a command arrives in pieces; more mean a closed connection."""
_AT_ONCE_S: Final = 0.001


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
            return f"{self.host}:{self.port}"
        return f"{self.interface} {self.channel}" if self.channel else self.interface


def open_bus(connection: Connection) -> can.BusABC:
    """Open the bus; raise BusError, with the interface's reason, if it cannot be opened."""
    if connection.host is not None:
        with _bus_errors(connection.title):
            assert connection.port is not None
            # python-can retries for ten seconds, without a pause, before it reports a refused connection
            socket.create_connection((connection.host, connection.port), _CONNECT_TIMEOUT_S).close()
            return _SocketcandBus(connection.channel or socketcand.CHANNEL, connection.host, connection.port)
    return open_python_can_bus(
        connection.title, connection.interface, channel=connection.channel, bitrate=connection.bitrate
    )


class _SocketcandBus(SocketCanDaemonBus):
    """python-can's socketcand bus, extended to notice a closed connection, which python-can takes for a silent one."""

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
    """End the receiving thread without a traceback; `BusNetwork.check` raises its error instead."""

    def on_message_received(self, msg: can.Message) -> None:
        """Ignore the frame; the network's own listener takes it."""

    def on_error(self, _exc: Exception) -> None:
        """Pause before the notifier, which has stored the error, tries again."""
        time.sleep(_RECEIVE_CYCLE_S)


class BusNetwork(canopen.Network):
    """The canopen library's network, which raises BusError instead of python-can's errors."""

    NOTIFIER_CYCLE = _RECEIVE_CYCLE_S

    def __init__(self, bus: can.BusABC, title: str) -> None:
        super().__init__(bus)
        self.listeners.append(_EndOfReceiving(self))
        self._title = title

    def send_message(self, can_id: int, data: bytes, remote: bool = False) -> None:
        """Send a frame; raise BusError if the interface does not take it."""
        with _bus_errors(self._title):
            super().send_message(can_id, data, remote)

    def check(self) -> None:
        """Raise BusError if the receiving thread has ended."""
        with _bus_errors(self._title):
            super().check()


class BusLink:
    """A Link to a real or a served bus; a context manager that closes the bus at its end."""

    def __init__(self, bus: can.BusABC, title: str) -> None:
        self.network: canopen.Network = BusNetwork(bus, title)
        self.network.connect()

    def now_s(self) -> float:
        """Return the seconds on the monotonic clock, which is never set."""
        return time.monotonic()

    def wait(self, dt_s: float) -> None:
        """Sleep; raise BusError if nothing can be received any more."""
        time.sleep(dt_s)
        self.network.check()

    def __enter__(self) -> "BusLink":
        return self

    def __exit__(self, kind: object, error: object, trace: object) -> None:
        try:
            self.network.disconnect()
        except BusError:  # an error that is raised already says why
            if error is None:
                raise


@contextmanager
def _bus_errors(title: str) -> Iterator[None]:
    try:
        yield
    except (can.CanError, OSError, NotImplementedError, ValueError) as error:
        raise BusError(f"{title}: {reason(error)}") from error
