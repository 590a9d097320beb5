"""Values of device descriptions: what CiA 306 lets a file write, and that the rest is refused with section and key."""

from io import StringIO
from pathlib import Path

import pytest
from canopen import ObjectDictionary
from canopen.objectdictionary import ODVariable, eds

from steptwin.features.nodes.eds_nodes import ENTRIES_MAX, read_node
from steptwin.features.nodes.node_objects import NodeEntry, NodeObjects
from steptwin.host.common.errors import InputError
from steptwin.protocol.objects import DUMMY_BITS
from tests.features.nodes.test_simple_node import EDS
from tests.messages import refusing

NODE_ID = 0x25
HEAD = """[DeviceInfo]
VendorName=Nobody
VendorNumber=
[4000]
ParameterName=Input
DataType=7
AccessType=rww
PDOMapping=1
"""


def entries(folder: Path, text: str, encoding: str = "utf-8") -> dict[int, NodeEntry]:
    path = folder / "a.eds"
    path.write_text(HEAD + text, encoding=encoding)
    return dict(read_node(NODE_ID, path, axes=4).entries)


def value(folder: Path, text: str, data_type: str = "7", key: str = "DefaultValue") -> object:
    section = f"[2000]\nParameterName=a\nDataType={data_type}\nAccessType=rw\n{key}={text}\n"
    return entries(folder, section)[0x2000_00].default


@pytest.mark.parametrize(
    ("text", "number"),
    [
        ("10", 10),
        ("010", 8),
        ("0x10", 16),
        ("0X0A", 10),
        ("0", 0),
        ("00", 0),
        ("", 0),
        ("$NODEID", 0x25),
        ("$nodeid+0x180", 0x1A5),
        ("0x180+$NODEID", 0x1A5),
        ("$NODEID + 384", 0x1A5),
        ("0x80000000+$NodeID+0x180", 0x8000_01A5),
        ("0x600 - 1", 0x5FF),
        ("12 ; twelve", 12),
    ],
)
def test_a_whole_number_is_read_as_cia_306_has_it(tmp_path: Path, text: str, number: int) -> None:
    assert value(tmp_path, text) == number


@pytest.mark.parametrize(
    "text", ["08", "10h", "1.5", "abc", "0x", "$NODEID+", "$NODE", "1 2", "--1", "1e3", "9" * 5000]
)
def test_what_is_no_number_is_refused_with_section_and_key(tmp_path: Path, text: str) -> None:
    with pytest.raises(InputError) as caught:
        value(tmp_path, text)
    told = str(caught.value)
    assert f"[2000] DefaultValue={text[:100]}" in told
    assert len(told) < 500


@pytest.mark.parametrize("key", ["LowLimit", "HighLimit", "PDOMapping", "ParameterValue"])
def test_so_are_those_of_other_keys(tmp_path: Path, key: str) -> None:
    with pytest.raises(InputError, match=rf"\[2000\] {key}=08: "):
        value(tmp_path, "08", key=key)


@pytest.mark.parametrize(
    ("data_type", "text", "read"),
    [
        ("2", "0xFF", -1),
        ("2", "-128", -128),
        ("1", "1", 1),
        ("8", "-2.5", -2.5),
        ("8", "0x00", 0.0),
        ("9", "0x10", "0x10"),
        ("0xA", "01 fe", b"\x01\xfe"),
        ("0xA", "0", b""),
        ("0xC", "0x0102", b"\x02\x01\0\0\0\0"),
        ("0xF", "@ABCD", b"@ABCD"),
    ],
)
def test_values_of_other_types(tmp_path: Path, data_type: str, text: str, read: object) -> None:
    assert value(tmp_path, text, data_type) == read


@pytest.mark.parametrize(("data_type", "text"), [("8", "1,5"), ("8", "0x3F800000"), ("0xA", "123"), ("0xC", "-1")])
def test_and_what_is_none_of_them(tmp_path: Path, data_type: str, text: str) -> None:
    with pytest.raises(InputError, match=rf"\[2000\] DefaultValue={text}: "):
        value(tmp_path, text, data_type)


def test_the_value_of_a_dcf_counts_before_the_default(tmp_path: Path) -> None:
    section = "[2000]\nParameterName=a\nDataType=6\nAccessType=rw\nDefaultValue=5\nParameterValue=%s\n"
    assert entries(tmp_path, section % "0x07")[0x2000_00].default == 7
    assert entries(tmp_path, section % "")[0x2000_00].default == 5


COMPACT = """[2010]
ParameterName=Gain
ObjectType={kind}
DataType=0x0005
AccessType=rw
DefaultValue=4
CompactSubObj=3
[2010Value]
NrOfEntries=2
1=7
3=0x09
[2010Name]
NrOfEntries=1
2=Middle
"""


@pytest.mark.parametrize("kind", ["0x08", "0x09"])
def test_objects_described_at_once_have_the_values_and_names_that_are_listed(tmp_path: Path, kind: str) -> None:
    found = entries(tmp_path, COMPACT.format(kind=kind))
    gains = [found[0x2010_00 + i] for i in range(4)]
    assert [each.default for each in gains] == [3, 7, 4, 9]
    assert [each.name for each in gains[1:]] == ["Gain1", "Middle", "Gain3"]


def test_a_mapping_described_at_once_maps_what_has_a_value(tmp_path: Path) -> None:
    text = """[1400]
ParameterName=RPDO
ObjectType=9
[1400sub1]
ParameterName=COB-ID
DataType=7
AccessType=rw
DefaultValue=$NODEID+0x200
[1600]
ParameterName=Mapping
ObjectType=8
DataType=7
AccessType=rw
CompactSubObj=8
[1600Value]
NrOfEntries=1
1=0x40000020
"""
    objects = NodeObjects(read_node(NODE_ID, _written(tmp_path, text), axes=4))
    assert [objects.get(0x1600_00 + i) for i in range(3)] == [1, 0x4000_0020, 0]


def _written(folder: Path, text: str) -> Path:
    path = folder / "a.eds"
    path.write_text(HEAD + text, encoding="utf-8")
    return path


@pytest.mark.parametrize("line", ["4=1", "0x1=1", "x=1", f"{'1' * 5000}=1"])
def test_a_listed_value_of_no_sub_index_is_refused(tmp_path: Path, line: str) -> None:
    with pytest.raises(InputError, match=r"\[2010Value\] .*: the object has the sub-indexes 1 to 3"):
        entries(tmp_path, COMPACT.format(kind=8).replace("3=0x09", line))


def test_a_listed_value_that_cannot_be_read_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"\[2010Value\] 3=300: 300 is not from 0 to 255"):
        entries(tmp_path, COMPACT.format(kind=8).replace("3=0x09", "3=300"))


@pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig", "latin-1", "cp1252"])
def test_a_text_may_be_in_any_usual_encoding(tmp_path: Path, encoding: str) -> None:
    section = "[2001]\nParameterName=Grad °C\nDataType=9\nAccessType=ro\nDefaultValue=Größe\n"
    entry = entries(tmp_path, section, encoding)[0x2001_00]
    assert (entry.name, entry.default) == ("Grad °C", "Größe")
    assert entry.to_bytes("Größe") == b"Gr\xf6\xdfe"


@pytest.mark.parametrize("encoding", ["utf-8", "cp1252"])
def test_a_euro_sign_is_read_and_kept(tmp_path: Path, encoding: str) -> None:
    entry = entries(tmp_path, "[2001]\nParameterName=p\nDataType=9\nAccessType=ro\nDefaultValue=5 €\n", encoding)[
        0x2001_00
    ]
    assert entry.to_value(entry.to_bytes(entry.default)) == "5 €"


def test_capital_letters_spaces_and_an_empty_vendor_number_do_not_matter(tmp_path: Path) -> None:
    text = "[DUMMYUSAGE]\nDummy0002=1\n[ 200A ]\n  PARAMETERNAME = a\n\tobjecttype=0x7\nDATATYPE=5\naccesstype=RW\n"
    assert entries(tmp_path, text)[0x200A_00].name == "a"


def test_a_domain_needs_neither_type_nor_access(tmp_path: Path) -> None:
    assert entries(tmp_path, "[2001]\nParameterName=a\nObjectType=2\n")[0x2001_00].default == b""


def test_the_number_of_entries_is_bounded_before_they_are_made(tmp_path: Path) -> None:
    section = "[%04X]\nParameterName=a\nObjectType=8\nDataType=5\nAccessType=ro\nCompactSubObj=254\n"
    text = "".join(section % index for index in range(0x2000, 0x2000 + ENTRIES_MAX // 254 + 1))
    with pytest.raises(InputError, match=rf"describes \d+ entries; at most {ENTRIES_MAX} are read"):
        entries(tmp_path, text)


def test_the_canopen_library_reads_the_same() -> None:
    text = EDS.read_text(encoding="utf-8")
    dictionary: ObjectDictionary = eds.import_eds(StringIO(text), NODE_ID)  # type: ignore[no-untyped-call]
    own = read_node(NODE_ID, EDS, axes=4).entries
    for index, item in dictionary.items():
        variables = {0: item} if isinstance(item, ODVariable) else dict(item.subindices)
        for subindex, variable in variables.items():
            entry = own[index << 8 | subindex] if index >= 0x1000 else None
            if entry is not None and variable.default is not None:
                default = int(variable.default) - (1 << 32) if variable.default == 0xFFFF_FFFF else variable.default
                assert (entry.default, entry.low, entry.high) == (default, variable.min, variable.max)


MAPPED = """[1400]
ParameterName=RPDO
ObjectType=9
[1400sub0]
ParameterName=Number
DataType=5
AccessType=const
DefaultValue=2
[1400sub1]
ParameterName=COB-ID
DataType=7
AccessType=rw
DefaultValue=$NODEID+0x80000200
[1600]
ParameterName=Mapping
ObjectType=9
[1600sub0]
ParameterName=Number
DataType=5
AccessType=rw
[1600sub1]
ParameterName=First
DataType=7
AccessType=rw
"""


@pytest.mark.parametrize(
    ("usage", "allowed"),
    [
        ("", {1, 2, 3, 4, 5, 6, 7}),
        ("[DummyUsage]\n", set()),
        ("[DummyUsage]\nDummy0002=1\nDummy0005=1\nDummy0006=0\n", {2, 5}),
        ("[dummyusage]\nDUMMY0007=0x1\n", {7}),
    ],
    ids=["no-section", "empty", "gaps", "other-letters"],
)
def test_dummies_are_those_that_the_file_allows(tmp_path: Path, usage: str, allowed: set[int]) -> None:
    path = tmp_path / "a.eds"
    path.write_text(HEAD + MAPPED + usage, encoding="latin-1")
    objects = NodeObjects(read_node(NODE_ID, path, axes=4))
    words = {index: index << 16 | bits for index, bits in DUMMY_BITS.items()}
    assert {index for index, word in words.items() if objects.why_not_mapped(word, received=True) is None} == allowed


def test_a_mapping_of_a_dummy_that_the_file_does_not_allow_is_refused(tmp_path: Path) -> None:
    mapped = MAPPED.replace("AccessType=rw\n[1600sub1]", "AccessType=rw\nDefaultValue=1\n[1600sub1]")
    with refusing(InputError):
        entries(tmp_path, f"{mapped}DefaultValue=0x00050008\n[DummyUsage]\nDummy0005=0\n")
