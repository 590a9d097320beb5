"""Make simple nodes from the device descriptions (EDS, CiA 306) of further nodes on the bus."""

import re
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Final

from canopen.objectdictionary import datatypes

from steptwin.features.nodes.eds_file import EdsSection, read_sections, whole_number
from steptwin.features.nodes.node_objects import (
    PDO_BITS_MAX,
    RPDO_MAPS,
    RPDOS,
    TPDO_MAPS,
    TPDOS,
    NodeDescription,
    NodeEntry,
    NodeObjects,
    NodeValue,
    ValueForm,
)
from steptwin.features.nodes.simple_node import SimpleNode
from steptwin.host.common.bad_input import prefixed
from steptwin.host.common.errors import InputError
from steptwin.host.common.numbers import decimal, digits_in
from steptwin.host.common.own_files import read_old_text
from steptwin.protocol import od
from steptwin.protocol.entry import Access
from steptwin.protocol.frame import (
    COB_EMCY,
    COB_ID_INVALID,
    COB_RPDO,
    COB_SYNC,
    COB_TPDO,
    FIRST_NODE_ID,
    HOST_NODE_ID,
    NODE_ID_MAX,
)
from steptwin.protocol.objects import DUMMY_BITS
from steptwin.protocol.sdo_frames import AbortCode

EDS_BYTES_MAX: Final = 4 << 20
"""Largest EDS that is read; those of large drives have some 500 kB."""


def eds_nodes(files: Mapping[int, Path | str], axes: int) -> dict[int, SimpleNode]:
    """Return a node for each id and EDS, for a machine with `axes` axes.

    Raises:
        InputError: an id is taken or invalid, or a file is unreadable, not an EDS, or contradicts itself.
    """
    return {node_id: SimpleNode(read_node(node_id, path, axes)) for node_id, path in files.items()}


def read_node(node_id: int, path: Path | str, axes: int) -> NodeDescription:
    """Return the description of a node from its EDS; raises as `eds_nodes`."""
    given = f"nodes=0x{node_id:02X}={path}: " if node_id >= 0 else f"nodes={node_id}={path}: "
    with prefixed(given):
        _check_id(node_id, axes)
        sections = read_sections(read_old_text(str(path), EDS_BYTES_MAX))
        if "deviceinfo" not in sections:
            raise InputError("has no section [DeviceInfo], so it is no EDS")
        entries = entries_of(sections, node_id)
        if not entries:
            raise InputError("has no objects, so it is no EDS")
        description = NodeDescription(node_id, str(path), entries, _dummies(sections))
        _check_pdos(NodeObjects(description))
        return description


def _dummies(sections: Mapping[str, EdsSection]) -> frozenset[int]:
    """Return the data types that RPDOs may map as dummies: those that [DummyUsage] names with 1; all without it."""
    section = sections.get("dummyusage")
    if section is None:
        return frozenset(DUMMY_BITS)
    return frozenset(index for index in DUMMY_BITS if section.number(f"Dummy{index:04X}"))


def _check_id(node_id: int, axes: int) -> None:
    last = FIRST_NODE_ID + axes - 1
    if not 1 <= node_id <= NODE_ID_MAX:
        raise InputError(f"a node id is from 1 to {NODE_ID_MAX}, such as 0x{last + 1:02X}")
    if FIRST_NODE_ID <= node_id <= last:
        raise InputError(f"0x{FIRST_NODE_ID:02X} to 0x{last:02X} are the axes' ids; try 0x{last + 1:02X}")
    if node_id == HOST_NODE_ID:
        raise InputError(f"0x{HOST_NODE_ID:02X} is the id of the host's heartbeat; try 0x{HOST_NODE_ID - 1:02X}")


def _check_pdos(objects: NodeObjects) -> None:
    """Raise InputError for a PDO with a mapping that it cannot carry after power-up."""
    for communications, received in ((RPDOS, True), (TPDOS, False)):
        for _, mapping in objects.pdos(communications):
            bits = 0
            for subindex in range(1, objects.get(od.address_of(mapping)) + 1):
                place = od.address_of(mapping, subindex)
                word = objects.get(place)
                bits += word & 0xFF
                why = objects.why_not_mapped(word, received=received)
                if why is not None:
                    what = f"{od.place_text(word >> 8)} with {word & 0xFF} bits"
                    reason = "such a PDO cannot carry"
                    if why is not AbortCode.CANNOT_BE_MAPPED:
                        reason = "the file does not describe"
                    elif word >> 16 in DUMMY_BITS:
                        reason = "[DummyUsage] does not allow"
                    raise InputError(f"{od.place_text(place)} maps {what}, which {reason}")
            if bits > PDO_BITS_MAX:
                raise InputError(f"0x{mapping:04X} maps {bits} bits, more than {PDO_BITS_MAX}")


ENTRIES_MAX: Final = 20_000
"""Largest number of entries: four times that of the largest drives. CompactSubObj makes 254 from a few bytes."""
_FIRST_INDEX: Final = 0x1000
"""First index of entries; data types are below it."""
_SUBINDEX_MAX: Final = 0xFF
_COMPACT_MAX: Final = 0xFE
_OBJECT: Final = re.compile(r"([0-9a-f]{4})(?:sub([0-9a-f]+))?", re.ASCII)
_DOMAIN, _VARIABLE, _ARRAY, _RECORD = 0x2, 0x7, 0x8, 0x9
"""Values of ObjectType."""
_DEFAULT, _VALUE = "DefaultValue", "ParameterValue"
_ZERO: Final = re.compile(r"0(x0+)?", re.ASCII | re.IGNORECASE)
"""Text of a missing value, even for a number with a decimal point or for bytes."""

_WHOLE: Final = {
    datatypes.BOOLEAN: (1, False),
    datatypes.INTEGER8: (8, True),
    datatypes.INTEGER16: (16, True),
    datatypes.INTEGER24: (24, True),
    datatypes.INTEGER32: (32, True),
    datatypes.INTEGER40: (40, True),
    datatypes.INTEGER48: (48, True),
    datatypes.INTEGER56: (56, True),
    datatypes.INTEGER64: (64, True),
    datatypes.UNSIGNED8: (8, False),
    datatypes.UNSIGNED16: (16, False),
    datatypes.UNSIGNED24: (24, False),
    datatypes.UNSIGNED32: (32, False),
    datatypes.UNSIGNED40: (40, False),
    datatypes.UNSIGNED48: (48, False),
    datatypes.UNSIGNED56: (56, False),
    datatypes.UNSIGNED64: (64, False),
}
"""Bits and sign of the whole numbers (CiA 301, table 44)."""
_OTHERS: Final = {
    datatypes.REAL32: (ValueForm.REAL, 32),
    datatypes.REAL64: (ValueForm.REAL, 64),
    datatypes.VISIBLE_STRING: (ValueForm.TEXT, 0),
    datatypes.UNICODE_STRING: (ValueForm.WIDE_TEXT, 0),
}
"""Other types with a form of their own; types in neither table are bytes."""
_STANDARD_TYPE_MAX: Final = datatypes.UNSIGNED64
_TIME_BYTES: Final = 6
_TIMES: Final = (datatypes.TIME_OF_DAY, datatypes.TIME_DIFFERENCE)
"""Types of bytes with values that files write as numbers."""
_ACCESS: Final = {
    "ro": Access.READ_ONLY,
    "wo": Access.WRITE_ONLY,
    "rw": Access.READ_WRITE,
    "rwr": Access.READ_WRITE,
    "rww": Access.READ_WRITE,
    "const": Access.CONST,
}
_NOTHING: Final[Mapping[ValueForm, NodeValue]] = {
    ValueForm.WHOLE: 0,
    ValueForm.REAL: 0.0,
    ValueForm.TEXT: "",
    ValueForm.WIDE_TEXT: "",
    ValueForm.BYTES: b"",
}


@dataclass(frozen=True, slots=True)
class _Place:
    """Place of an entry and of its value in a file.

    Attributes:
        section: section of the description.
        name: name of the entry.
        value: section and key of its value, which may be empty.
    """

    section: EdsSection
    name: str
    value: tuple[EdsSection, str]

    @classmethod
    def of(cls, section: EdsSection, name: str) -> "_Place":
        """Return the place of an entry with a section of its own; a DCF's value takes precedence over the default."""
        return cls(section, name, (section, _VALUE if section.text(_VALUE) else _DEFAULT))


def entries_of(sections: Mapping[str, EdsSection], node_id: int) -> dict[int, NodeEntry]:
    """Return the entries of a file by address, in order.

    Raises InputError for too many entries and, with section and key, for unreadable ones.
    """
    objects, subs = _objects(sections)
    found: dict[int, NodeEntry] = {}
    for index, section in objects.items():
        kind = section.number("ObjectType")
        name, count = section.required("ParameterName"), _compact(section)
        if kind in (None, _VARIABLE, _DOMAIN):  # CiA 306: without a type it is a variable
            if count:
                raise section.refused("CompactSubObj", "only an ARRAY (ObjectType 8) and a RECORD (9) have it")
            places = {0: _Place.of(section, name)}
        elif kind in (_ARRAY, _RECORD):
            places = _compact_places(sections, index, name, count)
            places |= {i: _Place.of(sub, sub.required("ParameterName")) for i, sub in subs.get(index, {}).items()}
        else:
            raise section.refused("ObjectType", "is none of 2 (DOMAIN), 7 (VAR), 8 (ARRAY) and 9 (RECORD)")
        own = {
            subindex: _entry(sections, place, od.address_of(index, subindex), node_id)
            for subindex, place in places.items()
        }
        if count and 0 not in own:
            own[0] = _number_of_entries(index, own, count)
        found |= {od.address_of(index, subindex): entry for subindex, entry in own.items()}
    return dict(sorted(found.items()))


def _objects(sections: Mapping[str, EdsSection]) -> tuple[dict[int, EdsSection], dict[int, dict[int, EdsSection]]]:
    """Return the sections of objects by their index, and those of their sub-indexes."""
    objects: dict[int, EdsSection] = {}
    subs: dict[int, dict[int, EdsSection]] = {}
    count = 0
    for key, section in sections.items():
        found = _OBJECT.fullmatch(key)
        if found is None or (index := int(found[1], 16)) < _FIRST_INDEX:
            continue
        count += 1
        if found[2] is None:
            objects[index] = section
            count += _compact(section)
            continue
        subindex = int(found[2], 16)
        if subindex > _SUBINDEX_MAX:
            raise InputError(f"[{section.name}] is beyond sub-index 0x{_SUBINDEX_MAX:X}")
        if subindex in subs.setdefault(index, {}):
            raise InputError(f"[{section.name}] is there twice")
        subs[index][subindex] = section
    if count > ENTRIES_MAX:
        raise InputError(f"describes {count} entries; at most {ENTRIES_MAX} are read")
    return objects, subs


# --- objects described together (CompactSubObj)


def _compact(section: EdsSection) -> int:
    """Return the number of entries that a section describes together; 0 for a section of one entry."""
    count = section.number("CompactSubObj") or 0
    if not 0 <= count <= _COMPACT_MAX:
        raise section.refused("CompactSubObj", f"is not from 1 to {_COMPACT_MAX}")
    return count


def _compact_places(sections: Mapping[str, EdsSection], index: int, name: str, count: int) -> dict[int, _Place]:
    """Return the places of entries from sub-index 1 on that are described together, with listed names and values."""
    section = sections[f"{index:04x}"]
    names, values = (_listed(sections.get(f"{index:04x}{what}"), count) for what in ("name", "value"))
    places = {}
    for subindex in range(1, count + 1):
        own = _Place.of(section, f"{name}{subindex}")
        if subindex in names:
            listed, key = names[subindex]
            own = replace(own, name=listed.text(key))
        places[subindex] = replace(own, value=values.get(subindex, own.value))
    return places


def _listed(section: EdsSection | None, count: int) -> dict[int, tuple[EdsSection, str]]:
    """Return section and key of each item in a section such as [1600Value], by its sub-index."""
    if section is None:
        return {}
    listed: dict[int, tuple[EdsSection, str]] = {}
    for key in section.values:
        if key == "nrofentries":
            continue
        subindex = digits_in(key)
        if subindex is None or not 1 <= subindex <= count:
            raise section.refused(key, f"the object has the sub-indexes 1 to {count}")
        if section.text(key):
            listed[subindex] = section, key
    return listed


def _number_of_entries(index: int, entries: Mapping[int, NodeEntry], count: int) -> NodeEntry:
    """Return the entry of sub-index 0. A PDO's mapping uses as many entries as have a value."""
    if index in RPDO_MAPS or index in TPDO_MAPS:
        count = next((i - 1 for i in range(1, count + 1) if not entries[i].default), count)
    return NodeEntry("Number of entries", ValueForm.WHOLE, 8, signed=False, access=Access.READ_ONLY, default=count)


# --- one entry


def _entry(sections: Mapping[str, EdsSection], place: _Place, address: int, node_id: int) -> NodeEntry:
    section = place.section
    data_type = _data_type(sections, section)
    bits, signed = _WHOLE.get(data_type, (0, False))
    form = ValueForm.WHOLE
    if not bits:
        form, bits = _OTHERS.get(data_type, (ValueForm.BYTES, 0))
    entry = NodeEntry(
        place.name,
        form,
        bits,
        signed,
        _access(section),
        _NOTHING[form],
        mappable=bool(section.number("PDOMapping")),
    )
    if form is ValueForm.WHOLE:
        low, high = (_limit(section, key, entry, node_id) for key in ("LowLimit", "HighLimit"))
        entry = replace(entry, low=low, high=high)
    if entry.low is not None and entry.high is not None and entry.low > entry.high:
        raise section.refused("LowLimit", f"is above HighLimit={section.text('HighLimit')}")
    given, key = place.value
    if given.text(key):
        try:
            value = _value(given.text(key), entry, data_type, node_id)
            entry.to_bytes(value)
        except ValueError as error:
            raise given.refused(key, str(error)) from error
        return replace(entry, default=value)
    predefined = _predefined(address, node_id)
    return entry if predefined is None else replace(entry, default=predefined)


def _data_type(sections: Mapping[str, EdsSection], section: EdsSection) -> int:
    """Return the type of an entry; a manufacturer's own type is that of the second entry of its own object."""
    data_type = section.number("DataType")
    if data_type is None:
        if section.number("ObjectType") == _DOMAIN:
            return int(datatypes.DOMAIN)
        section.required("DataType")
    elif data_type > _STANDARD_TYPE_MAX:
        own = sections.get(f"{data_type:x}sub1")
        return (own and own.number(_DEFAULT)) or int(datatypes.DOMAIN)
    return data_type or 0


def _access(section: EdsSection) -> Access:
    given = section.text("AccessType").lower()
    if not given and section.number("ObjectType") == _DOMAIN:
        return Access.READ_WRITE
    section.required("AccessType")
    if given not in _ACCESS:
        raise section.refused("AccessType", f"is not one of {', '.join(_ACCESS)}")
    return _ACCESS[given]


def _limit(section: EdsSection, key: str, entry: NodeEntry, node_id: int) -> int | None:
    limit = section.number(key, node_id)
    return None if limit is None else _in_type(limit, entry.bits, signed=entry.signed)


def _value(text: str, entry: NodeEntry, data_type: int, node_id: int) -> NodeValue:
    """Return the value of a text.

    Raises:
        ValueError: the type does not have this value.
    """
    match entry.form:
        case ValueForm.WHOLE:
            return _in_type(whole_number(text, node_id), entry.bits, signed=entry.signed)
        case ValueForm.REAL:
            return 0.0 if _ZERO.fullmatch(text) else decimal(text)
        case ValueForm.BYTES:
            return _bytes(text, data_type)
        case _:
            return text


def _bytes(text: str, data_type: int) -> bytes:
    if data_type in _TIMES:
        number = whole_number(text, 0)
        if not 0 <= number < 1 << 8 * _TIME_BYTES:
            raise ValueError(f"is not from 0 to {(1 << 8 * _TIME_BYTES) - 1}")
        return number.to_bytes(_TIME_BYTES, "little")
    try:
        return bytes.fromhex(text)
    except ValueError:
        if _ZERO.fullmatch(text):
            return b""
        if data_type == datatypes.OCTET_STRING:
            raise ValueError("is no row of bytes with two hexadecimal digits each") from None
        return text.encode()  # a domain may hold anything, even the file's text itself


def _in_type(number: int, bits: int, *, signed: bool) -> int:
    """Return a number that a file may write as the bits of a negative one, such as 0xFFFFFFFF for -1."""
    return number - (1 << bits) if signed and 1 << bits - 1 <= number < 1 << bits else number


def _predefined(address: int, node_id: int) -> int | None:
    """Return the identifier of an entry without a default by the predefined connection set; None for other entries.

    The set has no PDOs beyond the first four; those do not exist then (CiA 301, section 7.3.5).
    """
    if address == od.SYNC_COB_ID:
        return COB_SYNC
    if address == od.EMCY_COB_ID:
        return COB_EMCY + node_id
    for first, bases in ((RPDOS.start, COB_RPDO), (TPDOS.start, COB_TPDO)):
        number = (address >> 8) - first
        if 0 <= number < len(RPDOS) and address & 0xFF == od.PDO_COB_ID:
            return bases[number] + node_id if number < len(bases) else COB_ID_INVALID
    return None
