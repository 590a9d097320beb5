"""What an entry of the object dictionary is: its name, type, access, unit, default and range."""

from dataclasses import dataclass
from enum import Enum

from steptwin.protocol.datatypes import DataType


class Access(Enum):
    """Who may do what by SDO; the value is the EDS keyword (CiA 306)."""

    CONST = "const"
    READ_ONLY = "ro"
    READ_WRITE = "rw"
    WRITE_ONLY = "wo"


class Mapping(Enum):
    """Into which PDOs an entry may be mapped."""

    NONE = 0
    RECEIVE = 1
    TRANSMIT = 2
    BOTH = 3


class EntryUnit(Enum):
    """What an entry counts in; the value is how its name in the EDS says it."""

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

    Attributes:
        title: the name, with "{unit}" where the name says the unit, and an explanation after a colon.
        data_type: its type on the wire.
        access: who may do what by SDO.
        default: the value after power-up; it counts from the node id if `plus_node_id` is set.
        low: least value that may be written; None for the least of the type.
        high: greatest value that may be written; None for the greatest of the type.
        mapping: into which PDOs it may be mapped.
        plus_node_id: True if the default counts from the node id.
        unit: what it counts in.
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
    """An index of the dictionary with its entries by sub-index; a variable has the one entry 0."""

    index: int
    name: str
    code: ObjectCode
    entries: dict[int, Entry]
