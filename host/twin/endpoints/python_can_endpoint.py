"""Put a live board on a bus of python-can: virtual, SocketCAN, socketcand or an adapter."""

from typing import TYPE_CHECKING, Any

from steptwin.emulator.live_loop import LiveLoop
from steptwin.host.client.bus_link import Connection, open_bus
from steptwin.host.client.can_bus import check_interface
from steptwin.host.twin.endpoints.endpoint import Endpoint

if TYPE_CHECKING:
    from steptwin.emulator.can_bridge import CanBridge


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
        self.title = f"on python-can's interface {self._name}"

    def attach(self, loop: LiveLoop) -> None:
        """Pass frames between the bus and the board."""
        from steptwin.emulator.can_bridge import CanBridge

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
