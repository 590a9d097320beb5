"""Serve a live board at a TCP port that speaks socketcand."""

import errno
import socket
from ipaddress import ip_address
from typing import TYPE_CHECKING, Any, Final

from steptwin.emulator.live_loop import LiveLoop
from steptwin.host.common.errors import BusError, InputError
from steptwin.host.common.socketcand import CHANNEL
from steptwin.host.twin.endpoints.endpoint import Endpoint

if TYPE_CHECKING:
    from steptwin.emulator.socketcand_server import SocketcandServer

_PORTS: Final = range(1024, 1 << 16)
_BACKLOG: Final = 64
_REASONS: Final = {
    errno.EADDRINUSE: "is in use; port=0 takes a free one",
    errno.EADDRNOTAVAIL: "is not an address of this machine",
}


class SocketcandEndpoint(Endpoint):
    """A socketcand server, to which any number of clients connect.

    Raises:
        InputError: the host or the port does not exist, or other machines reach the host and `allow_remote` is False.
        BusError: the port is in use.
    """

    kind = "clients"

    def __init__(self, host: str, port: int, *, allow_remote: bool) -> None:
        """Listen at an address of this machine; port 0 takes a free one."""
        self._listener = _listen(host, port, allow_remote=allow_remote)
        self._server: SocketcandServer | None = None
        address, self.port = self._listener.getsockname()[:2]
        self.remote = not _is_loopback(address)
        self.title = (
            f"socketcand at {address}:{self.port}; python-can's tools: "
            f"-i socketcand -c {CHANNEL} --bus-kwargs host={address} port={self.port}"
        )

    def attach(self, loop: LiveLoop) -> None:
        """Accept clients."""
        from steptwin.emulator.socketcand_server import SocketcandServer

        self._server = SocketcandServer(loop, self._listener)

    def close(self) -> None:
        """Disconnect all clients and stop listening."""
        if self._server:
            self._server.close()
        self._listener.close()

    def status(self) -> str:
        """Return the number of clients, in words."""
        count = self._server.clients if self._server else 0
        return f"{count} client{'' if count == 1 else 's'}"

    def figures(self) -> dict[str, Any]:
        """Return the numbers of connections served, of those ended by the server, and of frames of another format."""
        server = self._server
        if not server:
            return {}
        return {
            "served": server.served,
            "disconnected": dict(server.disconnected),
            "foreign_frames": server.foreign_frames,
        }


def _listen(host: str, port: int, *, allow_remote: bool) -> socket.socket:
    if port and port not in _PORTS:
        raise InputError(f"port={port}: is neither 0 nor from {_PORTS.start} to {_PORTS.stop - 1}")
    try:
        family, _, _, _, address = socket.getaddrinfo(host, port, type=socket.SOCK_STREAM)[0]
    except (OSError, UnicodeError) as error:
        raise InputError(f"host={host}: is not an address of this machine") from error
    if not allow_remote and not _is_loopback(str(address[0])):
        raise InputError(f"host={host}: other machines could drive this board; allow_remote=True permits it")
    try:
        return socket.create_server(address[:2], family=family, backlog=_BACKLOG)
    except OSError as error:
        reason = _REASONS.get(error.errno or 0, error.strerror)
        raise BusError(f"{host}:{port} {reason}") from error


def _is_loopback(address: str) -> bool:
    return ip_address(address.partition("%")[0]).is_loopback
