"""Write the electronic data sheet (EDS) and the CAN database (DBC) of the nodes from the object table.

The EDS describes an axis node (CiA 306-1). Loggers and analysers use the DBC to name the signals of a board. The DBC
has each axis' PDOs in their default mapping, its emergency, its heartbeat and its SDO; NMT and SYNC are shared. If an
axis gives its wire units per mm or degree, positions and speeds are decoded in mm or degrees.
"""

import configparser
import io
import re
from collections.abc import Iterator
from dataclasses import dataclass

from steptwin.protocol import od
from steptwin.protocol.entry import Access, DictionaryObject, Entry, EntryUnit, Mapping, ObjectCode
from steptwin.protocol.frame import (
    BITRATES,
    COB_EMCY,
    COB_HEARTBEAT,
    COB_ID_INVALID,
    COB_NMT,
    COB_RPDO,
    COB_SDO_REQUEST,
    COB_SDO_RESPONSE,
    COB_SYNC,
    COB_TPDO,
    FIRST_NODE_ID,
    HOST_NODE_ID,
)
from steptwin.protocol.nmt import NmtCommand, NmtState
from steptwin.protocol.objects import DUMMY_BITS, ENTRIES, OBJECTS, RPDO_DEFAULTS, TPDO_DEFAULTS
from steptwin.protocol.pvt import VELOCITY_PER_UNIT_PER_MS

_MANDATORY = frozenset(address >> 8 for address in (od.DEVICE_TYPE, od.ERROR_REGISTER, od.VENDOR_ID))
_MANUFACTURER_FIRST, _MANUFACTURER_LAST = 0x2000, 0x5FFF
_PDO_MAPPINGS = frozenset((*range(0x1600, 0x1800), *range(0x1A00, 0x1C00)))
_RATES_KBIT = (10, 20, 50, 125, 250, 500, 800, 1000)
_PDO_ACCESS = {Mapping.RECEIVE: "rww", Mapping.TRANSMIT: "rwr"}
"""Access of read-write entries that only one kind of PDO may map (CiA 306)."""
_FILE_DATE = {"Time": "12:00AM", "Date": "01-01-2026"}
"""A fixed date: the same table must always give the same bytes."""
MASTER = "Master"
_WIRE_UNIT = "1/16384 full step"
_RPDO_PURPOSES = ("Control", "SyncControl", "SyncTarget", "Pvt")
_TPDO_PURPOSES = ("Status", "SyncActual", "PvtStatus", "Inputs")

_SPEEDS = {EntryUnit.VELOCITY: 1.0, EntryUnit.PVT_VELOCITY: 1000.0 / VELOCITY_PER_UNIT_PER_MS}
"""Factors from each unit of speed to wire units per second."""
_TIMES = (EntryUnit.MS, EntryUnit.US)


@dataclass(frozen=True, slots=True)
class EdsDevice:
    """A device as its EDS describes it.

    Attributes:
        file_name: name of the file.
        name: name of the product, which is also the file's description.
        vendor: name of the vendor.
        order_code: order code.
        comment: comment of the file.
        objects: objects in the order of their indexes; 1018h has the numbers of vendor, product and revision.
    """

    file_name: str
    name: str
    vendor: str
    order_code: str
    comment: str
    objects: tuple[DictionaryObject, ...]

    def number(self, subindex: int) -> str:
        """Return a number of the identity (1018h)."""
        identity = next(item for item in self.objects if item.index == od.VENDOR_ID >> 8)
        return f"0x{identity.entries[subindex].default:X}"

    def pdos(self, indexes: range) -> str:
        """Return the number of PDOs whose communication parameters have these indexes."""
        return str(sum(item.index in indexes for item in self.objects))


AXIS = EdsDevice(
    "steptwin-axis.eds",
    "StepTwin stepper axis",
    "StepTwin",
    "steptwin-axis",
    "StepTwin: a simulated STM32F103 axis with a STEP/DIR driver",
    OBJECTS,
)


def render_eds(device: EdsDevice = AXIS) -> str:
    """Return the EDS text, which is valid for every node of a device: defaults with the node id read `$NODEID+...`."""
    eds = configparser.RawConfigParser()
    eds.optionxform = str  # type: ignore[assignment,method-assign]  # keys keep their case, as configparser documents
    eds["FileInfo"] = _file_info(device)
    eds["DeviceInfo"] = _device_info(device)
    eds["DummyUsage"] = {f"Dummy{index:04X}": "1" for index in DUMMY_BITS}
    eds["Comments"] = {"Lines": "1", "Line1": device.comment}
    for title, objects in _groups(device.objects).items():
        indices = {str(i): f"0x{o.index:04X}" for i, o in enumerate(objects, start=1)}
        eds[title] = {"SupportedObjects": str(len(objects)), **indices}
        for item in objects:
            _add_object(eds, item)
    text = io.StringIO()
    eds.write(text, space_around_delimiters=False)
    return text.getvalue()


def _file_info(device: EdsDevice) -> dict[str, str]:
    return {
        "FileName": device.file_name,
        "FileVersion": "1",
        "FileRevision": "0",
        "EDSVersion": "4.0",
        "Description": device.name,
        "CreationTime": _FILE_DATE["Time"],
        "CreationDate": _FILE_DATE["Date"],
        "CreatedBy": "StepTwin",
        "ModificationTime": _FILE_DATE["Time"],
        "ModificationDate": _FILE_DATE["Date"],
        "ModifiedBy": "StepTwin",
    }


def _device_info(device: EdsDevice) -> dict[str, str]:
    rates = {f"BaudRate_{rate}": str(int(rate * 1000 in BITRATES)) for rate in _RATES_KBIT}
    return {
        "VendorName": device.vendor,
        "VendorNumber": device.number(1),
        "ProductName": device.name,
        "ProductNumber": device.number(2),
        "RevisionNumber": device.number(3),
        "OrderCode": device.order_code,
        **rates,
        "SimpleBootUpMaster": "0",
        "SimpleBootUpSlave": "1",
        "Granularity": str(min(DUMMY_BITS.values())),
        "DynamicChannelsSupported": "0",
        "GroupMessaging": "0",
        "NrOfRXPDO": device.pdos(range(0x1400, 0x1600)),
        "NrOfTXPDO": device.pdos(range(0x1800, 0x1A00)),
        "LSS_Supported": "1",
    }


def _groups(objects: tuple[DictionaryObject, ...]) -> dict[str, list[DictionaryObject]]:
    groups: dict[str, list[DictionaryObject]] = {
        "MandatoryObjects": [],
        "OptionalObjects": [],
        "ManufacturerObjects": [],
    }
    for item in objects:
        if item.index in _MANDATORY:
            groups["MandatoryObjects"].append(item)
        elif _MANUFACTURER_FIRST <= item.index <= _MANUFACTURER_LAST:
            groups["ManufacturerObjects"].append(item)
        else:
            groups["OptionalObjects"].append(item)
    return groups


def _add_object(eds: configparser.RawConfigParser, item: DictionaryObject) -> None:
    section = f"{item.index:04X}"
    if item.code is ObjectCode.VARIABLE:
        eds[section] = {"ParameterName": item.name, "ObjectType": "0x7", **_entry(item.entries[0])}
        return
    eds[section] = {
        "ParameterName": item.name,
        "ObjectType": f"0x{item.code.value:X}",
        "SubNumber": str(len(item.entries)),
    }
    for subindex, entry in item.entries.items():
        eds[f"{section}sub{subindex:X}"] = {
            "ParameterName": entry.name,
            "ObjectType": "0x7",
            **_entry(entry),
        }
        if subindex and item.index in _PDO_MAPPINGS:  # hexadecimal shows index, sub-index and bits
            eds[f"{section}sub{subindex:X}"]["DefaultValue"] = f"0x{entry.default:08X}"


def _entry(entry: Entry) -> dict[str, str]:
    default = str(entry.default)
    if isinstance(entry.default, int) and entry.default >= 1 << 16:
        default = f"0x{entry.default:X}"
    access: str = entry.access.value
    if entry.access is Access.READ_WRITE:
        access = _PDO_ACCESS.get(entry.mapping, access)
    text = {
        "DataType": f"0x{entry.data_type:04X}",
        "AccessType": access,
        "DefaultValue": f"$NODEID+{default}" if entry.plus_node_id else default,
        "PDOMapping": str(int(entry.mapping is not Mapping.NONE)),
    }
    if entry.low is not None:
        text["LowLimit"] = str(entry.low)
    if entry.high is not None:
        text["HighLimit"] = str(entry.high)
    return text


@dataclass(frozen=True, slots=True)
class AxisNames:
    """Name and unit of an axis in the database.

    Attributes:
        name: prefix of the axis' message names.
        unit: "mm" or "deg"; empty for wire units.
        units_per_unit: number of wire units in one `unit`; 1 for wire units.
        note: comment on the axis, without quotes; empty for none.
    """

    name: str
    unit: str = ""
    units_per_unit: float = 1.0
    note: str = ""


@dataclass(frozen=True, slots=True)
class _Signal:
    name: str
    first_bit: int
    bits: int
    signed: bool
    factor: float = 1.0
    unit: str = ""

    def __str__(self) -> str:
        sign = "-" if self.signed else "+"
        place = f"{self.first_bit}|{self.bits}@1{sign}"
        return f' SG_ {self.name} : {place} ({self.factor!r},0) [0|0] "{self.unit}" {MASTER}'


@dataclass(frozen=True, slots=True)
class _Message:
    cob_id: int
    name: str
    size: int
    sender: str
    signals: tuple[_Signal, ...]

    def __str__(self) -> str:
        head = f"BO_ {self.cob_id} {self.name}: {self.size} {self.sender}"
        return "\n".join([head, *map(str, self.signals)])


def render_dbc(axes: tuple[AxisNames, ...]) -> str:
    """Return the DBC text of a board with these axes; node ids count from the default first one."""
    command = (_Signal("Command", 0, 8, signed=False), _Signal("NodeId", 8, 8, signed=False))
    messages = [
        _Message(COB_NMT, "NMT", 2, MASTER, command),
        _Message(COB_SYNC, "SYNC", 0, MASTER, ()),
        _heartbeat(HOST_NODE_ID, MASTER),
        *(message for i, axis in enumerate(axes) for message in _axis_messages(axis, FIRST_NODE_ID + i)),
    ]
    parts = [
        'VERSION ""',
        "NS_ :",
        "BS_:",
        " ".join(["BU_:", MASTER, *(axis.name for axis in axes)]),
        *map(str, messages),
        *(f'CM_ BU_ {axis.name} "{axis.note}";' for axis in axes if axis.note),
        "\n".join(_value_tables(messages)),
    ]
    return "\n\n".join(parts) + "\n"


def _heartbeat(node_id: int, name: str) -> _Message:
    state = _Signal("NmtState", 0, 7, signed=False)
    return _Message(COB_HEARTBEAT + node_id, f"{name}_Heartbeat", 1, name, (state,))


def _axis_messages(axis: AxisNames, node_id: int) -> Iterator[_Message]:
    for i, pdo in enumerate(RPDO_DEFAULTS):
        yield _pdo(axis, COB_RPDO[i] + node_id, f"RPDO{i + 1}_{_RPDO_PURPOSES[i]}", MASTER, pdo.mapping)
    for i, pdo in enumerate(TPDO_DEFAULTS):
        yield _pdo(axis, COB_TPDO[i] + node_id, f"TPDO{i + 1}_{_TPDO_PURPOSES[i]}", axis.name, pdo.mapping)
    emergency = (
        _Signal("ErrorCode", 0, 16, signed=False),
        _Signal("ErrorRegister", 16, 8, signed=False),
        _Signal("Manufacturer", 24, 40, signed=False),
    )
    yield _Message(COB_EMCY + node_id, f"{axis.name}_EMCY", 8, axis.name, emergency)
    yield _heartbeat(node_id, axis.name)
    sdo = (
        _Signal("Command", 0, 8, signed=False),
        _Signal("Index", 8, 16, signed=False),
        _Signal("SubIndex", 24, 8, signed=False),
        _Signal("Data", 32, 32, signed=False),
    )
    yield _Message(COB_SDO_REQUEST + node_id, f"{axis.name}_SDO_Request", 8, MASTER, sdo)
    yield _Message(COB_SDO_RESPONSE + node_id, f"{axis.name}_SDO_Response", 8, axis.name, sdo)


def _pdo(axis: AxisNames, cob_id: int, name: str, sender: str, mapping: tuple[int, ...]) -> _Message:
    signals = []
    first_bit = 0
    for address in mapping:
        signals.append(_signal(axis, ENTRIES[address], first_bit))
        first_bit += signals[-1].bits
    return _Message(cob_id & ~COB_ID_INVALID, f"{axis.name}_{name}", first_bit // 8, sender, tuple(signals))


def _signal(axis: AxisNames, entry: Entry, first_bit: int) -> _Signal:
    factor, unit = 1.0, ""
    if entry.unit is EntryUnit.POSITION:
        factor, unit = 1.0 / axis.units_per_unit, axis.unit or _WIRE_UNIT
    elif entry.unit in _SPEEDS:
        factor, unit = _SPEEDS[entry.unit] / axis.units_per_unit, f"{axis.unit or _WIRE_UNIT}/s"
    elif entry.unit in _TIMES:
        unit = entry.unit.value
    name = "".join(word[0].upper() + word[1:] for word in re.findall(r"[A-Za-z0-9]+", entry.short_name))
    return _Signal(name, first_bit, 8 * entry.data_type.size, entry.data_type.signed, factor, unit)


def _value_tables(messages: list[_Message]) -> Iterator[str]:
    """Yield names for the values of NMT commands and states. A DBC cannot name drive states: they need a mask."""
    commands = " ".join(f'{command.value} "{command.name}"' for command in NmtCommand)
    yield f"VAL_ {COB_NMT} Command {commands} ;"
    states = " ".join(f'{state.value} "{state.name}"' for state in NmtState)
    for message in messages:
        if message.name.endswith("_Heartbeat"):
            yield f"VAL_ {message.cob_id} NmtState {states} ;"
