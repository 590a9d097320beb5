"""Decode CAN frames by the predefined connection set (CiA 301, section 7.3.5): service, node and content.

PDOs are decoded with their default mapping; with another mapping the values have wrong names.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Final

from steptwin.host.client.words import error_text, mode_text, state_text, words
from steptwin.protocol import od
from steptwin.protocol.cia402 import ErrorCode, Mode, Overrun, State
from steptwin.protocol.entry import DataType, Entry
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
from steptwin.protocol.objects import ENTRIES, RPDO_DEFAULTS, TPDO_DEFAULTS
from steptwin.protocol.sdo_frames import EXPEDITED, SDO_BYTES, SIZE_INDICATED, AbortCode, named_address, value_bytes

# --- names and values by the object table


def named_entry(index: int, subindex: int) -> Entry | None:
    """Return the entry of the object table; None if it does not exist."""
    return ENTRIES.get(od.address_of(index, subindex))


def entry_text(index: int, subindex: int, data: bytes) -> str:
    """Format the value in an SDO frame: a number, a string, or bytes if the object table has no such entry."""
    entry = named_entry(index, subindex)
    if entry is None or (entry.data_type.size and entry.data_type.size != len(data)):
        return data.hex(" ")
    if entry.data_type is DataType.VISIBLE_STRING:
        return repr(data.decode("ascii", "replace"))
    value = int.from_bytes(data, "little", signed=entry.data_type.signed)
    return value_text(index, subindex, value)


def value_text(index: int, subindex: int, value: int) -> str:
    """Format a number; name it if it is a code."""
    text_of = _VALUES.get(od.address_of(index, subindex))
    return text_of(value) if text_of else str(value)


def pdo_fields(mapping: tuple[int, ...], data: bytes) -> list[dict[str, Any]] | None:
    """Return the mapped entries with their values; None if the data are shorter than the mapping."""
    entries = [ENTRIES[address] for address in mapping]
    if len(data) < sum(entry.data_type.size for entry in entries):
        return None
    word, fields, shift = int.from_bytes(data, "little"), [], 0
    for address, entry in zip(mapping, entries, strict=True):
        width = 8 * entry.data_type.size
        value = word >> shift & ((1 << width) - 1)
        shift += width
        if entry.data_type.signed and value >> (width - 1):
            value -= 1 << width
        index, subindex = od.index_and_subindex(address)
        fields.append({"index": index, "subindex": subindex, "name": entry.name, "value": value})
    return fields


def _statusword(value: int) -> str:
    try:
        return f"0x{value:04X} {state_text(State.of(value))}"
    except ValueError:
        return f"0x{value:04X}"


def _mode(value: int) -> str:
    return f"{value} {mode_text(value)}" if value in set(Mode) else str(value)


def _error_value(value: int) -> str:
    return f"0x{value:04X} {error_text(value)}"


def _hexadecimal(value: int) -> str:
    return f"0x{value:X}"


_VALUES: Final = {
    od.STATUSWORD: _statusword,
    od.CONTROLWORD: lambda value: f"0x{value:04X}",
    od.MODE_OF_OPERATION: _mode,
    od.MODE_OF_OPERATION_DISPLAY: _mode,
    od.ERROR_CODE: _error_value,
    od.DEVICE_TYPE: _hexadecimal,
    od.ERROR_REGISTER: _hexadecimal,
    od.DIGITAL_INPUTS: _hexadecimal,
    od.DIGITAL_OUTPUTS: _hexadecimal,
    od.PVT_FLAGS: _hexadecimal,
}


# --- services

_CLIENT: Final = {0: "download segment", 3: "upload segment", 5: "block upload", 6: "block download"}
_SERVER: Final = {0: "upload segment", 1: "download segment taken", 5: "block download", 6: "block upload"}


def request_text(data: bytes) -> str:
    """Describe a client's request to a node."""
    return _text(data, {1: "write", 2: "read"}, 1, _CLIENT)


def response_text(data: bytes) -> str:
    """Describe a node's response."""
    return _text(data, {2: "is", 3: "written"}, 2, _SERVER)


def _text(data: bytes, initiates: dict[int, str], with_value: int, others: dict[int, str]) -> str:
    """Describe a frame by its command specifier; those of `initiates` carry an object, `with_value` also a value."""
    if len(data) != SDO_BYTES:
        return f"malformed: {len(data)} bytes"
    specifier = data[0] >> 5
    if specifier == 4:
        return f"{_object(data)} aborted: {_abort(int.from_bytes(data[4:], 'little'))}"
    if specifier not in initiates:
        return others.get(specifier, "unknown command")
    return f"{_object(data)} {initiates[specifier]}{_value(data) if specifier == with_value else ''}"


def _object(data: bytes) -> str:
    index, subindex = od.index_and_subindex(named_address(data))
    entry = named_entry(index, subindex)
    return f"{index:04X}:{subindex:02X}" + (f" {entry.name}" if entry else "")


def _value(data: bytes) -> str:
    if not data[0] & EXPEDITED:
        size = int.from_bytes(data[4:], "little")
        return f" in segments of {size} bytes together" if data[0] & SIZE_INDICATED else " in segments"
    return f" {entry_text(*od.index_and_subindex(named_address(data)), value_bytes(data))}"


def _abort(code: int) -> str:
    if code in set(AbortCode):
        return f"{words(AbortCode(code))} (0x{code:08X})"
    return f"0x{code:08X}"


SERVICES: Final = ("nmt", "sync", "emcy", "time", "tpdo", "rpdo", "sdo", "heartbeat", "other")
_COB_TIME: Final = 0x100


@dataclass(frozen=True, slots=True)
class Decoded:
    """One decoded frame."""

    service: str
    """One of SERVICES."""
    title: str
    """Name of the service, with the number of a PDO."""
    node_id: int | None
    """Node that sends or receives the frame; None for all nodes or none."""
    node: str
    """Name of that node: the joint's name, `host`, or the node id."""
    text: str
    fields: tuple[dict[str, Any], ...] = ()
    """Values of a PDO, with their names in the object table."""


class Decoder:
    """Decodes frames; `names` are the nodes' names by their ids."""

    def __init__(self, names: dict[int, str]) -> None:
        self._names = {HOST_NODE_ID: "host"} | names

    def decode(self, cob_id: int, data: bytes) -> Decoded:
        """Decode a frame with an 11-bit identifier; a frame outside of CANopen has the service `other`."""
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
