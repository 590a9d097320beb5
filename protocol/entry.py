"""Describe entries and objects of the dictionary: name, type, access, unit, default and range."""

from dataclasses import dataclass
from enum import Enum

from steptwin.protocol.datatypes import DataType


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
    """Unit of an entry's value; the member's value is the text for it in the EDS."""

    NONE = ""
    POSITION = "units"
    """Wire units: 1/16 384 full step."""
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
    TEN_MV = "10 mV"
    TENTH_DEGC = "0.1 degC"
    PERCENT = "percent"
    RECORDS = "records"
    BYTES = "bytes"


@dataclass(frozen=True, slots=True)
class Entry:
    """One readable or writable value.

    `title` is the name, with "{unit}" where it says the unit, and perhaps an explanation after a colon. `default` is
    the value after power-up, to which the node id is added if `plus_node_id`. `low` and `high` bound the values that
    may be written; None is the bound of the type.
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

    @property
    def name(self) -> str:
        """The name as the EDS gives it, such as "Displacement in units"."""
        return self.title.format(unit=self.unit.value)

    @property
    def short_name(self) -> str:
        """The name without unit and explanation, such as "Displacement"."""
        return self.title.partition(":")[0].partition(" in {unit}")[0]

    def default_for(self, node_id: int) -> int | str:
        """Return the value after power-up of the node with this id."""
        if self.plus_node_id and isinstance(self.default, int):
            return self.default + node_id
        return self.default


class ObjectCode(Enum):
    """Codes of CiA 301 for how an object is made up."""

    VARIABLE = 7
    ARRAY = 8
    RECORD = 9


@dataclass(frozen=True, slots=True)
class DictionaryObject:
    """An index of the dictionary with its entries by sub-index; a variable has only entry 0."""

    index: int
    name: str
    code: ObjectCode
    entries: dict[int, Entry]
