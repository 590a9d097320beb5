"""Values by the object table: names and types of entries, and PDOs as they are mapped after power-up."""

from typing import Any, Final

from steptwin.host.client.words import error_text, mode_text, state_text
from steptwin.protocol import od
from steptwin.protocol.cia402 import Mode, State
from steptwin.protocol.datatypes import DataType
from steptwin.protocol.objects import OBJECTS, Entry

_OBJECTS: Final = {item.index: item for item in OBJECTS}

Mapping = tuple[tuple[int, int, int], ...]
"""Index, sub-index and bits of each mapped entry."""


def named_entry(index: int, subindex: int) -> Entry | None:
    """The entry of the object table; None if there is none."""
    item = _OBJECTS.get(index)
    return item.entries.get(subindex) if item else None


def entry_text(index: int, subindex: int, data: bytes) -> str:
    """An entry's value as it travels: a number, a text, or bytes if the table does not know it."""
    entry = named_entry(index, subindex)
    if entry is None or (entry.data_type.size and entry.data_type.size != len(data)):
        return data.hex(" ")
    if entry.data_type is DataType.VISIBLE_STRING:
        return repr(data.decode("ascii", "replace"))
    value = int.from_bytes(data, "little", signed=entry.data_type.signed)
    return value_text(index, subindex, value)


def value_text(index: int, subindex: int, value: int) -> str:
    """A number, with words for those that are codes."""
    words = _WORDS.get(od.address_of(index, subindex))
    return words(value) if words else str(value)


def pdo_fields(mapping: Mapping, data: bytes) -> list[dict[str, Any]] | None:
    """The mapped entries with their values; None if the data are shorter than the mapping."""
    bits = sum(width for _, _, width in mapping)
    if len(data) * 8 < bits:
        return None
    word, fields, shift = int.from_bytes(data, "little"), [], 0
    for index, subindex, width in mapping:
        value = word >> shift & ((1 << width) - 1)
        shift += width
        entry = named_entry(index, subindex)
        assert entry is not None  # the table's own mappings
        if entry.data_type.signed and value >> (width - 1):
            value -= 1 << width
        fields.append({"index": index, "subindex": subindex, "name": entry.name, "value": value})
    return fields


def _statusword(value: int) -> str:
    try:
        return f"0x{value:04X} {state_text(State.of(value))}"
    except ValueError:
        return f"0x{value:04X}"


def _mode(value: int) -> str:
    return f"{value} {mode_text(value)}" if value in set(Mode) else str(value)


def _error(value: int) -> str:
    return f"0x{value:04X} {error_text(value)}"


def _hexadecimal(value: int) -> str:
    return f"0x{value:X}"


_WORDS: Final = {
    od.STATUSWORD: _statusword,
    od.CONTROLWORD: lambda value: f"0x{value:04X}",
    od.MODE_OF_OPERATION: _mode,
    od.MODE_OF_OPERATION_DISPLAY: _mode,
    od.ERROR_CODE: _error,
    od.DEVICE_TYPE: _hexadecimal,
    od.ERROR_REGISTER: _hexadecimal,
    od.DIGITAL_INPUTS: _hexadecimal,
    od.DIGITAL_OUTPUTS: _hexadecimal,
    od.PVT_FLAGS: _hexadecimal,
}
