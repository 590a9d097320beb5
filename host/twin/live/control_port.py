"""Listen at a TCP port of this machine where programs operate the machine of a served board."""

from typing import TYPE_CHECKING, Any

from steptwin.emulator.faults.machine import PER_DEGC, PER_V
from steptwin.emulator.live.live_loop import LiveLoop
from steptwin.host.common import listening as socketcand
from steptwin.host.common.bad_input import printable
from steptwin.host.common.errors import InputError
from steptwin.host.common.listening import listen
from steptwin.host.faults.requests import read_request, switches_of
from steptwin.host.operate.inputs_outputs import wired_inputs
from steptwin.host.twin.live.live_board import LiveBoard
from steptwin.host.twin.live.node_requests import NODE_REQUESTS, answer_for_node, nmt_states
from steptwin.protocol.cia402 import DigitalInput

if TYPE_CHECKING:
    from steptwin.emulator.live.control_server import ControlServer


_PROTECT = int(DigitalInput.DRIVER_PROTECT | DigitalInput.DRIVER_FAULT)


class MachineState:
    """Reads the state of a board. It is read between two stretches of simulation, so it must be read quickly."""

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
        """Return the state under the keys of docs/control-port.md."""
        board, around = self._board, self._board.surroundings
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
                "recent_load_percent": round(board.recent_bus_load_percent, 3),
                "faults": len(board.bus.faults.in_force),
            },
            "real_time": board.real_time(),
            **({"nodes": nodes} if (nodes := nmt_states(board.nodes)) else {}),
            **({} if (shelf := board.shelf()) is None else {"shelf": shelf}),
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
        """Listen; port 0 takes a free one."""
        self._listener = listen(socketcand.LOOPBACK, port, "control_port")
        self._server: ControlServer | None = None
        address, port = self._listener.getsockname()[:2]
        self.port: int = port
        self.address: str = f"{address}:{self.port}"
        """HOST:PORT, as clients are given it."""

    def attach(self, loop: LiveLoop, board: LiveBoard) -> None:
        """Accept clients, who operate this board."""
        from steptwin.emulator.live.control_server import ControlServer

        state = MachineState(board)

        def handle(request: dict[str, Any]) -> dict[str, Any]:
            try:
                if request.get("do") in NODE_REQUESTS:
                    return {"node": answer_for_node(board, request)} | state.read()
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
