"""Link in real time to a bus: a served board's socketcand port, or any interface of python-can."""

import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

import can
import canopen

from steptwin.host.client.links.bus_network import BusNetwork
from steptwin.host.client.links.can_bus import bus_errors, open_python_can_bus
from steptwin.host.client.links.connecting import address_text
from steptwin.host.client.links.socketcand_bus import SocketcandBus
from steptwin.host.common import listening as socketcand
from steptwin.host.common.errors import BusError


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
        self.held_up_s = 0.0
        self._all_held_up_s = 0.0

    def now_s(self) -> float:
        """Return the seconds on the monotonic clock, which is never set, without those of being held up."""
        return time.monotonic() - self._all_held_up_s

    def wait(self, dt_s: float) -> None:
        """Sleep; raise BusError if nothing can be received any more."""
        due_s = time.monotonic() + dt_s
        time.sleep(dt_s)
        late_s = time.monotonic() - due_s
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
