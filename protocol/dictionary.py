"""Hold one node's object dictionary: check values as CiA 301 asks, and connect entries to the firmware.

The firmware counts in wire units. A bus master reads and writes in user units (CiA 402-2, factor group). A
`QuantityCell` converts between both: it stores wire units, and its `get` and `put` use user units.

The bus sees the entries of `od`, or those of a view (`object_view`), which has cells of its own.
"""

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from functools import partial
from math import gcd
from operator import attrgetter
from typing import Any, Final, NamedTuple

from steptwin.protocol import od
from steptwin.protocol.entry import QUANTITIES, Access, DataType, Entry, decode, encode
from steptwin.protocol.frame import COB_ID_INVALID, COB_ID_MASK
from steptwin.protocol.object_view import OWN_TRAITS, DriveTraits, ObjectView, ViewedCell
from steptwin.protocol.objects import ENTRIES
from steptwin.protocol.sdo_frames import AbortCode, SdoAbortError

_RESTRICTED = ((0x000, 0x07F), (0x101, 0x180), (0x581, 0x5FF), (0x601, 0x67F), (0x6E0, 0x6FF), (0x701, 0x7FF))
"""Restricted COB-IDs (CiA 301, table 40): NMT, SDO, heartbeat and reserved ones.

080h (the default of SYNC) and 700h (used by no heartbeat) are not restricted.
"""


def check_cob_id(old: int, new: int, flags: int = 0) -> None:
    """Check whether a COB-ID entry may change from `old` to `new`.

    The identifier has 11 bits and must not be restricted. Above it, only the bits `flags` and "invalid" may be set. The
    identifier of a valid entry may not change: a master must first mark the entry invalid.

    Raises:
        SdoAbortError: the value is refused.
    """
    identifier = new & ~(COB_ID_INVALID | flags)
    if identifier > COB_ID_MASK or any(first <= identifier <= last for first, last in _RESTRICTED):
        raise SdoAbortError(AbortCode.VALUE_RANGE)
    if not (old | new) & COB_ID_INVALID and (old ^ new) & COB_ID_MASK:
        raise SdoAbortError(AbortCode.VALUE_RANGE)


TEXT_BYTES_MAX: Final = 64
"""Longest text that can be written to an entry."""


@dataclass(slots=True)
class FlashPage:
    """A node's stored parameters by address. Its owner keeps it while the power is off."""

    values: dict[int, int] = field(default_factory=dict)
    texts: dict[int, str] = field(default_factory=dict)
    node_id: int | None = None
    """Node id that a master has assigned by LSS; None if none has."""
    bitrate: int | None = None
    """Bit rate, in bit/s, that a master has assigned to the board by LSS; None if none has."""


_INDICES: Final = frozenset(address >> 8 for address in ENTRIES)
_TEXTS: Final = {
    address: str(entry.default) for address, entry in ENTRIES.items() if entry.data_type is DataType.VISIBLE_STRING
}
"""Default strings."""
_NUMBERS: Final = [(address, int(entry.default)) for address, entry in ENTRIES.items() if address not in _TEXTS]
"""Default numbers, before the node id is added to those of `_WITH_NODE_ID`."""
_WITH_NODE_ID: Final = [address for address, _ in _NUMBERS if ENTRIES[address].plus_node_id]


_ALWAYS_WIRE_UNITS: Final = (od.ENCODER_UNITS, od.FEED_UNITS, od.PVT_DISPLACEMENT)
"""Entries that are never in user units: the encoder resolution, the feed constant and the PVT record."""
_QUANTITIES: Final = [
    address for address, _ in _NUMBERS if ENTRIES[address].unit in QUANTITIES and address not in _ALWAYS_WIRE_UNITS
]
"""Entries in user units."""
_PURE_NUMBERS: Final = [address for address, _ in _NUMBERS if address not in _QUANTITIES]


def _by_class(handlers: Iterable[tuple[int, str]]) -> dict[str, list[tuple[int, str]]]:
    """Group handlers "Class.name" by class: pairs of address and name within the class."""
    by_class: dict[str, list[tuple[int, str]]] = {}
    for address, handler in handlers:
        owner, _, name = handler.partition(".")
        by_class.setdefault(owner, []).append((address, name))
    return by_class


_READ_FROM: Final = _by_class((address, entry.read) for address, entry in ENTRIES.items())
_OBEYED_BY: Final = _by_class((address, entry.write) for address, entry in ENTRIES.items())


class UserUnit(NamedTuple):
    """The size of a user unit: `wire` wire units equal `user` user units, as a fraction in lowest terms.

    Both conversions round to the nearest integer, half up. A user unit is never smaller than a wire unit, so a master
    reads back each number that it has written: `to_user(to_wire(n)) == n`.
    """

    wire: int = 1
    user: int = 1

    @classmethod
    def of(cls, factors: dict[int, int]) -> "UserUnit":
        """Return the user unit that the four factors, by address, define.

        CiA 402-2: position in user units = position in wire units * feed constant (6092h) / encoder resolution (608Fh)
        / gear ratio (6091h).
        """
        wire = od.UNITS_PER_REVOLUTION * factors[od.GEAR_MOTOR_REVOLUTIONS] * factors[od.FEED_SHAFT_REVOLUTIONS]
        user = factors[od.GEAR_SHAFT_REVOLUTIONS] * factors[od.FEED_UNITS]
        divisor = gcd(wire, user)
        return cls(wire // divisor, user // divisor)

    def to_wire(self, user_units: int) -> int:
        """Return the nearest number of wire units."""
        return (2 * user_units * self.wire + self.user) // (2 * self.user)

    def to_user(self, wire_units: int) -> int:
        """Return the nearest number of user units."""
        return (2 * wire_units * self.user + self.wire) // (2 * self.wire)


FACTORS: Final = (od.GEAR_MOTOR_REVOLUTIONS, od.GEAR_SHAFT_REVOLUTIONS, od.FEED_UNITS, od.FEED_SHAFT_REVOLUTIONS)
"""Entries that define the user unit."""
_WIRE_UNIT: Final = UserUnit()


class Cell:
    """One numeric entry of a node: its stored value, its allowed values and its firmware handlers.

    The firmware uses `value` and `present`. SDO and PDO use `get` and `put`.
    """

    __slots__ = ("_type", "_values", "high", "low", "obey", "supply", "value")

    def __init__(self, entry: Entry) -> None:
        self.value: int = 0
        self._type = entry.data_type
        self.low: int = entry.data_type.low if entry.low is None else entry.low
        self.high: int = entry.data_type.high if entry.high is None else entry.high
        self._values = entry.values
        self.supply: Callable[[], int] | None = None
        """Returns the present value; None if the stored value is the present value."""
        self.obey: Callable[[int], None] | None = None
        """Acts on a written value before it is stored, or refuses it; None if nothing acts on it."""

    @property
    def plain(self) -> bool:
        """True if a write needs no check and triggers nothing: it may be stored directly."""
        bounded = (self.low, self.high) != (self._type.low, self._type.high)
        return not bounded and self._values is None and self.obey is None

    def present(self) -> int:
        """Return the present value, clamped to the range of the entry's type."""
        if self.supply is None:
            return self.value
        value = self.supply()
        if value > self._type.high:
            return self._type.high
        return value if value >= self._type.low else self._type.low

    get = present
    """Return the present value as the bus carries it."""

    def put(self, value: int) -> None:
        """Check a value from the bus, let the firmware act on it, then store it.

        Raises:
            SdoAbortError: the value is not allowed or the firmware refuses it.
        """
        if not self.low <= value <= self.high:
            raise SdoAbortError(AbortCode.VALUE_TOO_HIGH if value > self.high else AbortCode.VALUE_TOO_LOW)
        if self._values is not None and value not in self._values:
            raise SdoAbortError(AbortCode.VALUE_RANGE)
        if self.obey is not None:  # as `command`, without its call
            self.obey(value)
        self.value = value

    def command(self, value: int) -> None:
        """Let the firmware act on a value, without a check of its range, then store it."""
        if self.obey is not None:
            self.obey(value)
        self.value = value

    def count(self) -> None:
        """Add one; stay at the highest value of the type."""
        if self.value < self._type.high:
            self.value += 1


class QuantityCell(Cell):
    """A position, velocity, acceleration or jerk: in user units for the bus, in wire units for the firmware.

    Limits and windows have an end of their type's range as their default; there it means "off". This value is the same
    in all units, and no conversion of another number yields it.
    """

    __slots__ = ("_after_end", "_off", "unit")

    def __init__(self, entry: Entry, *, last_included: bool) -> None:
        """Begin with user units equal to wire units.

        Args:
            entry: row of the object table.
            last_included: the value is an inclusive upper end, so its unit ends where the next one begins.
        """
        super().__init__(entry)
        self._off = entry.default if entry.default in (self._type.low, self._type.high) else None
        self._after_end = int(last_included)
        self.unit: UserUnit = _WIRE_UNIT

    @property
    def plain(self) -> bool:
        """False: another user unit may come at any time."""
        return False

    def get(self) -> int:
        """Return the present value in user units."""
        value = self.present()
        return value if self.unit is _WIRE_UNIT or value == self._off else self._shown(value, self.unit)

    def put(self, value: int) -> None:
        """Check a value in user units, let the firmware act on it, then store it in wire units.

        Raises:
            SdoAbortError: the value is not allowed, exceeds the range of wire units, or the firmware refuses it.
        """
        wire_units = self.in_wire_units(value)
        if wire_units == self._off != value:
            raise SdoAbortError(AbortCode.VALUE_TOO_HIGH if wire_units > 0 else AbortCode.VALUE_TOO_LOW)
        super().put(wire_units)

    def in_wire_units(self, user_units: int) -> int:
        """Return the nearest number of wire units; "off" is the same."""
        if self.unit is _WIRE_UNIT or user_units == self._off:
            return user_units
        return self.unit.to_wire(user_units + self._after_end) - self._after_end

    def has_number(self, unit: UserUnit) -> bool:
        """Return whether the stored value, converted to this unit, is one that may be written."""
        return self.value == self._off or self._shown(self.value, unit) >= self.low

    def _shown(self, value: int, unit: UserUnit) -> int:
        return unit.to_user(value + self._after_end) - self._after_end


class ObjectDictionary:
    """One node's object dictionary.

    The bus uses `read` and `write`, which check access, length and range and raise SdoAbortError. The firmware uses
    `get` and `set`, which check nothing and use wire units. The rows of `od` name the handlers of an entry; `bind`
    connects them.
    """

    def __init__(self, node_id: int, *, stored: FlashPage | None = None, view: ObjectView | None = None) -> None:
        self.entries: Mapping[int, Entry] = ENTRIES if view is None else view.entries
        """The entries that the bus sees."""
        self.traits: DriveTraits = OWN_TRAITS if view is None else view.traits
        self._indices = _INDICES if view is None else frozenset(address >> 8 for address in view.entries)
        self._default_texts = _TEXTS | {
            address: str(entry.default)
            for address, entry in self.entries.items()
            if entry.data_type is DataType.VISIBLE_STRING
        }
        self._node_id = node_id
        self._stored = FlashPage() if stored is None else stored
        self._quantities = {
            address: QuantityCell(ENTRIES[address], last_included=address == od.POSITION_RANGE_MAX)
            for address in _QUANTITIES
        }
        self._cells = {address: Cell(ENTRIES[address]) for address in _PURE_NUMBERS} | self._quantities
        self._viewed: Mapping[int, ViewedCell] = {} if view is None else view.cells(self._cells)
        """Cells of a view; empty without one."""
        self._texts: dict[int, str] = {}
        self.on_write: Callable[[int], None] = lambda _address: None
        """Called with each address that has been written by `write`."""
        self.reset()

    def renumber(self, node_id: int) -> None:
        """Change the node id. Defaults that contain it change with the next `reset`."""
        self._node_id = node_id

    def bind(self, part: object) -> None:
        """Connect a part of the firmware to the entries that name its class as a handler."""
        kind = type(part)
        for address, name in _READ_FROM.get(kind.__name__, ()):
            is_method = callable(getattr(kind, name, None))
            method = _method(part, name, address) if is_method else partial(attrgetter(name), part)
            self._cells[address].supply = method
        for address, name in _OBEYED_BY.get(kind.__name__, ()):
            self._cells[address].obey = _method(part, name, address)

    def reset(self, first_index: int = 0x1000, last_index: int = 0xFFFF) -> None:
        """Set the entries of an index range to their power-up values, stored or default, without calling handlers."""
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
            for address, default in self._default_texts.items()
            if first <= address <= last
        }
        self._take_unit(self._unit())
        for address, viewed in self._viewed.items():
            if first <= address <= last:
                viewed.reset(self._node_id, stored.values)

    def _unit(self, changes: dict[int, int] | None = None) -> UserUnit:
        return UserUnit.of({address: self._cells[address].value for address in FACTORS} | (changes or {}))

    def _take_unit(self, unit: UserUnit) -> None:
        for cell in self._quantities.values():
            cell.unit = _WIRE_UNIT if unit == _WIRE_UNIT else unit

    def change_factor(self, address: int, value: int) -> None:
        """Change the user unit before one of its factors is stored; values in wire units stay the same.

        Raises:
            SdoAbortError: the unit would be smaller than a wire unit (06090030h), or so large that a stored value would
                be rounded below its lowest allowed value (06040043h).
        """
        unit = self._unit({address: value})
        if unit.wire < unit.user:
            raise SdoAbortError(AbortCode.VALUE_RANGE)
        if not all(cell.has_number(unit) for cell in self._quantities.values()):
            raise SdoAbortError(AbortCode.INCOMPATIBLE)
        self._take_unit(unit)

    def get(self, address: int) -> int:
        """Return the present value of a numeric entry; quantities are in wire units."""
        cell = self._cells[address]
        return cell.value if cell.supply is None else cell.present()

    def wire_units(self, address: int, user_units: int) -> int:
        """Convert a quantity's value from user units, as a PDO carries it, to wire units."""
        return self._quantities[address].in_wire_units(user_units)

    def text(self, address: int) -> str:
        """Return the present value of a string."""
        return self._texts[address]

    def cell(self, address: int) -> Cell:
        """Return the firmware's cell of a numeric entry, for hot paths."""
        return self._cells[address]

    def bus_cell(self, address: int) -> Cell | ViewedCell:
        """Return the cell of a numeric entry that the bus sees."""
        return self._viewed[address] if self._viewed else self._cells[address]

    def is_signed(self, address: int) -> bool:
        """Return whether a numeric entry has a sign."""
        return self.entries[address].data_type.signed

    def set(self, address: int, value: int) -> None:
        """Store a value from the firmware, without checks."""
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
        return encode(entry.data_type, self.bus_cell(address).get())

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
            text = data.rstrip(b"\0")  # a visible string: 20h to 7Eh and perhaps an end of 0 (CiA 301, table 44)
            if any(not 0x20 <= byte <= 0x7E for byte in text):
                raise SdoAbortError(AbortCode.VALUE_RANGE)
            self._texts[address] = text.decode("ascii")
        elif len(data) < size:
            raise SdoAbortError(AbortCode.LENGTH_TOO_LOW)
        else:
            self.bus_cell(address).put(decode(data_type, data))
        self.on_write(address)

    def size_to_write(self, address: int) -> int:
        """Return the number of bytes that a write to an entry must have; for a string, may have at most.

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
            raise SdoAbortError(AbortCode.NO_SUBINDEX if address >> 8 in self._indices else AbortCode.NO_OBJECT)
        return entry


def _method(part: object, name: str, address: int) -> Callable[..., Any]:
    """Return a part's method, with the entry's address bound if its name ends with "_at"."""
    method: Callable[..., Any] = getattr(part, name)
    return partial(method, address) if name.endswith("_at") else method
