"""Device descriptions of further nodes: what is read of them, and that anything else ends in one line."""

from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from steptwin.features.nodes.eds_nodes import read_node
from steptwin.features.nodes.node_objects import NodeDescription, ValueForm
from steptwin.host.cli.app import run
from steptwin.host.common.errors import InputError
from steptwin.protocol.entry import Access
from steptwin.protocol.exports import render_eds
from steptwin.protocol.objects import ENTRIES
from tests.features.nodes.test_simple_node import EDS
from tests.messages import refusing

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
    ("old", "new"),
    [
        ("[DeviceInfo]", "[Other]"),
        ("ParameterName=Device type\n", ""),
        ("DataType=3\n", "DataType=none\n"),
        ("AccessType=rww", "AccessType=all"),
        ("LowLimit=-100", "LowLimit=101"),
        ("DefaultValue=255", "DefaultValue=256"),
        ("0x24010010", "0x24010008"),
        ("0x24020001", "0x24030040"),
        ("CompactSubObj=2", "CompactSubObj=255"),
        ("[2400]", "no ini file"),
        ("[2402]", "[2401]"),
        ("DefaultValue=255", "DefaultValue=255\ndefaultvalue=1"),
        ("ObjectType=7", "ObjectType=5"),
    ],
)
def test_what_is_wrong_in_it_is_told_in_a_line(tmp_path: Path, old: str, new: str) -> None:
    assert old in TEXT
    with refusing(InputError) as caught:
        described(tmp_path, TEXT.replace(old, new, 1))
    assert len(str(caught.value).splitlines()) == 1


@pytest.mark.slow
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
    assert run(["serve", "lab-scara", "--machine", f"node=0x40={broken}"]) == 2
    lines = capsys.readouterr().err.splitlines()
    assert lines == [f"steptwin: --machine node=0x40={broken}: has no objects, so it is no EDS"]
