"""Device descriptions of further nodes: what is read of them, and that anything else ends in one line."""

import re
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from steptwin.emulator.bus.node_objects import NodeDescription, ValueForm
from steptwin.host.cli.app import run
from steptwin.host.common.errors import InputError
from steptwin.host.twin.machine.eds_nodes import read_node
from steptwin.protocol.entry import Access
from steptwin.protocol.exports import render_eds
from steptwin.protocol.objects import ENTRIES
from tests.emulator.bus.test_simple_node import EDS

TEXT = EDS.read_text(encoding="utf-8")


def described(folder: Path, text: str) -> NodeDescription:
    path = folder / "changed.eds"
    path.write_text(text, encoding="utf-8")
    return read_node(0x40, path, axes=4)


def test_our_own_axis_is_read_as_it_is(tmp_path: Path) -> None:
    description = described(tmp_path, render_eds())
    assert set(description.entries) == set(ENTRIES)
    for address, entry in description.entries.items():
        own = ENTRIES[address]
        assert (entry.access, entry.size) == (own.access, own.data_type.size)
        if entry.form is ValueForm.WHOLE:
            assert entry.default == int(own.default) + 0x40 * own.plus_node_id


def test_compact_arrays_have_all_their_entries() -> None:
    entries = read_node(0x40, EDS, axes=4).entries
    assert [entries[0x6000_00 + i].default for i in range(3)] == [2, 0, 0]
    assert entries[0x6000_02].mappable
    assert entries[0x6000_00].access is Access.READ_ONLY


@pytest.mark.parametrize(
    ("old", "new", "told"),
    [
        ("[DeviceInfo]", "[Other]", "has no section [DeviceInfo], so it is no EDS"),
        ("ParameterName=Device type\n", "", "[1000] has no ParameterName"),
        ("DataType=3\n", "DataType=none\n", "[2401] DataType=none: is no whole number: these are 8, 0x8, octal 010"),
        ("AccessType=rww", "AccessType=all", "[2401] AccessType=all: is not one of ro, wo, rw, rwr, rww, const"),
        ("LowLimit=-100", "LowLimit=101", "[2401] LowLimit=101: is above HighLimit=100"),
        ("DefaultValue=255", "DefaultValue=256", "[1400sub2] DefaultValue=256: 256 is not from 0 to 255"),
        ("0x24010010", "0x24010008", "0x1600:03 maps 0x2401:00 with 8 bits, which such a PDO cannot carry"),
        ("0x24020001", "0x24030040", "0x1A00:02 maps 0x2403:00 with 64 bits, which such a PDO cannot carry"),
        ("CompactSubObj=2", "CompactSubObj=255", "[6000] CompactSubObj=255: is not from 1 to 254"),
        ("[2400]", "no ini file", "'no ini file' in [1A01sub2] is no key with its value"),
        ("[2402]", "[2401]", "[2401] is there twice"),
        ("DefaultValue=255", "DefaultValue=255\ndefaultvalue=1", "[1400sub2] has defaultvalue twice"),
        ("ObjectType=7", "ObjectType=5", "[1000] ObjectType=5: is none of 2 (DOMAIN), 7 (VAR), 8 (ARRAY) and 9"),
    ],
)
def test_what_is_wrong_in_it_is_told_in_a_line(tmp_path: Path, old: str, new: str, told: str) -> None:
    assert old in TEXT
    with pytest.raises(InputError, match=re.escape(told)) as caught:
        described(tmp_path, TEXT.replace(old, new, 1))
    assert len(str(caught.value).splitlines()) == 1


@given(st.integers(0, len(TEXT) - 1), st.integers(0, 40), st.text(st.characters(codec="utf-8"), max_size=12))
@settings(deadline=None)
def test_a_damaged_file_is_read_or_refused(
    tmp_path_factory: pytest.TempPathFactory, at: int, cut: int, put: str
) -> None:
    complaint = ""
    try:
        described(tmp_path_factory.getbasetemp(), TEXT[:at] + put + TEXT[at + cut :])
    except InputError as error:
        complaint = str(error)
    assert len(complaint.splitlines()) <= 1


def test_the_command_ends_in_one_line(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    broken = tmp_path / "b.eds"
    broken.write_text("[DeviceInfo]\n", encoding="utf-8")
    assert run(["serve", "lab-scara", "--node", f"0x40={broken}"]) == 2
    lines = capsys.readouterr().err.splitlines()
    assert lines == [f"steptwin: --node 0x40={broken}: has no objects, so it is no EDS"]
