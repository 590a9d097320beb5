"""Listen at a TCP port of this machine at which programs operate the machine of a served board."""

from typing import TYPE_CHECKING, Any

from steptwin.emulator.live_loop import LiveLoop
from steptwin.host.common import socketcand
from steptwin.host.common.errors import InputError
from steptwin.host.common.listening import listen
from steptwin.host.common.printable import printable
from steptwin.host.twin.control.operations import read_request
from steptwin.host.twin.control.state import MachineState
from steptwin.host.twin.live_board import LiveBoard

if TYPE_CHECKING:
    from steptwin.emulator.control_server import ControlServer


class ControlPort:
    """The control port of a board, at the loopback address: open from its construction until `close`.

    Raises:
        InputError: the port does not exist.
        BusError: the port is in use.
    """

    def __init__(self, port: int) -> None:
        """Listen; port 0 takes a free one."""
        self._listener = listen(socketcand.LOOPBACK, port, "control_port")
        self._server: ControlServer | None = None
        address, self.port = self._listener.getsockname()[:2]
        self.address = f"{address}:{self.port}"
        """HOST:PORT, as clients are given it."""

    def attach(self, loop: LiveLoop, board: LiveBoard) -> None:
        """Accept clients, who operate this board."""
        from steptwin.emulator.control_server import ControlServer

        state = MachineState(board)

        def handle(request: dict[str, Any]) -> dict[str, Any]:
            try:
                harm = read_request(board.robot, request)
                if harm is not None:
                    board.operate(harm)
            except InputError as error:
                return {"error": printable(str(error))}
            return state.read()

        self._server = ControlServer(loop, self._listener, handle)

    def close(self) -> None:
        """Disconnect all clients and stop listening; a port that is attached must be closed before its loop."""
        if self._server:
            self._server.close()
        self._listener.close()

    def figures(self) -> dict[str, Any]:
        """Return the address, the numbers of connections served and of those ended by the server, and of requests."""
        figures: dict[str, Any] = {"address": self.address}
        if server := self._server:
            figures |= {
                "served": server.served,
                "disconnected": dict(server.disconnected),
                "requests": server.requests,
                "refused": server.refused,
            }
        return figures
