"""Listen at a TCP port of this machine where programs operate the machine of a served board.

Requests may concern further nodes, too: their values and emergencies.
"""

import re
from collections.abc import Mapping
from difflib import get_close_matches
from math import isfinite
from typing import TYPE_CHECKING, Any, Final, Protocol

from steptwin.emulator.board.surroundings import PER_DEGC, PER_V
from steptwin.emulator.live.live_loop import LiveLoop
from steptwin.features.nodes.node_objects import NodeValue, ValueForm
from steptwin.features.nodes.simple_node import SimpleNode
from steptwin.host.common import listening as socketcand
from steptwin.host.common.bad_input import prefixed, printable, unknown
from steptwin.host.common.choices import STATE
from steptwin.host.common.errors import InputError
from steptwin.host.common.features import ControlRequests, giving
from steptwin.host.common.listening import listen
from steptwin.host.common.tables import Table
from steptwin.host.operate.inputs_outputs import switches_of, wired_inputs
from steptwin.host.twin.live.live_board import LiveBoard
from steptwin.protocol import od
from steptwin.protocol.cia402 import DigitalInput

if TYPE_CHECKING:
    from steptwin.emulator.live.control_server import ControlServer


_PROTECT = int(DigitalInput.DRIVER_PROTECT | DigitalInput.DRIVER_FAULT)
_VALUE, _EMERGENCY, _POWER = "node", "node-emergency", "node-power"
NODE_REQUESTS: Final[Mapping[str, tuple[str, ...]]] = {
    _VALUE: ("object", "value"),
    _EMERGENCY: ("code", "register", "data"),
    _POWER: ("on",),
}
"""The keys of each request beside `do` and `node`."""
_PLACE: Final = re.compile(r"(?:0x)?([0-9a-f]{4})(?::(?:0x)?([0-9a-f]{1,2}))?", re.IGNORECASE)
_GENERIC_ERROR: Final = 1


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
                "host_bitrate": board.bus.host_bitrate,
                "recent_load_percent": round(board.recent_bus_load_percent, 3),
                "faults": len(board.bus.filters.in_force),
            },
            "real_time": board.real_time(),
            **({"nodes": nodes} if (nodes := nmt_states(board.nodes)) else {}),
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
                answered = answer_request(board, request)
            except InputError as error:
                return {"error": printable(str(error))}
            return {**answered, **state.read()}

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


def answer_request(board: LiveBoard, request: Mapping[str, Any]) -> Mapping[str, Any]:
    """Do what a request asks for; return what is told beside the machine's state.

    Raises:
        InputError: the request does not exist, has other keys or values, or the machine lacks what it concerns.
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
        table.read({"do": Table.text})
        return {}
    return answering[do].answer(board, request)


def nmt_states(nodes: Mapping[int, SimpleNode]) -> dict[str, str]:
    """Return the NMT state of each node, by its id; OFF without supply."""
    return {f"0x{node_id:02X}": node.nmt_state.name if node.powered else "OFF" for node_id, node in nodes.items()}


def read_place(text: str) -> int:
    """Return the address of an object such as 0x6000:01, or 0x1000 for sub-index 0; InputError for another form."""
    if not (found := _PLACE.fullmatch(text)):
        raise InputError(f"{text!r} is not an object such as 0x6000:01")
    return od.address_of(int(found[1], 16), int(found[2] or "0", 16))


class NodesOfBoard(Protocol):
    """A board with further nodes on its bus."""

    @property
    def nodes(self) -> Mapping[int, SimpleNode]:
        """The nodes by their ids."""
        ...

    def switch_node(self, node_id: int, *, on: bool) -> None:
        """Take the supply from a node, or give it back."""
        ...


def answer_for_node(board: NodesOfBoard, request: Mapping[str, Any]) -> dict[str, Any]:
    """Do what a request asks of a node, and return the value that it named.

    Raises:
        InputError: there is no such node or object, or the request has other keys or values.
    """
    table = Table(request, "JSON object")
    do, nodes = table.text("do"), board.nodes
    more = NODE_REQUESTS[do]
    for key in table:
        if key not in ("do", "node", *more):
            raise InputError(f"{key}: there is no such key; there are node, {', '.join(more)}")
    node_id = table.integer("node")
    if node_id not in nodes:
        listed = ", ".join(str(each) for each in nodes) or "none: `steptwin serve --node ID=EDS` adds them"
        raise InputError(f"node: {node_id} is no further node; there are {listed}")
    if do == _POWER:
        on = table.truth("on")
        board.switch_node(node_id, on=on)
        return {"id": node_id, "on": on}
    if do == _EMERGENCY:
        return _emergency(nodes[node_id], table)
    return _value(nodes[node_id], table)


def _emergency(node: SimpleNode, table: Table) -> dict[str, Any]:
    code = table.integer("code")
    register = table.integer("register") if "register" in table else _GENERIC_ERROR if code else 0
    try:
        node.emergency(code, register, _bytes(table.text("data")) if "data" in table else b"")
    except ValueError as error:
        raise InputError(str(error)) from error
    return {"id": node.node_id, "code": code}


def _value(node: SimpleNode, table: Table) -> dict[str, Any]:
    """Give the value that a request may have, and return that of its object."""
    with prefixed("object: "):
        address = read_place(table.text("object"))
        entries = node.description.entries
        if address not in entries:
            given, places = od.place_text(address), [od.place_text(each) for each in entries]
            near = get_close_matches(given, places, n=1)
            raise InputError(f"{given} is not in {node.description.source}{f'; near is {near[0]}' if near else ''}")
    entry = entries[address]
    if "value" in table:
        with prefixed("value: "):
            given_value: Any = table.values["value"]
            if entry.form is ValueForm.BYTES:
                given_value = _bytes(table.text("value"))
            try:
                node.set_value(address, given_value)
            except ValueError as error:
                raise InputError(str(error)) from error
    return {
        "id": node.node_id,
        "object": od.place_text(address),
        "name": entry.name,
        "value": _in_json(node.value(address)),
    }


def _bytes(text: str) -> bytes:
    try:
        return bytes.fromhex(text)
    except ValueError:
        raise InputError(f"{text!r} is not bytes in hexadecimal digits, such as '0f 00'") from None


def _in_json(value: NodeValue) -> float | str | None:
    """Return a value as JSON has it: bytes as hexadecimal digits, null for what is no number."""
    if isinstance(value, bytes):
        return value.hex(" ")
    if isinstance(value, float) and not isfinite(value):
        return None
    return value
