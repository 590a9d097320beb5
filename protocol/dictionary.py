"""Hold the values of one node's object dictionary, with the checks of CiA 301, bound to the parts of the firmware.

The firmware counts in wire units, a bus master reads and writes in user units (CiA 402-2, factor group). Both meet in
the cells of the quantities: what is stored, supplied and obeyed is in wire units, what `get` returns and `put` takes is
in user units.
"""

from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from functools import partial
from math import gcd
from operator import attrgetter
from typing import Any, Final, NamedTuple

from steptwin.protocol import od
from steptwin.protocol.entry import QUANTITIES, Access, DataType, Entry, decode, encode
from steptwin.protocol.frame import COB_ID_INVALID, COB_ID_MASK
from steptwin.protocol.objects import ENTRIES
from steptwin.protocol.sdo_frames import AbortCode, SdoAbortError

_RESTRICTED = ((0x000, 0x07F), (0x101, 0x180), (0x581, 0x5FF), (0x601, 0x67F), (0x6E0, 0x6FF), (0x701, 0x7FF))
"""COB-IDs that CiA 301 keeps for other services (table 40): NMT, SDO, heartbeat and those that are reserved.

080h, that of SYNC by default, and 700h, which no node's heartbeat has, are not among them.
"""


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
    bitrate: int | None = None
    """The bit rate, in bit/s, that a master has given the node's board by LSS; None if none has."""


_INDICES: Final = frozenset(address >> 8 for address in ENTRIES)
_TEXTS: Final = {
    address: str(entry.default) for address, entry in ENTRIES.items() if entry.data_type is DataType.VISIBLE_STRING
}
"""Strings after power-up without stored ones; they do not depend on the node."""
_NUMBERS: Final = [(address, int(entry.default)) for address, entry in ENTRIES.items() if address not in _TEXTS]
"""Values of the other entries after power-up, less the node id of those that contain it."""
_WITH_NODE_ID: Final = [address for address, _ in _NUMBERS if ENTRIES[address].plus_node_id]


_OF_THE_BOARD: Final = (od.ENCODER_UNITS, od.FEED_UNITS, od.PVT_DISPLACEMENT)
"""Entries in wire units whatever a master chooses: the encoder's, the factor itself and this board's own PVT record."""
_QUANTITIES: Final = [
    address for address, _ in _NUMBERS if ENTRIES[address].unit in QUANTITIES and address not in _OF_THE_BOARD
]
"""Entries in user units."""
_PURE_NUMBERS: Final = [address for address, _ in _NUMBERS if address not in _QUANTITIES]


def _by_class(handlers: Iterable[tuple[int, str]]) -> dict[str, list[tuple[int, str]]]:
    """Return the addresses, and the names within the class, of what "Class.name" names, by class."""
    by_class: dict[str, list[tuple[int, str]]] = {}
    for address, handler in handlers:
        owner, _, name = handler.partition(".")
        by_class.setdefault(owner, []).append((address, name))
    return by_class


_READ_FROM: Final = _by_class((address, entry.read) for address, entry in ENTRIES.items())
_OBEYED_BY: Final = _by_class((address, entry.write) for address, entry in ENTRIES.items())


class UserUnit(NamedTuple):
    """The size of a user unit: `wire` wire units are `user` user units. The fraction has its lowest terms.

    A user unit is no smaller than a wire unit. So each number that a master writes is read back as it is, though both
    conversions round, to the nearest whole number and half up: `to_user(to_wire(n)) == n`. And what the board counts
    has no more digits in user units.
    """

    wire: int = 1
    user: int = 1

    @classmethod
    def of(cls, factors: dict[int, int]) -> "UserUnit":
        """Return the user unit of the four factors by address.

        A position in user units is that in wire units times the feed constant (6092h), divided by the encoder
        resolution (608Fh) and by the gear ratio (6091h); CiA 402-2.
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
"""The entries that make the user unit."""
_WIRE_UNIT: Final = UserUnit()


class Cell:
    """One numeric entry of a node: the value stored, the values allowed, and the firmware's part in it.

    The firmware uses `value` and `present`; SDO and PDO use `get` and `put`.
    """

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

    def present(self) -> int:
        """Return the present value; one beyond the range of the entry's type is shown as the end of that range."""
        if self.supply is None:
            return self.value
        value = self.supply()
        if value > self._type.high:
            return self._type.high
        return value if value >= self._type.low else self._type.low

    get = present
    """Return the present value as the bus has it."""

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


class QuantityCell(Cell):
    """A position, velocity, acceleration or jerk: in user units for the bus, in wire units for the firmware.

    The end of the type's range means "off" where it is the entry's default, as of limits and windows: it is the same in
    all units, and no other number becomes it.
    """

    __slots__ = ("_after_end", "_off", "unit")

    def __init__(self, entry: Entry, *, last_included: bool) -> None:
        """Begin with user units that are wire units; `last_included`: a range goes on to where the next unit begins."""
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
        """Store a value in user units, after its checks; the firmware obeys and stores it in wire units.

        Raises:
            SdoAbortError: the value is not allowed, is beyond what the board can count, or the firmware refuses it.
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
        """Return whether the value stored is a number that may be written in this unit, and not rounded to 0."""
        return self.value == self._off or self._shown(self.value, unit) >= self._low

    def _shown(self, value: int, unit: UserUnit) -> int:
        return unit.to_user(value + self._after_end) - self._after_end


class ObjectDictionary:
    """One node's object dictionary.

    The bus uses `read` and `write`, which check access, length and range and raise SdoAbortError. The firmware uses
    `get` and `set`, which check nothing and have quantities in wire units. The rows of `od` name the firmware's part
    that supplies an entry's present value, and the one that obeys a value written; `bind` finds them there.
    """

    def __init__(self, node_id: int, *, stored: FlashPage | None = None) -> None:
        self.entries = ENTRIES
        self._node_id = node_id
        self._stored = FlashPage() if stored is None else stored
        self._quantities = {
            address: QuantityCell(ENTRIES[address], last_included=address == od.POSITION_RANGE_MAX)
            for address in _QUANTITIES
        }
        self._cells = {address: Cell(ENTRIES[address]) for address in _PURE_NUMBERS} | self._quantities
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
        self._take_unit(self._unit())

    def _unit(self, changes: dict[int, int] | None = None) -> UserUnit:
        return UserUnit.of({address: self._cells[address].value for address in FACTORS} | (changes or {}))

    def _take_unit(self, unit: UserUnit) -> None:
        for cell in self._quantities.values():
            cell.unit = _WIRE_UNIT if unit == _WIRE_UNIT else unit

    def change_factor(self, address: int, value: int) -> None:
        """Choose the user unit by one of the factors, before it is stored. Quantities stay; their numbers are others.

        Raises:
            SdoAbortError: the unit would be smaller than a wire unit (06090030h), or so large that a value stored would
                be rounded below the least that may be written (06040043h).
        """
        unit = self._unit({address: value})
        if unit.wire < unit.user:
            raise SdoAbortError(AbortCode.VALUE_RANGE)
        if not all(cell.has_number(unit) for cell in self._quantities.values()):
            raise SdoAbortError(AbortCode.INCOMPATIBLE)
        self._take_unit(unit)

    def get(self, address: int) -> int:
        """Return the present value of a numeric entry, of a quantity in wire units."""
        cell = self._cells[address]
        return cell.value if cell.supply is None else cell.present()

    def wire_units(self, address: int, user_units: int) -> int:
        """Return in wire units what the bus has of a quantity, such as a PDO's."""
        return self._quantities[address].in_wire_units(user_units)

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
        return encode(entry.data_type, self._cells[address].get())

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
