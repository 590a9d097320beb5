"""Where a live board is to be reached: at a listening socket, or on a bus of python-can."""

import errno
import socket
from abc import ABC, abstractmethod
from ipaddress import ip_address
from typing import TYPE_CHECKING, Any, ClassVar, Final

from steptwin.emulator.live_loop import LiveLoop
from steptwin.host.common.errors import BusError, InputError

if TYPE_CHECKING:
    from steptwin.emulator.can_bridge import CanBridge
    from steptwin.emulator.socketcand_server import SocketcandServer

_PORTS: Final = range(1024, 1 << 16)
_BACKLOG: Final = 64
_IN_THE_WAY: Final = {
    errno.EADDRINUSE: "is in use; --port 0 takes a free one",
    errno.EADDRNOTAVAIL: "is no address of this machine",
}


class Endpoint(ABC):
    """One of the two, open from its making until it is closed; a context manager."""

    kind: ClassVar[str]
    """Under which key the report has its figures."""
    title: str
    """Says where it is and how to get there."""

    def __enter__(self) -> "Endpoint":
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    @abstractmethod
    def attach(self, loop: LiveLoop) -> None:
        """Connect it with a live board."""

    @abstractmethod
    def close(self) -> None:
        """Leave the others; before the loop ends, if there is one."""

    @abstractmethod
    def status(self) -> str:
        """A few words on how it goes."""

    @abstractmethod
    def figures(self) -> dict[str, Any]:
        """What there is to report."""

    @property
    def failure(self) -> str | None:
        """Why it is of no use any more, if so."""
        return None


class SocketcandEndpoint(Endpoint):
    """A socketcand server.

    Raises:
        InputError: no such host or port, or an address that other machines reach although that is not allowed.
        BusError: the port is taken.
    """

    kind = "clients"

    def __init__(self, host: str, port: int, *, allow_remote: bool) -> None:
        """Listen; port 0 takes a free one."""
        self._listener = _listen(host, port, allow_remote=allow_remote)
        self._server: SocketcandServer | None = None
        address, self.port = self._listener.getsockname()[:2]
        self.remote = not _is_loopback(address)
        """Whether other machines reach it."""
        self.title = (
            f"socketcand at {address}:{self.port}; python-can's tools: "
            f"-i socketcand -c vcan0 --bus-kwargs host={address} port={self.port}"
        )

    def attach(self, loop: LiveLoop) -> None:
        """Let clients in."""
        from steptwin.emulator.socketcand_server import SocketcandServer

        self._server = SocketcandServer(loop, self._listener)

    def close(self) -> None:
        """Disconnect everybody."""
        if self._server:
            self._server.close()
        self._listener.close()

    def status(self) -> str:
        """How many clients there are."""
        count = self._server.clients if self._server else 0
        return f"{count} client{'' if count == 1 else 's'}"

    def figures(self) -> dict[str, Any]:
        """Connections served, those ended from this side by reason, frames that are not for this bus."""
        server = self._server
        if not server:
            return {}
        return {
            "served": server.served,
            "disconnected": dict(server.disconnected),
            "foreign_frames": server.foreign_frames,
        }


class CanEndpoint(Endpoint):
    """A bus of python-can.

    Raises:
        InputError: there is no such interface.
        BusError: it cannot be opened.
    """

    kind = "interface"

    def __init__(self, interface: str, channel: str | None, bitrate: int, more: dict[str, Any]) -> None:
        """Open it.

        Args:
            interface: as python-can calls it.
            channel: of the interface; None: its default.
            bitrate: for the interfaces that set it.
            more: further arguments of the interface.
        """
        from steptwin.host.client.can_bus import check_interface, open_python_can_bus

        check_interface("interface", interface)
        self._name = f"{interface} {channel}" if channel else interface
        self._bus = open_python_can_bus(self._name, interface, channel=channel, bitrate=bitrate, **more)
        self._bridge: CanBridge | None = None
        self.title = f"on python-can's interface {self._name}"

    def attach(self, loop: LiveLoop) -> None:
        """Let frames through."""
        from steptwin.emulator.can_bridge import CanBridge

        self._bridge = CanBridge(loop, self._bus)

    def close(self) -> None:
        """Leave the bus."""
        if self._bridge:
            self._bridge.close()
        else:
            self._bus.shutdown()

    def status(self) -> str:
        """Which one it is, and what was lost on it."""
        unsent = self._bridge.unsent_frames if self._bridge else 0
        return f"{self._name}, {unsent} frames not sent" if unsent else self._name

    def figures(self) -> dict[str, Any]:
        """Its name and the frames that were lost on the way."""
        bridge = self._bridge
        if not bridge:
            return {"name": self._name}
        return {
            "name": self._name,
            "foreign_frames": bridge.foreign_frames,
            "overruns": bridge.overruns,
            "unsent_frames": bridge.unsent_frames,
        }

    @property
    def failure(self) -> str | None:
        """What the interface said when it failed."""
        failure = self._bridge.failure if self._bridge else None
        return f"{self._name}: {failure}" if failure else None


def _listen(host: str, port: int, *, allow_remote: bool) -> socket.socket:
    if port and port not in _PORTS:
        raise InputError(f"--port {port}: is neither 0 nor from {_PORTS.start} to {_PORTS.stop - 1}")
    try:
        family, _, _, _, address = socket.getaddrinfo(host, port, type=socket.SOCK_STREAM)[0]
    except (OSError, UnicodeError) as error:
        raise InputError(f"--host {host}: is no address of this machine") from error
    if not allow_remote and not _is_loopback(str(address[0])):
        raise InputError(
            f"--host {host}: other machines could drive this board; if they may, say --allow-remote as well"
        )
    try:
        return socket.create_server(address[:2], family=family, backlog=_BACKLOG)
    except OSError as error:
        reason = _IN_THE_WAY.get(error.errno or 0, error.strerror)
        raise BusError(f"{host}:{port} {reason}") from error


def _is_loopback(address: str) -> bool:
    return ip_address(address.partition("%")[0]).is_loopback
