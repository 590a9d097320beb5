"""Write the electronic data sheet (EDS) of an axis node from the object table (CiA 306-1)."""

import configparser
import io

from steptwin.protocol import od
from steptwin.protocol.entry import Access, DictionaryObject, Entry, Mapping, ObjectCode
from steptwin.protocol.frame import BITRATES
from steptwin.protocol.objects import DUMMY_BITS, OBJECTS, PDO_COUNT

_MANDATORY = frozenset(address >> 8 for address in (od.DEVICE_TYPE, od.ERROR_REGISTER, od.VENDOR_ID))
_MANUFACTURER_FIRST, _MANUFACTURER_LAST = 0x2000, 0x5FFF
_PDO_MAPPINGS = frozenset(od.RPDO_MAPPING + od.TPDO_MAPPING)
_RATES_KBIT = (10, 20, 50, 125, 250, 500, 800, 1000)
_OF_ONE_KIND = {Mapping.RECEIVE: "rww", Mapping.TRANSMIT: "rwr"}
_FILE_DATE = {"Time": "12:00AM", "Date": "01-01-2026"}
"""A fixed date, so that the same table always gives the same bytes."""


def render_eds() -> str:
    """Return the EDS text that serves every axis node; node-dependent defaults read `$NODEID+...`."""
    eds = configparser.RawConfigParser()
    eds.optionxform = str  # type: ignore[assignment,method-assign]  # keys keep their case, as configparser documents
    eds["FileInfo"] = _file_info()
    eds["DeviceInfo"] = _device_info()
    eds["DummyUsage"] = {f"Dummy{index:04X}": "1" for index in DUMMY_BITS}
    eds["Comments"] = {"Lines": "1", "Line1": "StepTwin: a simulated STM32F103 + TB6560 axis"}
    for title, objects in _groups().items():
        indices = {str(i): f"0x{o.index:04X}" for i, o in enumerate(objects, start=1)}
        eds[title] = {"SupportedObjects": str(len(objects)), **indices}
        for item in objects:
            _add_object(eds, item)
    text = io.StringIO()
    eds.write(text, space_around_delimiters=False)
    return text.getvalue()


def _file_info() -> dict[str, str]:
    return {
        "FileName": "steptwin-axis.eds",
        "FileVersion": "1",
        "FileRevision": "0",
        "EDSVersion": "4.0",
        "Description": "StepTwin TB6560 axis",
        "CreationTime": _FILE_DATE["Time"],
        "CreationDate": _FILE_DATE["Date"],
        "CreatedBy": "StepTwin",
        "ModificationTime": _FILE_DATE["Time"],
        "ModificationDate": _FILE_DATE["Date"],
        "ModifiedBy": "StepTwin",
    }


def _device_info() -> dict[str, str]:
    rates = {f"BaudRate_{rate}": str(int(rate * 1000 in BITRATES)) for rate in _RATES_KBIT}
    return {
        "VendorName": "StepTwin",
        "VendorNumber": "0x0",
        "ProductName": "StepTwin TB6560 axis",
        "ProductNumber": "0x6560",
        "RevisionNumber": "0x10000",
        "OrderCode": "steptwin-axis",
        **rates,
        "SimpleBootUpMaster": "0",
        "SimpleBootUpSlave": "1",
        "Granularity": str(min(DUMMY_BITS.values())),
        "DynamicChannelsSupported": "0",
        "GroupMessaging": "0",
        "NrOfRXPDO": str(PDO_COUNT),
        "NrOfTXPDO": str(PDO_COUNT),
        "LSS_Supported": "1",
    }


def _groups() -> dict[str, list[DictionaryObject]]:
    groups: dict[str, list[DictionaryObject]] = {
        "MandatoryObjects": [],
        "OptionalObjects": [],
        "ManufacturerObjects": [],
    }
    for item in OBJECTS:
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
    text = {
        "DataType": f"0x{entry.data_type:04X}",
        "AccessType": _access(entry),
        "DefaultValue": f"$NODEID+{default}" if entry.plus_node_id else default,
        "PDOMapping": str(int(entry.mapping is not Mapping.NONE)),
    }
    if entry.low is not None:
        text["LowLimit"] = str(entry.low)
    if entry.high is not None:
        text["HighLimit"] = str(entry.high)
    return text


def _access(entry: Entry) -> str:
    """Return the access to an entry; CiA 306 has words of its own for those that one kind of PDO only takes."""
    access: str = entry.access.value
    return _OF_ONE_KIND.get(entry.mapping, access) if entry.access is Access.READ_WRITE else access
