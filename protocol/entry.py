"""Describe entries and objects of the dictionary: name, type, access, unit, default and range."""

from collections.abc import Collection
from dataclasses import dataclass
from enum import Enum, IntEnum
from typing import Final


class DataType(IntEnum):
    """Data type codes of CiA 301, table 44: each with its size in bytes (0 for a string) and whether it is signed."""

    INTEGER8 = 0x02, 1, True
    INTEGER16 = 0x03, 2, True
    INTEGER32 = 0x04, 4, True
    UNSIGNED8 = 0x05, 1, False
    UNSIGNED16 = 0x06, 2, False
    UNSIGNED32 = 0x07, 4, False
    VISIBLE_STRING = 0x09, 0, False
    INTEGER24 = 0x10, 3, True

    size: int
    signed: bool
    low: int
    """Least value of the type."""
    high: int
    """Greatest value of the type."""

    def __new__(cls, code: int, size: int, signed: bool) -> "DataType":
        """Create a member and compute its range: two's complement if signed, else from 0."""
        member = int.__new__(cls, code)
        member._value_ = code
        member.size, member.signed = size, signed
        member.low = -(1 << 8 * size) // 2 if signed else 0
        member.high = (1 << 8 * size) - 1 + member.low
        return member


def encode(data_type: DataType, value: int | str) -> bytes:
    """Encode a value, which must be in the type's range."""
    if isinstance(value, str):
        return value.encode("ascii")
    return value.to_bytes(data_type.size, "little", signed=data_type.signed)


def decode(data_type: DataType, data: bytes) -> int:
    """Decode an integer from exactly `size` bytes."""
    return int.from_bytes(data, "little", signed=data_type.signed)


class Access(Enum):
    """Access to an entry by SDO; the value is the EDS keyword (CiA 306)."""

    CONST = "const"
    READ_ONLY = "ro"
    READ_WRITE = "rw"
    WRITE_ONLY = "wo"


class Mapping(Enum):
    """The kinds of PDO into which an entry may be mapped."""

    NONE = 0
    RECEIVE = 1
    TRANSMIT = 2
    BOTH = 3


class EntryUnit(Enum):
    """Unit of an entry; the member's value is its text in the EDS."""

    NONE = ""
    POSITION = "units"
    """User units, which a master may change (6091h, 6092h). The default is the wire unit, 1/16 384 full step."""
    VELOCITY = "units per second"
    ACCELERATION = "units per second squared"
    JERK = "units per second cubed"
    PVT_VELOCITY = "1/64 unit per ms"
    STEPS = "steps"
    REVOLUTIONS = "revolutions"
    NS = "ns"
    US = "us"
    HUNDRED_US = "100 us"
    MS = "ms"
    MV = "mV"
    TEN_MV = "10 mV"
    TENTH_DEGC = "0.1 degC"
    PERCENT = "percent"
    RECORDS = "records"
    BYTES = "bytes"


@dataclass(frozen=True, slots=True)
class Entry:
    """One readable or writable value.

    Attributes:
        title: name, with "{unit}" in place of the unit; an explanation may follow after a colon.
        data_type: type on the wire.
        access: access by SDO.
        default: value after power-up.
        low: lowest value that may be written; None for the type's lowest.
        high: highest value that may be written; None for the type's highest.
        mapping: kinds of PDO that may carry it.
        plus_node_id: the node id is added to the default.
        unit: its unit.
        values: the only allowed values; None if every value within the bounds is allowed.
        read: firmware handler that supplies the value (see `od`); empty for none.
        write: firmware handler that acts on a written value; empty for none.
    """

    title: str
    data_type: DataType
    access: Access
    default: int | str = 0
    low: int | None = None
    high: int | None = None
    mapping: Mapping = Mapping.NONE
    plus_node_id: bool = False
    unit: EntryUnit = EntryUnit.NONE
    values: Collection[int] | None = None
    read: str = ""
    write: str = ""

    @property
    def name(self) -> str:
        """The name in the EDS, such as "Displacement in units"."""
        return self.title.format(unit=self.unit.value)

    @property
    def short_name(self) -> str:
        """The name without unit and explanation, such as "Displacement"."""
        return self.title.partition(":")[0].partition(" in {unit}")[0]


QUANTITIES: Final = frozenset((EntryUnit.POSITION, EntryUnit.VELOCITY, EntryUnit.ACCELERATION, EntryUnit.JERK))
"""Units of the entries that a master reads and writes in user units."""


class ObjectCode(Enum):
    """Object codes of CiA 301: one value, values of one type, values of several types."""

    VARIABLE = 7
    ARRAY = 8
    RECORD = 9


@dataclass(frozen=True, slots=True)
class DictionaryObject:
    """An object: its index, and its entries by sub-index. A variable has only sub-index 0."""

    index: int
    name: str
    code: ObjectCode
    entries: dict[int, Entry]
