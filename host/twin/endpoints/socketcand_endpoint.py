"""Serve a live board at a TCP port that speaks socketcand."""

from typing import TYPE_CHECKING, Any

from steptwin.emulator.live_loop import LiveLoop
from steptwin.host.common.listening import is_loopback, listen
from steptwin.host.common.socketcand import CHANNEL
from steptwin.host.twin.endpoints.endpoint import Endpoint

if TYPE_CHECKING:
    from steptwin.emulator.socketcand_server import SocketcandServer


class SocketcandEndpoint(Endpoint):
    """A socketcand server, to which any number of clients connect.

    Raises:
        InputError: the host or the port does not exist, or other machines reach the host and `allow_remote` is False.
        BusError: the port is in use.
    """

    kind = "clients"

    def __init__(self, host: str, port: int, *, allow_remote: bool) -> None:
        """Listen at an address of this machine; port 0 takes a free one."""
        self._listener = listen(host, port, allow_remote=allow_remote)
        self._server: SocketcandServer | None = None
        address, self.port = self._listener.getsockname()[:2]
        self.remote = not is_loopback(address)
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
