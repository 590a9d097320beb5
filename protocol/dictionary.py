"""Hold the values of one node's object dictionary, with the checks of CiA 301, bound to the parts of the firmware."""

from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from functools import partial
from operator import attrgetter
from typing import Any, Final

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


TEXT_BYTES_MAX: Final = 64
"""Length of the longest text that an entry takes."""


@dataclass(slots=True)
class FlashPage:
    """A node's stored parameters by address; the page's owner keeps it while the power is off."""

    values: dict[int, int] = field(default_factory=dict)
    texts: dict[int, str] = field(default_factory=dict)
    node_id: int | None = None
    """The node id that a master has given the node by LSS; None if none has."""


_INDICES: Final = frozenset(address >> 8 for address in ENTRIES)
_TEXTS: Final = {
    address: str(entry.default) for address, entry in ENTRIES.items() if entry.data_type is DataType.VISIBLE_STRING
}
"""Strings after power-up without stored ones; they do not depend on the node."""
_NUMBERS: Final = [(address, int(entry.default)) for address, entry in ENTRIES.items() if address not in _TEXTS]
"""Values of the other entries after power-up, less the node id of those that contain it."""
_WITH_NODE_ID: Final = [address for address, _ in _NUMBERS if ENTRIES[address].plus_node_id]


def _by_class(handlers: Iterable[tuple[int, str]]) -> dict[str, list[tuple[int, str]]]:
    """Return the addresses, and the names within the class, of what "Class.name" names, by class."""
    by_class: dict[str, list[tuple[int, str]]] = {}
    for address, handler in handlers:
        owner, _, name = handler.partition(".")
        by_class.setdefault(owner, []).append((address, name))
    return by_class


_READ_FROM: Final = _by_class((address, entry.read) for address, entry in ENTRIES.items())
_OBEYED_BY: Final = _by_class((address, entry.write) for address, entry in ENTRIES.items())


class Cell:
    """One numeric entry of a node: the value stored, the values allowed, and the firmware's part in it."""

    __slots__ = ("_high", "_low", "_type", "_values", "obey", "supply", "value")

    def __init__(self, entry: Entry) -> None:
        self.value: int = 0
        self._type = entry.data_type
        self._low = entry.data_type.low if entry.low is None else entry.low
        self._high = entry.data_type.high if entry.high is None else entry.high
        self._values = entry.values
        self.supply: Callable[[], int] | None = None
        """Returns the present value; None if that is the value stored."""
        self.obey: Callable[[int], None] | None = None
        """Acts on a value before it is stored, or refuses it; None if storing it is all."""

    @property
    def plain(self) -> bool:
        """True if every value of the entry's type is allowed and storing it is all."""
        bounded = (self._low, self._high) != (self._type.low, self._type.high)
        return not bounded and self._values is None and self.obey is None

    def get(self) -> int:
        """Return the present value; one beyond the range of the entry's type is shown as the end of that range."""
        if self.supply is None:
            return self.value
        value = self.supply()
        if value > self._type.high:
            return self._type.high
        return value if value >= self._type.low else self._type.low

    def put(self, value: int) -> None:
        """Store a decoded value that came over the bus, after its checks; the firmware obeys it before it is stored.

        Raises:
            SdoAbortError: the value is not allowed or the firmware refuses it.
        """
        if not self._low <= value <= self._high:
            raise SdoAbortError(AbortCode.VALUE_TOO_HIGH if value > self._high else AbortCode.VALUE_TOO_LOW)
        if self._values is not None and value not in self._values:
            raise SdoAbortError(AbortCode.VALUE_RANGE)
        if self.obey is not None:
            self.obey(value)
        self.value = value

    def count(self) -> None:
        """Add one, unless the value is the highest of its type already."""
        if self.value < self._type.high:
            self.value += 1


class ObjectDictionary:
    """One node's object dictionary.

    The bus uses `read` and `write`, which check access, length and range and raise SdoAbortError. The firmware uses
    `get` and `set`, which check nothing. The rows of `od` name the firmware's part that supplies an entry's present
    value, and the one that obeys a value written; `bind` finds them there.
    """

    def __init__(self, node_id: int, *, stored: FlashPage | None = None) -> None:
        self.entries = ENTRIES
        self._node_id = node_id
        self._stored = FlashPage() if stored is None else stored
        self._cells = {address: Cell(ENTRIES[address]) for address, _ in _NUMBERS}
        self._texts: dict[int, str] = {}
        self.reset()

    def renumber(self, node_id: int) -> None:
        """Take another node id, which the defaults that contain it have from the next `reset` on."""
        self._node_id = node_id

    def bind(self, part: object) -> None:
        """Let a part of the firmware supply and obey the entries that name its class."""
        kind = type(part)
        for address, name in _READ_FROM.get(kind.__name__, ()):
            is_method = callable(getattr(kind, name, None))
            method = _method(part, name, address) if is_method else partial(attrgetter(name), part)
            self._cells[address].supply = method
        for address, name in _OBEYED_BY.get(kind.__name__, ()):
            self._cells[address].obey = _method(part, name, address)

    def reset(self, first_index: int = 0x1000, last_index: int = 0xFFFF) -> None:
        """Give every entry in the index range its power-up value again, stored or default; nothing obeys it."""
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
        cell = self._cells[address]
        return cell.value if cell.supply is None else cell.get()

    def text(self, address: int) -> str:
        """Return the present value of a string."""
        return self._texts[address]

    def cell(self, address: int) -> Cell:
        """Return the place of a numeric entry, for hot paths."""
        return self._cells[address]

    def is_signed(self, address: int) -> bool:
        """Return whether a numeric entry has a sign."""
        return self.entries[address].data_type.signed

    def set(self, address: int, value: int) -> None:
        """Store a value of the firmware's own, without checks."""
        self._cells[address].value = value

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
            SdoAbortError: the entry does not exist or is read-only, or the value has the wrong length, is not allowed
                or is refused by the firmware.
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
        self._cells[address].put(decode(data_type, data))

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


def _method(part: object, name: str, address: int) -> Callable[..., Any]:
    """Return a part's method, with the address of the entry if it takes it."""
    method: Callable[..., Any] = getattr(part, name)
    return partial(method, address) if name.endswith("_at") else method


def _visible(data: bytes) -> str:
    """Return the text of a visible string (CiA 301 table 44: 20h to 7Eh, and an end of 0); refuse any other byte."""
    text = data.rstrip(b"\0")
    if any(not 0x20 <= byte <= 0x7E for byte in text):
        raise SdoAbortError(AbortCode.VALUE_RANGE)
    return text.decode("ascii")
