"""The default PDOs, and the whole object dictionary: the rows of `od` and the parameters of the PDOs."""

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import groupby
from typing import Final

from steptwin.protocol import od
from steptwin.protocol.entry import Access, DictionaryObject, Entry, ObjectCode
from steptwin.protocol.frame import COB_ID_INVALID, COB_ID_NO_RTR, COB_RPDO, COB_TPDO
from steptwin.protocol.od import U8, U16, U32

SYNCHRONOUS: Final = 1
"""Transmission type: with every SYNC."""
ANY_CHANGE: Final = 254
"""Transmission type: on the change of any mapped value, and by the event timer."""
ASYNCHRONOUS: Final = 255
"""Transmission type: on a change that the drive announces, and by the event timer."""


@dataclass(frozen=True, slots=True)
class PdoDefault:
    """A PDO's parameters after power-up.

    Attributes:
        transmission_type: see CiA 301, section 7.5.2.37.
        mapping: addresses of the entries that it carries, in their order on the wire.
        inhibit_100us: shortest time between two transmissions in 100 us.
        event_timer_ms: longest time between two transmissions or receptions; 0 for no timer.
        enabled: False if its COB-ID is marked invalid.
    """

    transmission_type: int
    mapping: tuple[int, ...]
    inhibit_100us: int = 0
    event_timer_ms: int = 0
    enabled: bool = True


RPDO_DEFAULTS: Final = (
    PdoDefault(ASYNCHRONOUS, (od.CONTROLWORD, od.MODE_OF_OPERATION)),
    PdoDefault(SYNCHRONOUS, (od.CONTROLWORD,)),
    PdoDefault(SYNCHRONOUS, (od.TARGET_POSITION,)),
    PdoDefault(ASYNCHRONOUS, (od.PVT_DISPLACEMENT, od.PVT_END_VELOCITY, od.PVT_DURATION_MS, od.PVT_SEQUENCE)),
)
TPDO_DEFAULTS: Final = (
    PdoDefault(ASYNCHRONOUS, (od.STATUSWORD, od.MODE_OF_OPERATION_DISPLAY, od.POSITION_ACTUAL), 50, 100),
    PdoDefault(SYNCHRONOUS, (od.POSITION_ACTUAL, od.VELOCITY_ACTUAL), enabled=False),
    PdoDefault(
        ASYNCHRONOUS,
        (od.PVT_NEXT_SEQUENCE, od.PVT_FREE_RECORDS, od.PVT_FLAGS, od.PVT_EXECUTING_SEQUENCE, od.BOARD_CLOCK_US),
        100,
        100,
    ),
    PdoDefault(ASYNCHRONOUS, (od.DIGITAL_INPUTS, od.ERROR_CODE)),
)


DUMMY_BITS: Final = {0x0001: 1, 0x0002: 8, 0x0003: 16, 0x0004: 32, 0x0005: 8, 0x0006: 16, 0x0007: 32}
"""Length in bits of the data types that an RPDO may map as dummies, by index (CiA 301, section 7.4.8.2 and table 44).

With dummies one RPDO serves several nodes: each node maps its own entries, and dummies in place of the others'.
"""
PDO_ENTRIES_MAX: Final = 8


def _communication(kind: str, index: int, cob_id: int, pdo: PdoDefault) -> None:
    """Add the communication parameter that RPDOs and TPDOs share (CiA 301, section 7.5.2.35)."""
    od.record(index, f"{kind} communication parameter")
    place = od.address_of(index)
    od.rw(place + od.PDO_COB_ID, U32, "COB-ID", cob_id, plus_node_id=True, write="ProcessData.check_cob_id_at")
    od.rw(
        place + od.PDO_TRANSMISSION_TYPE,
        U8,
        "Transmission type",
        pdo.transmission_type,
        write="ProcessData.check_transmission_type",
    )
    od.rw(
        place + od.PDO_EVENT_TIMER,
        U16,
        "Event timer in {unit}",
        pdo.event_timer_ms,
        unit=od.MS,
        write="ProcessData.check_configurable",
    )


def _mapping(kind: str, index: int, mapping: tuple[int, ...]) -> None:
    """Add a mapping parameter: for each mapped entry, a word of its address and length (CiA 301, section 7.5.2.38)."""
    od.record(index, f"{kind} mapping parameter")
    words = [address << 8 | 8 * od.ROWS[address].data_type.size for address in mapping]
    words += [0] * (PDO_ENTRIES_MAX - len(words))
    place = od.address_of(index)
    od.rw(place, U8, "Number of mapped objects", len(mapping), 0, PDO_ENTRIES_MAX, write="ProcessData.check_count_at")
    for i, word in enumerate(words, start=1):
        od.rw(place + i, U32, f"Mapped object {i}", word, write="ProcessData.check_mapped_at")


def _add_pdos() -> None:
    for i, pdo in enumerate(RPDO_DEFAULTS):
        _communication(f"RPDO{i + 1}", od.RPDO_COMMUNICATION[i], COB_RPDO[i], pdo)
        _mapping(f"RPDO{i + 1}", od.RPDO_MAPPING[i], pdo.mapping)
    for i, pdo in enumerate(TPDO_DEFAULTS):
        cob_id = COB_TPDO[i] | COB_ID_NO_RTR | (0 if pdo.enabled else COB_ID_INVALID)
        _communication(f"TPDO{i + 1}", od.TPDO_COMMUNICATION[i], cob_id, pdo)
        place, while_invalid = od.address_of(od.TPDO_COMMUNICATION[i]), "ProcessData.check_while_invalid_at"
        title, inhibit_100us = "Inhibit time in {unit}", pdo.inhibit_100us  # CiA 301, section 7.5.2.37
        od.rw(place + od.PDO_INHIBIT_TIME, U16, title, inhibit_100us, unit=od.HUNDRED_US, write=while_invalid)
        od.rw(place + od.PDO_SYNC_START, U8, "SYNC start value", 0, 0, 240, write=while_invalid)
        _mapping(f"TPDO{i + 1}", od.TPDO_MAPPING[i], pdo.mapping)


def _objects() -> Iterator[DictionaryObject]:
    """Yield all objects in index order. Sub-index 0 holds the highest sub-index, unless a row defines it."""
    for index, addresses in groupby(sorted(od.ROWS), key=lambda address: address >> 8):
        entries = {address & 0xFF: od.ROWS[address] for address in addresses}
        if index in od.NAMES:
            count = Entry("Highest sub-index supported", U8, Access.CONST, max(entries))
            yield DictionaryObject(index, *od.NAMES[index], {0: count} | entries)
        else:
            yield DictionaryObject(index, entries[0].name, ObjectCode.VARIABLE, entries)


_add_pdos()
OBJECTS: Final = tuple(_objects())
"""The whole dictionary, in index order."""
ENTRIES: Final = {od.address_of(item.index, i): entry for item in OBJECTS for i, entry in item.entries.items()}
"""All entries by address, in order."""
