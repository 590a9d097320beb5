"""Hold the values of one node's object dictionary, with the checks of CiA 301 and hooks for values kept elsewhere."""

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Final

from steptwin.protocol.abort import AbortCode, SdoAbortError
from steptwin.protocol.entry import Access, DataType, Entry, decode, encode
from steptwin.protocol.frame import COB_ID_INVALID, COB_ID_MASK
from steptwin.protocol.objects import ENTRIES

_RESTRICTED = ((0x000, 0x080), (0x101, 0x180), (0x581, 0x5FF), (0x601, 0x67F), (0x6E0, 0x7FF))
"""COB-IDs that CiA 301 keeps for other services (table 40): NMT, SYNC, SDO, heartbeat and others."""


def check_cob_id(old: int, new: int, flags: int = 0) -> None:
    """Check whether a COB-ID entry may change from `old` to `new`.

    The identifier has 11 bits and belongs to no other service; of the bits above it only `flags` and "invalid" may be
    set. The identifier of a valid entry may not change: the entry must be made invalid first.

    Raises:
        SdoAbortError: the value is refused.
    """
    identifier = new & ~(COB_ID_INVALID | flags)
    if identifier > COB_ID_MASK or any(first <= identifier <= last for first, last in _RESTRICTED):
        raise SdoAbortError(AbortCode.VALUE_RANGE)
    if not (old | new) & COB_ID_INVALID and (old ^ new) & COB_ID_MASK:
        raise SdoAbortError(AbortCode.VALUE_RANGE)


ReadHook = Callable[[], int]
WriteHook = Callable[[int], None]
TEXT_BYTES_MAX: Final = 64
"""Length of the longest text that an entry takes."""


@dataclass(slots=True)
class FlashPage:
    """A node's stored parameters by address; the page's owner keeps it while the power is off."""

    values: dict[int, int] = field(default_factory=dict)
    texts: dict[int, str] = field(default_factory=dict)


def _bounds(entry: Entry) -> tuple[int, int]:
    low = entry.data_type.low if entry.low is None else entry.low
    high = entry.data_type.high if entry.high is None else entry.high
    return low, high


_INDICES: Final = frozenset(address >> 8 for address in ENTRIES)
_TEXTS: Final = {
    address: str(entry.default) for address, entry in ENTRIES.items() if entry.data_type is DataType.VISIBLE_STRING
}
"""Strings after power-up without stored ones; they do not depend on the node."""
_NUMBERS: Final = [(address, int(entry.default)) for address, entry in ENTRIES.items() if address not in _TEXTS]
"""Values of the other entries after power-up, less the node id of those that contain it."""
_WITH_NODE_ID: Final = [address for address, _ in _NUMBERS if ENTRIES[address].plus_node_id]
_GREATEST: Final = {address: ENTRIES[address].data_type.high for address, _ in _NUMBERS}
"""Greatest value of each entry's type."""
_BOUNDS: Final = {
    address: _bounds(entry) for address, entry in ENTRIES.items() if entry.low is not None or entry.high is not None
}
"""Ranges of the entries whose range is narrower than that of their type."""


class Cell:
    """The place of one numeric value."""

    __slots__ = ("value",)

    def __init__(self, value: int) -> None:
        self.value = value


class Reader:
    """Reads a numeric entry as `ObjectDictionary.get` does, without looking it up."""

    __slots__ = ("_cell", "_hook")

    def __init__(self, cell: Cell, hook: ReadHook | None) -> None:
        self._cell = cell
        self._hook = hook

    def get(self) -> int:
        """Return the present value."""
        return self._cell.value if self._hook is None else self._hook()


class Writer:
    """Writes a numeric entry as `ObjectDictionary.put` does, without looking it up."""

    __slots__ = ("_bounded", "_cell", "_high", "_hook", "_low")

    def __init__(self, cell: Cell, bounds: tuple[int, int] | None, hook: WriteHook | None) -> None:
        self._cell = cell
        self._bounded = bounds is not None
        self._low, self._high = bounds or (0, 0)
        self._hook = hook

    def put(self, value: int) -> None:
        """Check the range, call the write hook, then store the value; raises as `ObjectDictionary.put`."""
        if self._bounded and not self._low <= value <= self._high:
            raise SdoAbortError(AbortCode.VALUE_TOO_HIGH if value > self._high else AbortCode.VALUE_TOO_LOW)
        if self._hook is not None:
            self._hook(value)
        self._cell.value = value


class Counter:
    """Counts in an entry as `ObjectDictionary.count` does, without looking it up."""

    __slots__ = ("_cell", "_greatest")

    def __init__(self, cell: Cell, greatest: int) -> None:
        self._cell = cell
        self._greatest = greatest

    def add_one(self) -> None:
        """Add one, unless the counter has reached the greatest value of its type."""
        if self._cell.value < self._greatest:
            self._cell.value += 1


class ObjectDictionary:
    """One node's object dictionary.

    The bus uses `read` and `write`, which check access, length and range and raise SdoAbortError. The firmware uses
    `get` and `set`, which check nothing. A read hook supplies a value that is kept elsewhere. A write hook acts on a
    value that has passed the checks, before it is stored, and may refuse it with SdoAbortError.
    """

    def __init__(self, node_id: int, *, stored: FlashPage | None = None) -> None:
        self.entries = ENTRIES
        self._node_id = node_id
        self._stored = FlashPage() if stored is None else stored
        self._cells = {address: Cell(value) for address, value in _NUMBERS}
        self._texts: dict[int, str] = {}
        self.read_hooks: dict[int, ReadHook] = {}
        self.write_hooks: dict[int, WriteHook] = {}
        self.reset()

    def reset(self, first_index: int = 0x1000, last_index: int = 0xFFFF) -> None:
        """Give every entry in the index range its power-up value again, stored or default, without calling hooks."""
        cells, stored = self._cells, self._stored
        first, last = first_index << 8, last_index << 8 | 0xFF
        for address, value in _NUMBERS:
            if first <= address <= last:
                cells[address].value = value
        for address in _WITH_NODE_ID:
            if first <= address <= last:
                cells[address].value += self._node_id
        for address, value in stored.values.items():
            if first <= address <= last and address in cells:
                cells[address].value = value
        self._texts |= {
            address: stored.texts.get(address, default)
            for address, default in _TEXTS.items()
            if first <= address <= last
        }

    def get(self, address: int) -> int:
        """Return the present value of a numeric entry."""
        return self.read_hooks[address]() if address in self.read_hooks else self._cells[address].value

    def text(self, address: int) -> str:
        """Return the present value of a string."""
        return self._texts[address]

    def cell(self, address: int) -> Cell:
        """Return the place of a numeric entry's stored value, for hot paths: it knows neither checks nor hooks."""
        return self._cells[address]

    def reader(self, address: int) -> Reader:
        """Return a reader of a numeric entry, for hot paths; call this after all hooks are installed."""
        return Reader(self._cells[address], self.read_hooks.get(address))

    def writer(self, address: int) -> Writer:
        """Return a writer of a numeric entry, for hot paths; call this after all hooks are installed."""
        return Writer(self._cells[address], _BOUNDS.get(address), self.write_hooks.get(address))

    def set(self, address: int, value: int) -> None:
        """Store a value of the firmware's own, without checks or hooks."""
        self._cells[address].value = value

    def counter(self, address: int) -> Counter:
        """Return a counter, for hot paths."""
        return Counter(self._cells[address], _GREATEST[address])

    def count(self, address: int) -> None:
        """Add one to a counter, unless it has reached the greatest value of its type."""
        self.counter(address).add_one()

    def put(self, address: int, value: int) -> None:
        """Store a decoded value that came over the bus: check its range, call the write hook, then store it.

        Raises:
            SdoAbortError: the value is out of range or the hook refuses it.
        """
        self.writer(address).put(value)

    def read(self, address: int) -> bytes:
        """Return an entry's bytes.

        Raises:
            SdoAbortError: the object or sub-index does not exist, or the entry is write-only.
        """
        entry = self._entry(address)
        if entry.access is Access.WRITE_ONLY:
            raise SdoAbortError(AbortCode.WRITE_ONLY)
        if entry.data_type is DataType.VISIBLE_STRING:
            return encode(entry.data_type, self._texts[address])
        return encode(entry.data_type, self.get(address))

    def write(self, address: int, data: bytes) -> None:
        """Write an entry from its bytes.

        Raises:
            SdoAbortError: the entry does not exist or is read-only, or the value has the wrong length, is out of range
                or is refused by the write hook.
        """
        size = self.size_to_write(address)
        if len(data) > size:
            raise SdoAbortError(AbortCode.LENGTH_TOO_HIGH)
        data_type = self._entry(address).data_type
        if data_type is DataType.VISIBLE_STRING:
            self._texts[address] = _visible(data)
            return
        if len(data) < size:
            raise SdoAbortError(AbortCode.LENGTH_TOO_LOW)
        self.put(address, decode(data_type, data))

    def size_to_write(self, address: int) -> int:
        """Return the number of bytes that a write to an entry must have, or may have if it is a string.

        Raises:
            SdoAbortError: the object or sub-index does not exist, or the entry is read-only.
        """
        entry = self._entry(address)
        if entry.access not in (Access.READ_WRITE, Access.WRITE_ONLY):
            raise SdoAbortError(AbortCode.READ_ONLY)
        return TEXT_BYTES_MAX if entry.data_type is DataType.VISIBLE_STRING else entry.data_type.size

    def _entry(self, address: int) -> Entry:
        entry = self.entries.get(address)
        if entry is None:
            raise SdoAbortError(AbortCode.NO_SUBINDEX if address >> 8 in _INDICES else AbortCode.NO_OBJECT)
        return entry


def _visible(data: bytes) -> str:
    """Return the text of a visible string (CiA 301 table 44: 20h to 7Eh, and an end of 0); refuse any other byte."""
    text = data.rstrip(b"\0")
    if any(not 0x20 <= byte <= 0x7E for byte in text):
        raise SdoAbortError(AbortCode.VALUE_RANGE)
    return text.decode("ascii")
