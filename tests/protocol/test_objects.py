"""The object table as a whole: each entry has one name in `od`, and a unit wherever its name speaks of one."""

import pytest

from steptwin.protocol import od
from steptwin.protocol.entry import Entry, EntryUnit, ObjectCode
from steptwin.protocol.objects import ENTRIES, OBJECTS, RPDO_DEFAULTS, TPDO_DEFAULTS

PDO_PARAMETERS = od.RPDO_COMMUNICATION + od.RPDO_MAPPING + od.TPDO_COMMUNICATION + od.TPDO_MAPPING
COUNTS = {od.address_of(item.index) for item in OBJECTS if item.code is not ObjectCode.VARIABLE}
"""Sub-index 0 of each object that has several entries."""


def test_every_entry_has_one_name() -> None:
    """Counts need no name but the error history's, which clears it; the PDOs' entries are named by their parts."""
    values = [value for name, value in vars(od).items() if name.isupper()]
    alone = [value for value in values if isinstance(value, int) and value in ENTRIES]
    in_rows = [each for value in values if isinstance(value, tuple) for each in value if each in ENTRIES]
    assert len(alone) == len(set(alone))
    assert len(in_rows) == len(set(in_rows))
    assert set(alone) & set(in_rows) == {*od.STORES, *od.RESTORES}
    entries = {address for address in ENTRIES if address >> 8 not in PDO_PARAMETERS} - COUNTS
    assert {*alone, *in_rows} == entries | {od.ERROR_HISTORY_COUNT}


def test_the_pdos_parameters_are_in_the_table() -> None:
    indices = [item.index for item in OBJECTS if 0x1400 <= item.index < 0x1C00]
    assert indices == sorted(PDO_PARAMETERS)
    subindices = (od.PDO_COB_ID, od.PDO_TRANSMISSION_TYPE, od.PDO_INHIBIT_TIME, od.PDO_EVENT_TIMER, od.PDO_SYNC_START)
    for index in od.RPDO_COMMUNICATION:
        assert [address & 0xFF for address in ENTRIES if address >> 8 == index] == [0, 1, 2, od.PDO_EVENT_TIMER]
    for index in od.TPDO_COMMUNICATION:
        assert [address & 0xFF for address in ENTRIES if address >> 8 == index] == [0, *subindices]


def test_objects_are_in_order_and_known_by_their_places() -> None:
    assert [*ENTRIES] == sorted(ENTRIES)
    assert len({item.index for item in OBJECTS}) == len(OBJECTS)


@pytest.mark.parametrize(
    ("title", "name", "short_name"),
    [
        ("Statusword", "Statusword", "Statusword"),
        ("Timeout in {unit}; 0: none", "Timeout in ms; 0: none", "Timeout"),
        ("Sequence number: writing it queues", "Sequence number: writing it queues", "Sequence number"),
    ],
)
def test_names_of_an_entry(title: str, name: str, short_name: str) -> None:
    base = ENTRIES[od.HOMING_TIMEOUT_MS]
    entry = Entry(title, base.data_type, base.access, unit=EntryUnit.MS)
    assert (entry.name, entry.short_name) == (name, short_name)


def test_titles_that_speak_of_a_unit_have_one() -> None:
    for address, entry in ENTRIES.items():
        assert "{unit}" not in entry.title or entry.unit is not EntryUnit.NONE, od.place_text(address)
        words = {unit.value for unit in EntryUnit} - {""}
        assert not any(f" in {word}" in entry.title.partition(":")[0] for word in words), od.place_text(address)


def test_default_pdos_hold_at_most_eight_bytes_that_may_be_mapped() -> None:
    for pdo in (*RPDO_DEFAULTS, *TPDO_DEFAULTS):
        assert sum(ENTRIES[address].data_type.size for address in pdo.mapping) <= 8
