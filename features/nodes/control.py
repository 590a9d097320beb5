"""Answer control port requests for further nodes: their values, emergencies and supply."""

import re
from collections.abc import Mapping
from difflib import get_close_matches
from math import isfinite
from typing import TYPE_CHECKING, Any, Final

from steptwin.features.nodes.node_objects import NodeValue, ValueForm
from steptwin.features.nodes.part import NodesPart
from steptwin.features.nodes.simple_node import SimpleNode
from steptwin.host.common.bad_input import prefixed
from steptwin.host.common.errors import InputError
from steptwin.host.common.tables import Table
from steptwin.protocol import od

if TYPE_CHECKING:
    from steptwin.emulator.operations import Operation
    from steptwin.host.robots.robot import Robot
    from steptwin.host.twin.live.live_board import LiveBoard

_VALUE, _EMERGENCY, _POWER = "node", "node-emergency", "node-power"
_KEYS: Final[Mapping[str, tuple[str, ...]]] = {
    _VALUE: ("object", "value"),
    _EMERGENCY: ("code", "register", "data"),
    _POWER: ("on",),
}
"""Keys of each request besides `do` and `node`."""
names: Final = tuple(_KEYS)
_PLACE: Final = re.compile(r"(?:0x)?([0-9a-f]{4})(?::(?:0x)?([0-9a-f]{1,2}))?", re.IGNORECASE)
_GENERIC_ERROR: Final = 1


def read_place(text: str) -> int:
    """Return the address of an object such as 0x6000:01, or 0x1000 for sub-index 0; raise InputError otherwise."""
    if not (found := _PLACE.fullmatch(text)):
        raise InputError(f"{text!r} is not an object such as 0x6000:01")
    return od.address_of(int(found[1], 16), int(found[2] or "0", 16))


def answer(board: "LiveBoard", request: Mapping[str, Any]) -> Mapping[str, Any]:
    """Execute a request for a node, and return the value of its object.

    Raises:
        InputError: there is no such node or object, or the request has other keys or values.
    """
    table = Table(request, "JSON object")
    part = board.parts.get("nodes")
    nodes = part.nodes if isinstance(part, NodesPart) else {}
    do = table.text("do")
    more = _KEYS[do]
    for key in table:
        if key not in ("do", "node", *more):
            raise InputError(f"{key}: there is no such key; there are node, {', '.join(more)}")
    node_id = table.integer("node")
    if node_id not in nodes:
        listed = ", ".join(str(each) for each in nodes) or "none: `steptwin serve --machine node=ID=EDS` adds them"
        raise InputError(f"node: {node_id} is no further node; there are {listed}")
    if do == _POWER:
        on = table.truth("on")
        assert isinstance(part, NodesPart)
        part.switch(node_id, on=on)
        return {"node": {"id": node_id, "on": on}}
    if do == _EMERGENCY:
        return {"node": _emergency(nodes[node_id], table)}
    return {"node": _value(nodes[node_id], table)}


def written(_robot: "Robot", _operation: "Operation") -> None:
    """Return None: operations do not concern further nodes."""


def _emergency(node: SimpleNode, table: Table) -> dict[str, Any]:
    code = table.integer("code")
    register = table.integer("register") if "register" in table else _GENERIC_ERROR if code else 0
    try:
        node.emergency(code, register, _bytes(table.text("data")) if "data" in table else b"")
    except ValueError as error:
        raise InputError(str(error)) from error
    return {"id": node.node_id, "code": code}


def _value(node: SimpleNode, table: Table) -> dict[str, Any]:
    """Set an object of a node if the request has a value, and return the object's value."""
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
    """Return a value for JSON: bytes as hexadecimal digits, null for NaN and infinities."""
    if isinstance(value, bytes):
        return value.hex(" ")
    if isinstance(value, float) and not isfinite(value):
        return None
    return value
