"""Open the place where other programs reach a live board: a socketcand server, or a bus of python-can."""

from abc import ABC, abstractmethod
from typing import TYPE_CHECKING, Any, ClassVar

from steptwin.emulator.live.live_loop import LiveLoop
from steptwin.host.client.links.bus_link import Connection, check_interface, open_bus
from steptwin.host.common.errors import InputError
from steptwin.host.common.listening import CHANNEL, LOOPBACK, PORT, is_loopback, listen

if TYPE_CHECKING:
    from steptwin.emulator.live.can_bridge import CanBridge
    from steptwin.emulator.live.socketcand import SocketcandServer


class Endpoint(ABC):
    """A listening socket or a bus of python-can, open from its construction until `close`."""

    kind: ClassVar[str]
    """Key under which the report holds its figures."""
    title: str
    """The place of the board, and the way to connect to it."""
    port: int | None = None
    """TCP port of a listening socket."""
    remote: bool = False
    """True if other machines reach a listening socket."""

    @abstractmethod
    def attach(self, loop: LiveLoop) -> None:
        """Connect the endpoint with a live board."""

    @abstractmethod
    def close(self) -> None:
        """Disconnect. An endpoint that is attached to a loop must be closed before the loop."""

    @abstractmethod
    def status(self) -> str:
        """Return the present state in a few words."""

    @abstractmethod
    def figures(self) -> dict[str, Any]:
        """Return the figures for the report."""

    @property
    def failure(self) -> str | None:
        """Reason why the endpoint no longer works; None while it does."""
        return None


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
        address, port = self._listener.getsockname()[:2]
        self.port: int | None = port
        self.remote: bool = not is_loopback(address)
        self.title: str = (
            f"socketcand at {address}:{self.port}; python-can's tools: "
            f"-i socketcand -c {CHANNEL} --bus-kwargs host={address} port={self.port}"
        )

    def attach(self, loop: LiveLoop) -> None:
        """Accept clients."""
        from steptwin.emulator.live.socketcand import SocketcandServer

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


class PythonCanEndpoint(Endpoint):
    """A bus of python-can.

    Raises:
        InputError: python-can does not know the interface.
        BusError: the bus cannot be opened.
    """

    kind = "interface"

    def __init__(self, connection: Connection) -> None:
        """Open the bus."""
        check_interface("interface", connection.interface)
        self._name = connection.title
        self._bus = open_bus(connection)
        self._bridge: CanBridge | None = None
        self.title: str = f"on python-can's interface {self._name}"

    def attach(self, loop: LiveLoop) -> None:
        """Pass frames between the bus and the board."""
        from steptwin.emulator.live.can_bridge import CanBridge

        self._bridge = CanBridge(loop, self._bus)

    def close(self) -> None:
        """Disconnect from the bus."""
        if self._bridge:
            self._bridge.close()
        else:
            self._bus.shutdown()

    def status(self) -> str:
        """Return the bus' name and, if there are any, the number of frames that it did not take."""
        unsent = self._bridge.unsent_frames if self._bridge else 0
        return f"{self._name}, {unsent} frames not sent" if unsent else self._name

    def figures(self) -> dict[str, Any]:
        """Return the bus' name and the numbers of frames of another format, lost at reception and not sent."""
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
        """The interface's error message after it has failed; None while it works."""
        failure = self._bridge.failure if self._bridge else None
        return f"{self._name}: {failure}" if failure else None


def open_endpoint(
    host: str | None, port: int | None, interface: str | None, channel: str | None, bitrate: int, *, allow_remote: bool
) -> Endpoint:
    """Listen for socketcand clients, or join the bus of a python-can interface if one is named.

    Raises:
        InputError: the arguments contradict each other, or name no address, port or interface.
        BusError: the port is in use, or the bus cannot be opened.
    """
    if interface is None:
        if channel is not None:
            raise InputError(f"channel={channel}: needs interface=NAME")
        return SocketcandEndpoint(host or LOOPBACK, PORT if port is None else port, allow_remote=allow_remote)
    connection = Connection(interface, channel, bitrate)
    if interface == "socketcand":
        connection = Connection(interface, channel, None, host or LOOPBACK, port or PORT)
    else:
        for name, value in (("host", host), ("port", port)):
            if value is not None:
                raise InputError(f"{name}={value}: is for a socketcand server, not for interface={interface}")
    if allow_remote:
        raise InputError(f"allow_remote=True: is for listening, not for interface={interface}")
    return PythonCanEndpoint(connection)
