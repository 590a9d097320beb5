"""Read a personality's file: a table of the objects of a drive, and what stands behind each."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from enum import Enum
from pathlib import Path
from typing import Annotated, Final

from steptwin.host.common.bad_input import prefixed, unknown
from steptwin.host.common.errors import InputError
from steptwin.host.common.file_models import FileTable, read_toml
from steptwin.host.common.file_values import Within
from steptwin.host.common.own_files import read_text

FILE_BYTES_MAX: Final = 1 << 20
"""Largest file of a personality; those here have some 30 kB."""
SUFFIX: Final = ".toml"
_DRIVES: Final = Path(__file__).parent / "drives"
_BASES_MAX: Final = 4
"""Longest chain of files that each add to another one."""

Word = Annotated[int, Within(-(1 << 31), (1 << 32) - 1)]


class TypeName(Enum):
    """Types of entries."""

    I8 = "i8"
    I16 = "i16"
    I24 = "i24"
    I32 = "i32"
    U8 = "u8"
    U16 = "u16"
    U32 = "u32"
    TEXT = "text"


class AccessName(Enum):
    """Access by SDO."""

    CONST = "const"
    RO = "ro"
    RW = "rw"
    WO = "wo"


class MapName(Enum):
    """Kinds of PDO that may carry an entry."""

    NO = "no"
    RX = "rx"
    TX = "tx"
    BOTH = "both"


class Behind(Enum):
    """What stands behind an entry."""

    FIRMWARE = "firmware"
    """An object of the firmware, by default that of the same address."""
    CONSTANT = "constant"
    STORE = "store"
    """A value that a master may write and read; nothing follows from it."""
    REFUSE = "refuse"
    """Each write is refused (08000022h)."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ObjectTable(FileTable):
    """One object, or one sub-index of it. What is left out is that of the firmware's object.

    Attributes:
        source: where the values come from: keys of `sources`, with commas between.
        behind: what stands behind it.
        of: the firmware's object, such as 2011; by default that with the same address.
        name: name in the EDS.
        type: data type.
        access: access by SDO.
        map: kinds of PDO that may carry it.
        default: value after power-up, in the drive's own unit.
        text: value after power-up of an entry of the type text.
        plus_node_id: true if the node id is added to the default.
        low: lowest value that may be written.
        high: highest value that may be written.
        values: the only values that may be written.
        codes: the firmware's values for some of the drive's, such as homing methods.
    """

    source: str
    behind: Behind = Behind.FIRMWARE
    of: str | None = None
    name: str | None = None
    type: TypeName | None = None
    access: AccessName | None = None
    map: MapName | None = None
    default: Word | None = None
    text: str | None = None
    plus_node_id: bool | None = None
    low: Word | None = None
    high: Word | None = None
    values: tuple[Word, ...] | None = None
    codes: Mapping[str, int] = field(default_factory=dict)


@dataclass(frozen=True, slots=True, kw_only=True)
class PdoTable(FileTable):
    """A PDO after power-up.

    Attributes:
        type: transmission type.
        map: mapped objects, such as 6040 or 60C1:01.
        inhibit_100us: shortest time between two transmissions, in 100 us.
        event_timer_ms: longest time between two transmissions; 0 for no limit.
        valid: false if it is switched off.
    """

    type: Annotated[int, Within(0, 255)] = 255
    map: tuple[str, ...] = ()
    inhibit_100us: Annotated[int, Within(0, 0xFFFF)] = 0
    event_timer_ms: Annotated[int, Within(0, 0xFFFF)] = 0
    valid: bool = True


@dataclass(frozen=True, slots=True, kw_only=True)
class PdosTable(FileTable):
    """The PDOs; each has a communication and a mapping parameter.

    Attributes:
        source: where the values come from: keys of `sources`, with commas between.
        mapped_objects: sub-indexes of a mapping; eight of them can be used.
        receive_parameters: sub-indexes of 1400h and the following ones.
        transmit_parameters: sub-indexes of 1800h and the following ones.
        further: PDOs beyond the first four, of each kind; they stay switched off.
        receive: the first RPDOs.
        transmit: the first TPDOs.
    """

    source: str
    mapped_objects: Annotated[int, Within(1, 64)] = 8
    receive_parameters: tuple[int, ...] = (1, 2)
    transmit_parameters: tuple[int, ...] = (1, 2, 3, 5)
    further: Annotated[int, Within(0, 508)] = 0
    receive: tuple[PdoTable, ...]
    transmit: tuple[PdoTable, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class PersonalityFile(FileTable):
    """The objects of a drive.

    Attributes:
        base: name of the personality to which this file adds; empty for none.
        device: name of the drive.
        increments_per_revolution: increments of the drive's encoder in a turn of the motor.
        zero_limits_off: true if two position limits of 0 mean none.
        targets_at_arrival: true if cyclic modes take each target when it is written, also without SYNC.
        sources: what the short names of sources stand for.
        pdos: the PDOs.
        records: names of the arrays and records that the firmware does not have, by index.
        objects: the objects, by index such as 6081, or by index and sub-index such as 6099:01.
        hidden: values of the firmware's objects that the drive does not have, by index.
        lacking: what the drive has and this personality has not, and why, by a name or range of objects.
    """

    base: str = ""
    device: str = ""
    increments_per_revolution: Annotated[int, Within(1, 3_276_800)] | None = None
    zero_limits_off: bool | None = None
    targets_at_arrival: bool | None = None
    sources: Mapping[str, str] = field(default_factory=dict)
    pdos: PdosTable | None = None
    records: Mapping[str, str] = field(default_factory=dict)
    objects: Mapping[str, ObjectTable] = field(default_factory=dict)
    hidden: Mapping[str, int] = field(default_factory=dict)
    lacking: Mapping[str, str] = field(default_factory=dict)

    def over(self, base: "PersonalityFile") -> "PersonalityFile":
        """Return this file with what it leaves out from its base."""
        given = {name: getattr(self, name) for name in ("increments_per_revolution", "zero_limits_off", "pdos")}
        given |= {"device": self.device or None, "targets_at_arrival": self.targets_at_arrival}
        return replace(
            base,
            **{name: value for name, value in given.items() if value is not None},
            sources={**base.sources, **self.sources},
            records={**base.records, **self.records},
            objects={**base.objects, **self.objects},
            hidden={**base.hidden, **self.hidden},
            lacking={**base.lacking, **self.lacking},
        )


def personality_names() -> tuple[str, ...]:
    """Return the names of the personalities that StepTwin brings, sorted."""
    return tuple(sorted(path.stem for path in _DRIVES.glob(f"*{SUFFIX}")))


def read_personality_file(given: str, folder: Path = Path()) -> PersonalityFile:
    """Return a personality's file, by its name or by its path from a folder, with its bases.

    Raises:
        InputError: there is no such personality, or something is wrong in its file.
    """
    return _read(given, folder, _BASES_MAX)


def _read(given: str, folder: Path, bases_left: int) -> PersonalityFile:
    with prefixed(f"personality={given}: "):
        if given.endswith(SUFFIX):
            path = folder / given
        elif given in personality_names():
            path = _DRIVES / f"{given}{SUFFIX}"
        else:
            near = str(unknown("", given, personality_names())).lstrip()
            raise InputError(f"{near} (a file's name ends in {SUFFIX})")
        read = read_toml(PersonalityFile, read_text(path, FILE_BYTES_MAX))
        if not read.base:
            return read
        if not bases_left:
            raise InputError(f"base: more than {_BASES_MAX} files add to one another")
    return read.over(_read(read.base, path.parent, bases_left - 1))
