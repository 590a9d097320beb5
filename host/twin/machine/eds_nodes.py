"""Read the device descriptions (EDS, CiA 306) of further nodes on the bus, and make simple nodes of them."""

from collections.abc import Iterator, Mapping
from configparser import Error as IniError
from configparser import RawConfigParser
from io import StringIO
from pathlib import Path
from typing import Final

from canopen import ObjectDictionary
from canopen.objectdictionary import ODArray, ODVariable, datatypes, eds

from steptwin.emulator.bus.node_objects import (
    PDO_BITS_MAX,
    RPDOS,
    TPDOS,
    NodeDescription,
    NodeEntry,
    NodeObjects,
    NodeValue,
    ValueForm,
)
from steptwin.emulator.bus.simple_node import SimpleNode
from steptwin.host.common.bad_input import prefixed
from steptwin.host.common.errors import InputError
from steptwin.host.common.own_files import read_text
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

EDS_BYTES_MAX: Final = 4 << 20
"""The longest EDS that is read; those of large drives have some 500 kB."""
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
"""Every type that is in neither table is bytes."""
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


def eds_nodes(files: Mapping[int, Path | str], axes: int) -> dict[int, SimpleNode]:
    """Return a node for each id and EDS, beside a machine with so many axes.

    Raises:
        InputError: an id is taken or is none, or a file is no EDS that can be read, or contradicts itself.
    """
    return {node_id: SimpleNode(read_node(node_id, path, axes)) for node_id, path in files.items()}


def read_node(node_id: int, path: Path | str, axes: int) -> NodeDescription:
    """Return what an EDS says of the node of this id; raises as `eds_nodes`."""
    given = f"nodes=0x{node_id:02X}={path}: " if node_id >= 0 else f"nodes={node_id}={path}: "
    with prefixed(given):
        _check_id(node_id, axes)
        text = read_text(str(path), EDS_BYTES_MAX)
        entries = dict(_entries(_dictionary(text, node_id), node_id))
        if not entries:
            raise InputError("has no objects, so it is no EDS")
        description = NodeDescription(node_id, str(path), entries)
        _check_pdos(NodeObjects(description))
        return description


def _check_id(node_id: int, axes: int) -> None:
    last = FIRST_NODE_ID + axes - 1
    if not 1 <= node_id <= NODE_ID_MAX:
        raise InputError(f"a node id is from 1 to {NODE_ID_MAX}, such as 0x{last + 1:02X}")
    if FIRST_NODE_ID <= node_id <= last:
        raise InputError(f"0x{FIRST_NODE_ID:02X} to 0x{last:02X} are the axes' ids; try 0x{last + 1:02X}")
    if node_id == HOST_NODE_ID:
        raise InputError(f"0x{HOST_NODE_ID:02X} is the id of the host's heartbeat; try 0x{HOST_NODE_ID - 1:02X}")


def _dictionary(text: str, node_id: int) -> ObjectDictionary:
    """Read an EDS by the canopen library, and add what it leaves out of compact arrays."""
    try:
        ini = RawConfigParser(inline_comment_prefixes=(";",))
        ini.optionxform = str  # type: ignore[assignment,method-assign]
        ini.read_string(text)
        if not ini.has_section("DeviceInfo"):
            raise InputError("has no section [DeviceInfo], so it is no EDS")
        dictionary: ObjectDictionary = eds.import_eds(StringIO(text), node_id)  # type: ignore[no-untyped-call]
        _complete_arrays(ini, dictionary)
    except IniError as error:
        raise InputError(f"is no EDS: {error.message.splitlines()[0]}") from error
    except KeyError as error:
        raise InputError(f"is no EDS that can be read: {error} is missing") from error
    except (ValueError, TypeError, AttributeError) as error:
        raise InputError(f"is no EDS that can be read: {str(error).splitlines()[0]}") from error
    return dictionary


def _complete_arrays(ini: RawConfigParser, dictionary: ObjectDictionary) -> None:
    """Add the entries of arrays that the file gives as a number of equal ones (CompactSubObj, CiA 306)."""
    for section in ini.sections():
        count = ini.get(section, "CompactSubObj", fallback="") if len(section) == 4 else ""
        if not count or not (entries := int(count, 0)):
            continue
        if not 1 <= entries <= 0xFE:
            raise ValueError(f"[{section}] CompactSubObj={count} is not from 1 to {0xFE}")
        array = dictionary[int(section, 16)]
        if not isinstance(array, ODArray):
            raise ValueError(f"[{section}] is no array, but has CompactSubObj")
        array[0].default, array[0].access_type = entries, "ro"
        for subindex in range(1, entries + 1):
            member = array[subindex]
            member.pdo_mappable = array[1].pdo_mappable
            array.add_member(member)


def _entries(dictionary: ObjectDictionary, node_id: int) -> Iterator[tuple[int, NodeEntry]]:
    for index, item in sorted(dictionary.items()):
        if index < 0x1000:
            continue  # a data type, which is no entry
        variables = {0: item} if isinstance(item, ODVariable) else dict(item.subindices)
        for subindex, variable in sorted(variables.items()):
            address = od.address_of(index, subindex)
            with prefixed(f"{od.place_text(address)}: "):
                yield address, _entry(variable, address, node_id)


def _entry(variable: ODVariable, address: int, node_id: int) -> NodeEntry:
    data_type = variable.data_type or 0
    bits, signed = _WHOLE.get(data_type, (0, False))
    form = ValueForm.WHOLE
    if not bits:
        form, bits = _OTHERS.get(data_type, (ValueForm.BYTES, 0))
    if variable.access_type not in _ACCESS:
        raise InputError(f"AccessType {variable.access_type!r} is not one of {', '.join(_ACCESS)}")
    given = _predefined(address, node_id) if variable.default is None else variable.default
    default = _NOTHING[form] if given is None else given
    if form is ValueForm.WHOLE and isinstance(default, int):
        default = _in_type(default, bits, signed=signed)
    low, high = (variable.min, variable.max) if form is ValueForm.WHOLE else (None, None)
    if low is not None and high is not None and low > high:
        raise InputError(f"LowLimit {low} is above HighLimit {high}")
    entry = NodeEntry(
        variable.name,
        form,
        bits,
        signed,
        _ACCESS[variable.access_type],
        default,
        low,
        high,
        mappable=variable.pdo_mappable,
    )
    try:
        entry.to_bytes(default)
    except ValueError as error:
        raise InputError(f"DefaultValue {error}") from error
    return entry


def _in_type(number: int, bits: int, *, signed: bool) -> int:
    """Return a number that may be written as the bits of a negative one, such as 0xFFFFFFFF for -1."""
    return number - (1 << bits) if signed and 1 << bits - 1 <= number < 1 << bits else number


def _predefined(address: int, node_id: int) -> int | None:
    """Return the identifier that an entry without a default has by the predefined connection set; None: no such entry.

    PDOs beyond the first four have none and do not exist (CiA 301, section 7.3.5).
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


def _check_pdos(objects: NodeObjects) -> None:
    """Raise InputError for a PDO that maps what it cannot carry after power-up."""
    for communications, received in ((RPDOS, True), (TPDOS, False)):
        for _, mapping in objects.pdos(communications):
            bits = 0
            for subindex in range(1, objects.get(od.address_of(mapping)) + 1):
                place = od.address_of(mapping, subindex)
                word = objects.get(place)
                bits += word & 0xFF
                if objects.why_not_mapped(word, received=received) is not None:
                    what = f"{od.place_text(word >> 8)} with {word & 0xFF} bits"
                    raise InputError(f"{od.place_text(place)} maps {what}, which such a PDO cannot carry")
            if bits > PDO_BITS_MAX:
                raise InputError(f"0x{mapping:04X} maps {bits} bits, more than {PDO_BITS_MAX}")
