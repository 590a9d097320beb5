"""Make the objects of a drive from a personality's file: its entries, and the cells behind them."""

import re
from collections.abc import Iterator, Mapping
from dataclasses import replace
from itertools import groupby
from pathlib import Path
from typing import Final

from steptwin.features.personalities.cells import (
    UNIT_ENTRIES,
    FirmwareObject,
    PersonalityRow,
    QuantityObject,
    RefusingCell,
    StoreCell,
    UnitCell,
    UnitCells,
)
from steptwin.features.personalities.file import (
    AccessName,
    Behind,
    MapName,
    ObjectTable,
    PdosTable,
    PdoTable,
    PersonalityFile,
    TypeName,
    read_personality_file,
)
from steptwin.features.personalities.units import turns_of
from steptwin.host.common.bad_input import prefixed, unknown
from steptwin.host.common.errors import InputError
from steptwin.protocol import od
from steptwin.protocol.entry import (
    QUANTITIES,
    Access,
    DataType,
    DictionaryObject,
    Entry,
    EntryUnit,
    ObjectCode,
)
from steptwin.protocol.entry import (
    Mapping as PdoMapping,
)
from steptwin.protocol.exports import EdsDevice
from steptwin.protocol.frame import COB_ID_INVALID, COB_ID_NO_RTR, COB_RPDO, COB_TPDO
from steptwin.protocol.object_view import DriveTraits, FirmwareCell, ViewedCell
from steptwin.protocol.objects import ENTRIES, PDO_ENTRIES_MAX
from steptwin.protocol.sdo_frames import AbortCode

_PLACE: Final = re.compile(r"([0-9A-F]{4})(?::([0-9A-F]{2}))?")
_TYPES: Final = {
    TypeName.I8: DataType.INTEGER8,
    TypeName.I16: DataType.INTEGER16,
    TypeName.I24: DataType.INTEGER24,
    TypeName.I32: DataType.INTEGER32,
    TypeName.U8: DataType.UNSIGNED8,
    TypeName.U16: DataType.UNSIGNED16,
    TypeName.U32: DataType.UNSIGNED32,
    TypeName.TEXT: DataType.VISIBLE_STRING,
}
_ACCESS: Final = {each: Access(each.value) for each in AccessName}
_MAPPINGS: Final = {
    MapName.NO: PdoMapping.NONE,
    MapName.RX: PdoMapping.RECEIVE,
    MapName.TX: PdoMapping.TRANSMIT,
    MapName.BOTH: PdoMapping.BOTH,
}


def read_place(text: str) -> int:
    """Return the address of an object such as 6081 or 6099:01; raise InputError for another text."""
    found = _PLACE.fullmatch(text.upper())
    if found is None:
        raise InputError(f"{text!r} is no object such as 6081 or 6099:01")
    return od.address_of(int(found[1], 16), int(found[2] or "0", 16))


class Personality:
    """The objects of a drive over StepTwin's firmware: an `ObjectView`.

    Attributes:
        name: name of the personality.
        device: name of the drive.
        rows: its entries by address, without the counts of sub-indexes.
        lacking: what the drive has and this personality has not.
        traits: the drive's behaviour.
        objects: its objects in the order of their indexes.
        entries: its entries by address.
    """

    def __init__(self, name: str, file: PersonalityFile) -> None:
        """Make the rows of a file; raise InputError, with the row, for what is wrong or contradicts itself."""
        self.name = name
        self.device: str = file.device
        self.lacking: Mapping[str, str] = file.lacking
        self.traits: DriveTraits = DriveTraits(
            zero_limits_off=bool(file.zero_limits_off), targets_at_arrival=bool(file.targets_at_arrival)
        )
        if file.increments_per_revolution is None:
            raise InputError("increments_per_revolution: is missing")
        if file.pdos is None:
            raise InputError("pdos: is missing")
        self._increments = file.increments_per_revolution
        self._hidden = {read_place(text): value for text, value in file.hidden.items()}
        self.rows: dict[int, PersonalityRow] = {}
        for text, table in file.objects.items():
            with prefixed(f"objects.{text}: "):
                self.rows[read_place(text)] = _row(read_place(text), table, file.sources)
        with prefixed("pdos: "):
            self.rows |= _pdo_rows(file.pdos, self.rows, file.sources)
        for address in self._hidden:
            if address not in ENTRIES or address in self.rows:
                raise InputError(f"hidden: {od.place_text(address)} is shown, or the firmware does not have it")
        records = {read_place(index) >> 8: title for index, title in file.records.items()}
        self.objects: tuple[DictionaryObject, ...] = tuple(_objects(self.rows, records))
        self.entries: Mapping[int, Entry] = {
            od.address_of(item.index, i): entry for item in self.objects for i, entry in item.entries.items()
        }
        self._check()

    def _check(self) -> None:
        """Raise InputError for a personality without what each drive must have, or with a unit that is unknown."""
        for address in (od.DEVICE_TYPE, od.ERROR_REGISTER, od.VENDOR_ID, od.PRODUCT_CODE, od.REVISION_NUMBER):
            if address not in self.entries:
                raise InputError(f"objects: {od.place_text(address)} is missing; each CANopen device has it")
        unit = self.entries.get(od.SI_UNIT_POSITION)
        if unit is None:
            raise InputError("objects: 60A8, the unit of positions, is missing")
        for address in UNIT_ENTRIES[:3]:
            if address in self.entries:
                with prefixed(f"objects.{address >> 8:04X}: "):
                    try:
                        turns_of(int(self.entries[address].default), self._increments)
                    except ValueError as error:
                        raise InputError(str(error)) from error

    def cells(self, firmware: Mapping[int, FirmwareCell]) -> Mapping[int, ViewedCell]:
        """Return new cells of one node; those of the units come first, since a reset must know the units."""
        units = UnitCells(self._increments, firmware[od.SI_UNIT_POSITION])
        made: dict[int, ViewedCell] = {}
        for address, entry in self.entries.items():
            if entry.data_type is DataType.VISIBLE_STRING:
                continue
            row = self.rows.get(address)
            if address in UNIT_ENTRIES:
                made[address] = UnitCell(address, entry, units)
            elif row is None or row.behind in (Behind.CONSTANT, Behind.STORE):
                made[address] = StoreCell(entry)
            elif row.behind is Behind.REFUSE:
                made[address] = RefusingCell(entry, AbortCode.DEVICE_STATE)
            elif entry.unit in QUANTITIES:
                assert row.firmware is not None
                quantity = made[address] = QuantityObject(row, firmware[row.firmware])
                units.quantities.append(quantity)
            else:
                assert row.firmware is not None
                made[address] = FirmwareObject(row, firmware[row.firmware])
        for address, value in self._hidden.items():
            entry = replace(ENTRIES[address], default=value)
            made[address] = FirmwareObject(PersonalityRow(entry, Behind.FIRMWARE, address, {}, ""), firmware[address])
        return {address: made[address] for address in sorted(made, key=lambda each: each not in UNIT_ENTRIES)}

    def eds(self) -> EdsDevice:
        """Return the device for its EDS."""
        comment = f"StepTwin: a simulated axis with the objects of {self.device}"
        return EdsDevice(f"{self.name}.eds", f"{self.device} (SIMULATED)", "StepTwin", self.name, comment, self.objects)


def load_personality(given: str, folder: Path = Path()) -> Personality:
    """Return a personality by its name, or by the path of its file from a folder.

    Raises:
        InputError: there is no such personality, or something is wrong in its file.
    """
    file = read_personality_file(given, folder)
    with prefixed(f"personality={given}: "):
        return Personality(Path(given).stem, file)


# --- rows


def _sources(text: str, sources: Mapping[str, str]) -> str:
    for each in text.split(","):
        if each.strip() not in sources:
            raise InputError(f"source: {str(unknown('', each.strip(), sources)).lstrip()}")
    return text


def _row(address: int, table: ObjectTable, sources: Mapping[str, str]) -> PersonalityRow:
    """Return the row of a table, with what it leaves out from the firmware's object."""
    source = _sources(table.source, sources)
    behind, place = table.behind, address
    if table.of is not None:
        with prefixed("of: "):
            place = read_place(table.of)
    own = ENTRIES.get(place)
    if behind is Behind.FIRMWARE and own is None:
        raise InputError(f"the firmware has no {od.place_text(place)}; behind may be constant, store or refuse")
    if own is None:
        for key in ("name", "type", "access"):
            if getattr(table, key) is None:
                raise InputError(f"{key}: is missing, and the firmware has no such object that has it")
        own = Entry("", DataType.UNSIGNED8, Access.READ_ONLY)
    entry = _with_given(own, table)
    if behind is not Behind.FIRMWARE:
        entry = replace(entry, unit=EntryUnit.NONE, title=entry.name)
    if behind is Behind.CONSTANT and entry.access is Access.READ_WRITE:
        entry = replace(entry, access=Access.CONST)
    kind = own.data_type
    if entry.unit in QUANTITIES and table.default is None and own.default not in (0, kind.low, kind.high):
        raise InputError("default: is missing, in the drive's own unit")
    entry = _within_type(entry, own)
    _check_default(entry)
    with prefixed("codes: "):
        codes = {_code(key): value for key, value in table.codes.items()}
    return PersonalityRow(entry, behind, place if behind is Behind.FIRMWARE else None, codes, source)


def _with_given(own: Entry, table: ObjectTable) -> Entry:
    """Return an entry with what a table gives in place of the firmware's values."""
    entry = replace(own, read="", write="")
    if table.name is not None:
        entry = replace(entry, title=table.name)
    if table.type is not None:
        entry = replace(entry, data_type=_TYPES[table.type])
    if table.access is not None:
        entry = replace(entry, access=_ACCESS[table.access])
    if table.map is not None:
        entry = replace(entry, mapping=_MAPPINGS[table.map])
    if table.plus_node_id is not None:
        entry = replace(entry, plus_node_id=table.plus_node_id)
    if table.values is not None:
        entry = replace(entry, values=table.values)
    default = table.default if table.text is None else table.text
    return replace(
        entry,
        default=own.default if default is None else default,
        low=own.low if table.low is None else table.low,
        high=own.high if table.high is None else table.high,
    )


def _within_type(entry: Entry, own: Entry) -> Entry:
    """Return an entry without the firmware's limits if its type is another one."""
    if entry.data_type is own.data_type:
        return entry
    return replace(
        entry,
        low=None if entry.low is own.low else entry.low,
        high=None if entry.high is own.high else entry.high,
        values=None if entry.values is own.values else entry.values,
    )


def _check_default(entry: Entry) -> None:
    kind, default = entry.data_type, entry.default
    if (kind is DataType.VISIBLE_STRING) is not isinstance(default, str):
        raise InputError(f"default: {default!r} is not of the type {kind.name}")
    if isinstance(default, str):
        return
    low = kind.low if entry.low is None else max(entry.low, kind.low)
    high = kind.high if entry.high is None else min(entry.high, kind.high)
    if not low <= default <= high:
        raise InputError(f"default: {default} is not from {low} to {high}")
    if entry.values is not None and default not in entry.values:
        raise InputError(f"default: {default} is not one of the values {', '.join(map(str, sorted(entry.values)))}")


def _code(text: str) -> int:
    try:
        return int(text)
    except ValueError:
        raise InputError(f"{text!r} is no whole number") from None


def _pdo_rows(
    table: PdosTable, rows: Mapping[int, PersonalityRow], sources: Mapping[str, str]
) -> dict[int, PersonalityRow]:
    """Return the rows of the communication and mapping parameters."""
    source = _sources(table.source, sources)
    found: dict[int, PersonalityRow] = {}

    def add(address: int, default: int, *, store: bool = False) -> None:
        own = ENTRIES[address if address in ENTRIES else _like(address)]
        entry = replace(own, default=default, read="", write="", plus_node_id=own.plus_node_id and not store)
        if store:
            entry = replace(entry, values=(default,))
        behind = Behind.STORE if store else Behind.FIRMWARE
        found[address] = PersonalityRow(entry, behind, None if store else address, {}, source)

    for pdos, cob_ids, first, first_map, parameters, kind, flags in (
        (table.receive, COB_RPDO, 0x1400, 0x1600, table.receive_parameters, PdoMapping.RECEIVE, 0),
        (table.transmit, COB_TPDO, 0x1800, 0x1A00, table.transmit_parameters, PdoMapping.TRANSMIT, COB_ID_NO_RTR),
    ):
        if len(pdos) != len(cob_ids):
            raise InputError(f"receive and transmit list {len(cob_ids)} PDOs each, not {len(pdos)}")
        for i in range(len(pdos) + table.further):
            pdo, further = (pdos[i], False) if i < len(pdos) else (PdoTable(valid=False), True)
            cob_id = flags | (0 if pdo.valid else COB_ID_INVALID) | (0 if further else cob_ids[i])
            values = {1: cob_id, 2: pdo.type, 3: pdo.inhibit_100us, 5: pdo.event_timer_ms, 6: 0}
            for subindex in parameters:
                if subindex not in values:
                    raise InputError(f"parameters: {subindex} is not one of 1, 2, 3, 5, 6")
                add(od.address_of(first + i, subindex), values[subindex], store=further)
            words = [_word(text, rows, kind) for text in pdo.map]
            if len(words) > PDO_ENTRIES_MAX or sum(word & 0xFF for word in words) > 64:
                raise InputError(f"PDO {i + 1} maps more than {PDO_ENTRIES_MAX} objects or 64 bits")
            add(od.address_of(first_map + i), len(words), store=further)
            for subindex in range(1, table.mapped_objects + 1):
                word = words[subindex - 1] if subindex <= len(words) else 0
                beyond = subindex > PDO_ENTRIES_MAX
                add(od.address_of(first_map + i, subindex), word, store=further or beyond)
    return found


def _like(address: int) -> int:
    """Return the firmware's parameter that a further one is like."""
    index, subindex = address >> 8 & 0xFE00, min(address & 0xFF, PDO_ENTRIES_MAX)
    return od.address_of(index, subindex)


def _word(text: str, rows: Mapping[int, PersonalityRow], kind: PdoMapping) -> int:
    """Return the word that maps an object; raise InputError for one that such a PDO cannot carry."""
    address = read_place(text)
    row = rows.get(address)
    if row is None or not row.entry.mapping.value & kind.value:
        raise InputError(f"{text} is no object that {'RPDOs' if kind is PdoMapping.RECEIVE else 'TPDOs'} may carry")
    return address << 8 | 8 * row.entry.data_type.size


def _objects(rows: Mapping[int, PersonalityRow], records: Mapping[int, str]) -> Iterator[DictionaryObject]:
    """Yield the objects in the order of their indexes, with the counts of sub-indexes."""
    for index, addresses in groupby(sorted(rows), key=lambda address: address >> 8):
        entries = {address & 0xFF: rows[address].entry for address in addresses}
        if max(entries) == 0:
            yield DictionaryObject(index, entries[0].name, ObjectCode.VARIABLE, entries)
            continue
        like = index if index in od.NAMES else index & 0xFE00
        if index in records:
            types = {entry.data_type for i, entry in entries.items() if i}
            title, code = records[index], ObjectCode.ARRAY if len(types) == 1 else ObjectCode.RECORD
        elif like in od.NAMES:
            title, code = od.NAMES[like]
        else:
            raise InputError(f"records: {index:04X} is missing: the object has sub-indexes and no name")
        count = Entry("Highest sub-index supported", DataType.UNSIGNED8, Access.CONST, max(entries))
        yield DictionaryObject(index, title, code, {0: count} | entries)
