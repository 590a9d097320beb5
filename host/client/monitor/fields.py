"""Name and format values by the object table, in SDO frames and in PDOs."""

from typing import Any, Final

from steptwin.host.client.words import error_text, mode_text, state_text
from steptwin.protocol import od
from steptwin.protocol.cia402 import Mode, State
from steptwin.protocol.entry import DataType, Entry
from steptwin.protocol.objects import ENTRIES


def named_entry(index: int, subindex: int) -> Entry | None:
    """Return the entry of the object table; None if it does not exist."""
    return ENTRIES.get(od.address_of(index, subindex))


def entry_text(index: int, subindex: int, data: bytes) -> str:
    """Return the value in an SDO frame as text: a number, a string, or bytes if the table does not have the entry."""
    entry = named_entry(index, subindex)
    if entry is None or (entry.data_type.size and entry.data_type.size != len(data)):
        return data.hex(" ")
    if entry.data_type is DataType.VISIBLE_STRING:
        return repr(data.decode("ascii", "replace"))
    value = int.from_bytes(data, "little", signed=entry.data_type.signed)
    return value_text(index, subindex, value)


def value_text(index: int, subindex: int, value: int) -> str:
    """Return a number as text, in words if it is a code."""
    text_of = _TEXTS.get(od.address_of(index, subindex))
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


def _error(value: int) -> str:
    return f"0x{value:04X} {error_text(value)}"


def _hexadecimal(value: int) -> str:
    return f"0x{value:X}"


_TEXTS: Final = {
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
