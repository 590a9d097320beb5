"""Decode a CAN frame by the predefined connection set (CiA 301, section 7.3.5): service, node and content.

PDOs are decoded with the mapping after power-up; with another mapping the bytes appear under wrong names.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Final

from steptwin.host.client.monitor.fields import pdo_fields, value_text
from steptwin.host.client.monitor.sdo_text import request_text, response_text
from steptwin.host.client.words import error_text, words
from steptwin.protocol.cia402 import ErrorCode, Overrun
from steptwin.protocol.frame import (
    COB_EMCY,
    COB_HEARTBEAT,
    COB_NMT,
    COB_RPDO,
    COB_SDO_REQUEST,
    COB_SDO_RESPONSE,
    COB_SYNC,
    COB_TPDO,
    HOST_NODE_ID,
    NODE_ID_MAX,
)
from steptwin.protocol.nmt import NmtCommand, NmtState
from steptwin.protocol.pdo_defaults import RPDO_DEFAULTS, TPDO_DEFAULTS

SERVICES: Final = ("nmt", "sync", "emcy", "time", "tpdo", "rpdo", "sdo", "heartbeat", "other")
_COB_TIME: Final = 0x100


@dataclass(frozen=True, slots=True)
class Decoded:
    """One decoded frame."""

    service: str
    """One of SERVICES."""
    title: str
    """The service, with the number of a PDO."""
    node_id: int | None
    """The node that sends or receives the frame; None for all nodes or none."""
    node: str
    """The name of that node: the joint's name, `host`, or the node id."""
    text: str
    fields: tuple[dict[str, Any], ...] = ()
    """The values in a PDO, with their names in the object table."""


class Decoder:
    """Decodes frames, with the nodes' names by their ids."""

    def __init__(self, names: dict[int, str]) -> None:
        self._names = {HOST_NODE_ID: "host"} | names

    def decode(self, cob_id: int, data: bytes) -> Decoded:
        """Decode a frame with an 11-bit identifier; a frame that is not CANopen is `other`, with its bytes."""
        if cob_id == COB_NMT:
            return self._nmt(data)
        if cob_id == COB_SYNC:
            return Decoded("sync", "SYNC", None, "all", f"counter {data[0]}" if data else "")
        if cob_id == _COB_TIME:
            return Decoded("time", "TIME", None, "all", data.hex(" "))
        base, node_id = cob_id & ~NODE_ID_MAX, cob_id & NODE_ID_MAX
        if node_id and base in _MAPPINGS:
            return self._pdo(base, node_id, data)
        if node_id and base in _TEXTS:
            service, title, text = _TEXTS[base]
            return Decoded(service, title, node_id, self._name(node_id), text(data))
        return Decoded("other", f"{cob_id:03X}", None, "-", data.hex(" "))

    def _name(self, node_id: int) -> str:
        return self._names.get(node_id, f"0x{node_id:02X}")

    def _nmt(self, data: bytes) -> Decoded:
        if len(data) != 2:
            return Decoded("nmt", "NMT", None, "all", f"malformed: {data.hex(' ')}")
        known = data[0] in set(NmtCommand)
        text = words(NmtCommand(data[0])) if known else f"unknown command {data[0]}"
        return Decoded("nmt", "NMT", data[1] or None, self._name(data[1]) if data[1] else "all", text)

    def _pdo(self, base: int, node_id: int, data: bytes) -> Decoded:
        service, title, mapping = _MAPPINGS[base]
        fields = pdo_fields(mapping, data)
        if fields is None:
            return Decoded(service, title, node_id, self._name(node_id), f"too short: {data.hex(' ')}")
        text = ", ".join(
            f"{field['name']} {value_text(field['index'], field['subindex'], field['value'])}" for field in fields
        )
        return Decoded(service, title, node_id, self._name(node_id), text, tuple(fields))


def _emcy(data: bytes) -> str:
    if len(data) != 8:
        return f"malformed: {data.hex(' ')}"
    code, register, detail = int.from_bytes(data[:2], "little"), data[2], int.from_bytes(data[3:], "little")
    error = error_text(code) if code else "no error"
    place = f" ({words(Overrun(detail))})" if code == ErrorCode.CAN_OVERRUN and detail in set(Overrun) else ""
    return f"{error} (0x{code:04X}), register 0x{register:02X}, detail {detail}{place}"


def _heartbeat(data: bytes) -> str:
    if len(data) != 1:
        return f"malformed: {data.hex(' ')}"
    if data[0] == NmtState.INITIALISING:
        return "boot-up"
    known = data[0] in set(NmtState)
    return NmtState(data[0]).name.replace("_", "-") if known else f"unknown state {data[0]}"


_MAPPINGS: Final[dict[int, tuple[str, str, tuple[int, ...]]]] = {
    **{COB_TPDO[i]: ("tpdo", f"TPDO{i + 1}", pdo.mapping) for i, pdo in enumerate(TPDO_DEFAULTS)},
    **{COB_RPDO[i]: ("rpdo", f"RPDO{i + 1}", pdo.mapping) for i, pdo in enumerate(RPDO_DEFAULTS)},
}
_TEXTS: Final[dict[int, tuple[str, str, Callable[[bytes], str]]]] = {
    COB_EMCY: ("emcy", "EMCY", _emcy),
    COB_SDO_REQUEST: ("sdo", "SDO", request_text),
    COB_SDO_RESPONSE: ("sdo", "SDO", response_text),
    COB_HEARTBEAT: ("heartbeat", "HEARTBEAT", _heartbeat),
}
