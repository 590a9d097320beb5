"""A simple node's object dictionary: entries as data, and their checked values."""

import struct
from collections.abc import Callable, Collection, Iterable, Mapping
from dataclasses import dataclass
from enum import Enum
from typing import Final

from steptwin.protocol.entry import Access
from steptwin.protocol.objects import DUMMY_BITS
from steptwin.protocol.sdo_frames import AbortCode, SdoAbortError

RPDOS: Final = range(0x1400, 0x1600)
RPDO_MAPS: Final = range(0x1600, 0x1800)
TPDOS: Final = range(0x1800, 0x1A00)
TPDO_MAPS: Final = range(0x1A00, 0x1C00)
"""Indexes of the parameters of up to 512 PDOs each way (CiA 301, table 41)."""
_MAPS_FROM: Final = RPDO_MAPS.start - RPDOS.start
PDO_BITS_MAX: Final = 64


class ValueForm(Enum):
    """Meaning of an entry's bytes; the member's value is the type in Python."""

    WHOLE = "whole number"
    REAL = "number"
    TEXT = "text"
    """ASCII for a visible string; some devices write ISO 8859-1, or UTF-8 for further characters."""
    WIDE_TEXT = "text in Unicode"
    BYTES = "bytes"


NodeValue = int | float | str | bytes
_REALS: Final = {32: "<f", 64: "<d"}
_WIDE: Final = "utf-16-le"
BYTES_MAX: Final = 4096
"""Longest text and longest bytes of an entry."""


@dataclass(frozen=True, slots=True)
class NodeEntry:
    """One entry of a simple node's dictionary.

    Attributes:
        name: name in the description.
        form: meaning of its bytes.
        bits: width of its value; 0 for text and bytes of any length.
        signed: True for a number with a sign.
        access: access by SDO.
        default: value after power-up, in its form.
        low: lowest whole number that may be written; None: that of the type.
        high: highest one.
        mappable: True if PDOs may carry it.
    """

    name: str
    form: ValueForm
    bits: int
    signed: bool
    access: Access
    default: NodeValue
    low: int | None = None
    high: int | None = None
    mappable: bool = False

    @property
    def size(self) -> int:
        """Bytes of a value in an SDO; 0 for any length."""
        return -(-self.bits // 8)

    @property
    def range(self) -> tuple[int, int]:
        """Whole numbers of its type."""
        least = -(1 << self.bits - 1) if self.signed else 0
        return least, least + (1 << self.bits) - 1

    def to_bytes(self, value: NodeValue) -> bytes:
        """Return a value's bytes.

        Raises:
            ValueError: the type does not have this value.
        """
        match self.form, value:
            case ValueForm.WHOLE, int() if not isinstance(value, bool) or self.bits == 1:
                least, most = self.range
                if not least <= value <= most:
                    raise ValueError(f"{value} is not from {least} to {most}")
                return int(value).to_bytes(self.size, "little", signed=self.signed)
            case ValueForm.REAL, int() | float() if not isinstance(value, bool):
                try:
                    return struct.pack(_REALS[self.bits], value)
                except (OverflowError, struct.error):
                    raise ValueError(f"{value} does not fit into {self.bits} bits") from None
            case ((ValueForm.TEXT | ValueForm.WIDE_TEXT), str()):
                return self._text_bytes(value)
            case ValueForm.BYTES, bytes():
                return value
        raise ValueError(f"{value!r} is no {self.form.value}")

    def _text_bytes(self, text: str) -> bytes:
        try:
            if self.form is ValueForm.WIDE_TEXT:
                return text.encode(_WIDE)
            data = text.encode("latin-1", "replace")
            return data if _text_of(data) == text else text.encode()
        except UnicodeEncodeError:
            raise ValueError(f"{text!r} has characters that the type does not have") from None

    def to_value(self, data: bytes) -> NodeValue:
        """Return the value of bytes of the right length."""
        match self.form:
            case ValueForm.WHOLE:
                return int.from_bytes(data, "little", signed=self.signed)
            case ValueForm.REAL:
                real: float = struct.unpack(_REALS[self.bits], data)[0]
                return real
            case ValueForm.TEXT:
                return _text_of(data)
            case ValueForm.WIDE_TEXT:
                return data.decode(_WIDE, "replace")
            case ValueForm.BYTES:
                return data


def _text_of(data: bytes) -> str:
    """Return the text of a device's bytes: UTF-8 if valid, else ISO 8859-1."""
    try:
        return data.decode()
    except UnicodeDecodeError:
        return data.decode("latin-1")


@dataclass(frozen=True, slots=True)
class NodeDescription:
    """A simple node: its id, the file that describes it, its entries by address, and the dummies that RPDOs may map."""

    node_id: int
    source: str
    entries: Mapping[int, NodeEntry]
    dummies: Collection[int] = frozenset(DUMMY_BITS)


class NodeCell:
    """One numeric entry as PDOs access it; real numbers are stored as their bits."""

    plain = False
    """False: each value from a PDO is checked, and its change reported."""

    def __init__(self, address: int, entry: NodeEntry, changed: Callable[[int], None]) -> None:
        self.value: int = 0
        self._address, self._entry, self._changed = address, entry, changed

    def get(self) -> int:
        """Return the value."""
        return self.value

    def put(self, value: int) -> None:
        """Store a value; raise SdoAbortError if it is outside the limits."""
        low, high = self._entry.low, self._entry.high
        if high is not None and value > high:
            raise SdoAbortError(AbortCode.VALUE_TOO_HIGH)
        if low is not None and value < low:
            raise SdoAbortError(AbortCode.VALUE_TOO_LOW)
        if value != self.value:
            self.value = value
            self._changed(self._address)


def _ignore(_address: int) -> None:
    """Note nothing."""


class NodeObjects:
    """A simple node's dictionary, for its SDO server, its PDOs and the machine around it.

    The node sets two functions. `changed` is called with the address of each changed value. `check` is called with
    address and value before a number from an SDO is stored; it may raise SdoAbortError.
    """

    def __init__(self, description: NodeDescription) -> None:
        self.entries: Mapping[int, NodeEntry] = description.entries
        self._dummies = description.dummies
        self.changed: Callable[[int], None] = _ignore
        self.check: Callable[[int, int], None] = lambda _address, _value: None
        self._indices = frozenset(address >> 8 for address in self.entries)
        self._cells: dict[int, NodeCell] = {}
        self._bytes: dict[int, bytes] = {}
        for address, entry in self.entries.items():
            if entry.bits:
                self._cells[address] = NodeCell(address, entry, self._note)
        self.reset()

    def _note(self, address: int) -> None:
        self.changed(address)

    def reset(self, first_index: int = 0x1000, last_index: int = 0xFFFF) -> None:
        """Reset the entries of these indexes to their values after power-up, without reports of changes."""
        for address, entry in self.entries.items():
            if first_index <= address >> 8 <= last_index:
                data = entry.to_bytes(entry.default)
                if entry.bits:
                    self._cells[address].value = self._number(entry, data)
                else:
                    self._bytes[address] = data

    @staticmethod
    def _number(entry: NodeEntry, data: bytes) -> int:
        return int.from_bytes(data, "little", signed=entry.signed)

    # --- access by PDOs

    def get(self, address: int) -> int:
        """Return a number; 0 if the address has none."""
        cell = self._cells.get(address)
        return 0 if cell is None else cell.value

    def bus_cell(self, address: int) -> NodeCell:
        """Return the cell of a number; raise KeyError if the address has none."""
        return self._cells[address]

    def is_signed(self, address: int) -> bool:
        """Return whether a number has a sign."""
        return self.entries[address].signed

    def pdos(self, communications: range) -> Iterable[tuple[int, int]]:
        """Yield the parameters of each PDO in one direction: indexes of communication and mapping."""
        for index in communications:
            if index << 8 | 1 in self._cells and index + _MAPS_FROM << 8 in self._cells:
                yield index, index + _MAPS_FROM

    def why_not_mapped(self, word: int, *, received: bool) -> AbortCode | None:
        """Return why a PDO cannot carry the object of a mapping's word; None if it can."""
        address, bits = word >> 8, word & 0xFF
        if received and DUMMY_BITS.get(address >> 8) == bits and not address & 0xFF:
            return None if address >> 8 in self._dummies else AbortCode.CANNOT_BE_MAPPED
        entry = self.entries.get(address)
        if entry is None:
            return AbortCode.NO_SUBINDEX if address >> 8 in self._indices else AbortCode.NO_OBJECT
        refused = (Access.CONST, Access.READ_ONLY) if received else (Access.WRITE_ONLY,)
        if not entry.mappable or entry.bits != bits or entry.access in refused:
            return AbortCode.CANNOT_BE_MAPPED
        return None

    # --- access by SDO

    def read(self, address: int) -> bytes:
        """Return an entry's bytes.

        Raises:
            SdoAbortError: the entry does not exist or is write-only.
        """
        if self._entry(address).access is Access.WRITE_ONLY:
            raise SdoAbortError(AbortCode.WRITE_ONLY)
        return self._data(address)

    def write(self, address: int, data: bytes) -> None:
        """Write an entry from its bytes.

        Raises:
            SdoAbortError: the entry does not exist or is read-only, the length is wrong, or the value is refused.
        """
        size, entry = self.size_to_write(address), self.entries[address]
        if len(data) > size:
            raise SdoAbortError(AbortCode.LENGTH_TOO_HIGH)
        if entry.bits and len(data) < size:
            raise SdoAbortError(AbortCode.LENGTH_TOO_LOW)
        if not entry.bits:
            self._store_bytes(address, data)
            return
        number = self._number(entry, data)
        if number > entry.range[1]:  # a boolean has one bit of its byte
            raise SdoAbortError(AbortCode.VALUE_TOO_HIGH)
        self.check(address, number)
        self._cells[address].put(number)

    def size_to_write(self, address: int) -> int:
        """Return the number of bytes that a write must have; for an entry of any length, the largest number.

        Raises:
            SdoAbortError: the entry does not exist or is read-only.
        """
        entry = self._entry(address)
        if entry.access in (Access.CONST, Access.READ_ONLY):
            raise SdoAbortError(AbortCode.READ_ONLY)
        return entry.size or BYTES_MAX

    def _entry(self, address: int) -> NodeEntry:
        entry = self.entries.get(address)
        if entry is None:
            raise SdoAbortError(AbortCode.NO_SUBINDEX if address >> 8 in self._indices else AbortCode.NO_OBJECT)
        return entry

    def _data(self, address: int) -> bytes:
        entry = self.entries[address]
        if not entry.bits:
            return self._bytes[address]
        return self._cells[address].value.to_bytes(entry.size, "little", signed=entry.signed)

    def _store_bytes(self, address: int, data: bytes) -> None:
        if data != self._bytes[address]:
            self._bytes[address] = data
            self.changed(address)

    # --- access by the machine around the node

    def value(self, address: int) -> NodeValue:
        """Return an entry's value, whatever its SDO access; raise KeyError if there is no entry."""
        return self.entries[address].to_value(self._data(address))

    def set_value(self, address: int, value: NodeValue) -> None:
        """Set an entry's value, whatever its SDO access and limits.

        Raises:
            KeyError: there is no entry.
            ValueError: the type does not have this value.
        """
        entry = self.entries[address]
        data = entry.to_bytes(value)
        if len(data) > (entry.size or BYTES_MAX):
            raise ValueError(f"{len(data)} bytes are more than {BYTES_MAX}")
        if not entry.bits:
            self._store_bytes(address, data)
        elif (number := self._number(entry, data)) != self._cells[address].value:
            self._cells[address].value = number
            self.changed(address)
