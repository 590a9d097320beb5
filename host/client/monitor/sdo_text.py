"""Describe SDO frames in words (CiA 301, section 7.2.4.3): object, value, abort code, or part of a longer transfer."""

from typing import Final

from steptwin.host.client.monitor.fields import entry_text, named_entry
from steptwin.host.client.words import words
from steptwin.protocol.abort import AbortCode

_EXPEDITED, _SIZED = 0x02, 0x01
_CLIENT: Final = {0: "download segment", 3: "upload segment", 5: "block upload", 6: "block download"}
_SERVER: Final = {0: "upload segment", 1: "download segment taken", 5: "block download", 6: "block upload"}


def request_text(data: bytes) -> str:
    """Describe a client's request to a node."""
    return _text(data, {1: "write", 2: "read"}, 1, _CLIENT)


def response_text(data: bytes) -> str:
    """Describe a node's response."""
    return _text(data, {2: "is", 3: "written"}, 2, _SERVER)


def _text(data: bytes, initiates: dict[int, str], with_value: int, others: dict[int, str]) -> str:
    """Describe a frame by its command specifier; those in `initiates` carry an object, `with_value` a value, too."""
    if len(data) != 8:
        return f"malformed: {len(data)} bytes"
    specifier = data[0] >> 5
    if specifier == 4:
        return f"{_object(data)} aborted: {_abort(int.from_bytes(data[4:], 'little'))}"
    if specifier not in initiates:
        return others.get(specifier, "unknown command")
    return f"{_object(data)} {initiates[specifier]}{_value(data) if specifier == with_value else ''}"


def _object(data: bytes) -> str:
    index, subindex = int.from_bytes(data[1:3], "little"), data[3]
    entry = named_entry(index, subindex)
    return f"{index:04X}:{subindex:02X}" + (f" {entry.name}" if entry else "")


def _value(data: bytes) -> str:
    if not data[0] & _EXPEDITED:
        size = int.from_bytes(data[4:], "little")
        return f" in segments of {size} bytes together" if data[0] & _SIZED else " in segments"
    unused = data[0] >> 2 & 3 if data[0] & _SIZED else 0
    index, subindex = int.from_bytes(data[1:3], "little"), data[3]
    return f" {entry_text(index, subindex, data[4 : 8 - unused])}"


def _abort(code: int) -> str:
    if code in set(AbortCode):
        return f"{words(AbortCode(code))} (0x{code:08X})"
    return f"0x{code:08X}"
