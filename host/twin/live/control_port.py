"""Listen at a TCP port of this machine for programs that operate the machine of a served board."""

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from steptwin.emulator.board.environment import PER_DEGC, PER_V
from steptwin.emulator.live.live_loop import LiveLoop
from steptwin.host.common import listening as socketcand
from steptwin.host.common.bad_input import printable, unknown
from steptwin.host.common.choices import STATE
from steptwin.host.common.errors import InputError
from steptwin.host.common.features import ControlRequests, giving
from steptwin.host.common.listening import listen
from steptwin.host.common.tables import Table
from steptwin.host.operate.inputs_outputs import switches_of, wired_inputs
from steptwin.host.twin.live.live_board import LiveBoard
from steptwin.protocol.cia402 import DigitalInput

if TYPE_CHECKING:
    from steptwin.emulator.live.control_server import ControlServer


_PROTECT = int(DigitalInput.DRIVER_PROTECT | DigitalInput.DRIVER_FAULT)


class MachineState:
    """Reads the state of a board; must be fast, since it runs between two stretches of simulation."""

    def __init__(self, board: LiveBoard) -> None:
        robot = board.robot
        self._board = board
        self._joints = robot.axis_names
        self._inputs = [(name, axis, int(bit)) for name, (axis, bit) in wired_inputs(robot).items()]
        """Name, axis and bit of each input."""
        self._switches = [
            [(name, int(bit)) for name, bit in switches_of(robot, axis).items()] for axis in range(len(self._joints))
        ]
        """Name and bit of each switch of each joint."""

    def read(self) -> dict[str, Any]:
        """Return the state under the keys of docs/live.md."""
        board, around = self._board, self._board.environment
        levels = [int(axis.levels) for axis in around.axes]
        stuck = [int(axis.stuck) for axis in around.axes]
        return {
            "simulated": True,
            "robot": board.robot.name,
            "estop": around.emergency_stop,
            "supply_v": around.supply_10mv / PER_V,
            "temperature_degc": around.temperature_decidegc / PER_DEGC,
            "protect": {
                joint: {"low": bool(levels[i] & _PROTECT), "held": around.axes[i].protect_held}
                for i, joint in enumerate(self._joints)
            },
            "inputs": {name: bool(levels[axis] & bit) for name, axis, bit in self._inputs},
            "switches": {
                joint: {
                    name: {"closed": bool(levels[i] & bit), "stuck": bool(stuck[i] & bit)}
                    for name, bit in self._switches[i]
                }
                for i, joint in enumerate(self._joints)
            },
            "bus": board.bus_figures()
            | {
                "host_bitrate": board.bus.host_bitrate,
                "recent_load_percent": round(board.recent_bus_load_percent, 3),
                "faults": len(board.bus.filters.in_force),
            },
            "real_time": board.real_time(),
            **{key: value for part in board.parts.values() for key, value in part.state().items()},
            **board.features(),
            "simulated_s": round(board.simulated_s, 6),
            "wall_s": round(board.wall_s, 6),
        }


class ControlPort:
    """The control port of a board, at the loopback address: open from its construction until `close`.

    Raises:
        InputError: the port does not exist.
        BusError: the port is in use.
    """

    def __init__(self, port: int) -> None:
        """Listen on a port; 0 takes a free one."""
        self._listener = listen(socketcand.LOOPBACK, port, "control_port")
        self._server: ControlServer | None = None
        address, port = self._listener.getsockname()[:2]
        self.port: int = port
        self.address: str = f"{address}:{self.port}"
        """HOST:PORT for clients."""

    def attach(self, loop: LiveLoop, board: LiveBoard) -> None:
        """Accept clients that operate this board."""
        from steptwin.emulator.live.control_server import ControlServer

        state = MachineState(board)

        def handle(request: dict[str, Any]) -> dict[str, Any]:
            try:
                answered = answer_request(board, request)
            except InputError as error:
                return {"error": printable(str(error))}
            return {**answered, **state.read()}

        self._server = ControlServer(loop, self._listener, handle)

    def close(self) -> None:
        """Disconnect all clients and stop listening; an attached port must be closed before its loop."""
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


def answer_request(board: LiveBoard, request: Mapping[str, Any]) -> Mapping[str, Any]:
    """Execute a request; return its answer besides the machine's state.

    Raises:
        InputError: the request is unknown, has other keys or values, or the machine lacks its target.
    """
    answering: dict[str, ControlRequests] = {}
    for _, made in giving("requests"):
        requests: ControlRequests = made()
        answering |= dict.fromkeys(requests.names, requests)
    table, names = Table(request, "JSON object"), (*answering, STATE)
    if "do" not in table:
        raise InputError(f"do: is missing: one of {', '.join(names)}")
    do = table.text("do")
    if do not in names:
        raise unknown("do", do, names)
    if do == STATE:
        table.check_keys(("do",))
        return {}
    return answering[do].answer(board, request)
