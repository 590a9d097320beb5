"""The electronic data sheet, as programs read it that nobody here wrote: canopen, and lely's dcfchk and dcfgen."""

import configparser
import io
import struct
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import cantools
import pytest
from canopen.objectdictionary import eds as canopen_eds
from cantools.database.can import Database

from steptwin.controller.motion.backend import Kernel
from steptwin.protocol.entry import Access, DataType, ObjectCode
from steptwin.protocol.exports import AxisNames, render_dbc, render_eds
from steptwin.protocol.frame import COB_EMCY, COB_TPDO
from steptwin.protocol.nmt import NmtCommand
from steptwin.protocol.objects import ENTRIES, OBJECTS, RPDO_DEFAULTS, TPDO_DEFAULTS
from steptwin.protocol.pvt import PvtRecord
from tests.controller.bench_board import BenchBoard

RANGES = {
    2: (-(1 << 7), (1 << 7) - 1),
    3: (-(1 << 15), (1 << 15) - 1),
    4: (-(1 << 31), (1 << 31) - 1),
    5: (0, (1 << 8) - 1),
    6: (0, (1 << 16) - 1),
    7: (0, (1 << 32) - 1),
    0x10: (-(1 << 23), (1 << 23) - 1),
}
"""Ranges of the data types, by their codes (CiA 301, table 44)."""
VISIBLE_STRING = 9

MASTER = """
options:
  dcf_path: {folder}
master:
  node_id: 127
  sync_period: 10000
  heartbeat_producer: 100
  heartbeat_consumer: true
"""
AXIS = """
axis_{node_id}:
  dcf: {eds}
  node_id: {node_id}
  heartbeat_producer: 100
  heartbeat_consumer: true
  error_behavior: {{1: 2}}
  rpdo:
    3:
      transmission: 255
      mapping:
        - {{index: 0x607A, sub_index: 0}}
        - {{index: 0x6060, sub_index: 0}}
  tpdo:
    2:
      enabled: true
      cob_id: auto
      transmission: 2
      mapping:
        - {{index: 0x6064, sub_index: 0}}
        - {{index: 0x6041, sub_index: 0}}
  sdo:
    - {{index: 0x6007, sub_index: 0, value: 3}}
    - {{index: 0x6081, sub_index: 0, value: 16384}}
"""

CONFIGURED = {
    0x1017_00: 100,
    0x1029_01: 2,
    0x1402_02: 255,
    0x1801_02: 2,
    0x1A01_02: 0x6041_0010,
    0x1602_02: 0x6060_0008,
    0x6007_00: 3,
    0x6081_00: 16384,
}
"""What this asks of each axis, by address."""
SLIDE = AxisNames("sx", "mm", 655_360.0 / 16)
PLAIN = AxisNames("Axis1")


def sections() -> dict[str, configparser.SectionProxy]:
    """The sections of the entries that have a value, by their names."""
    sheet = configparser.RawConfigParser()
    sheet.read_string(render_eds())
    return {name: sheet[name] for name in sheet.sections() if "DataType" in sheet[name]}


def test_the_canopen_library_reads_every_entry() -> None:
    dictionary = canopen_eds.import_eds(io.StringIO(render_eds()), 0x12)  # type: ignore[no-untyped-call]
    for item in OBJECTS:
        for subindex, entry in item.entries.items():
            found = dictionary.get_variable(item.index, subindex)
            assert found is not None, f"{item.index:04X}:{subindex}"
            assert found.data_type == entry.data_type
            assert found.readable is (entry.access is not Access.WRITE_ONLY)
            assert found.writable is (entry.access in (Access.READ_WRITE, Access.WRITE_ONLY))
            assert found.default == (int(entry.default) + 0x12 if entry.plus_node_id else entry.default)
            assert found.name == (item.name if item.code is ObjectCode.VARIABLE else entry.name)
            if entry.low is not None and entry.data_type is not DataType.INTEGER24:
                assert found.min == entry.low


def test_the_same_table_gives_the_same_bytes() -> None:
    assert render_eds() == render_eds()


def test_each_default_lies_within_its_limits() -> None:
    for name, section in sections().items():
        code = int(section["DataType"], 0)
        if code == VISIBLE_STRING:
            continue
        low, high = RANGES[code]
        low = max(low, int(section.get("LowLimit", str(low)), 0))
        high = min(high, int(section.get("HighLimit", str(high)), 0))
        for node_id in (1, 127):
            default = sum(node_id if part == "$NODEID" else int(part, 0) for part in section["DefaultValue"].split("+"))
            assert low <= default <= high, name


@pytest.mark.parametrize(
    ("name", "access", "mapping"),
    [
        ("6040", "rww", "1"),
        ("60C1sub4", "rww", "1"),
        ("60FEsub1", "rww", "1"),
        ("60FF", "rww", "1"),
        ("607A", "rw", "1"),
        ("6041", "ro", "1"),
        ("6007", "rw", "0"),
        ("2017sub2", "wo", "0"),
        ("1000", "const", "0"),
    ],
)
def test_access_says_which_pdos_take_an_entry(name: str, access: str, mapping: str) -> None:
    section = sections()[name]
    assert (section["AccessType"], section["PDOMapping"]) == (access, mapping)


@pytest.fixture
def sheet(tmp_path: Path) -> Path:
    """The data sheet as a file."""
    path = tmp_path / "axis.eds"
    path.write_text(render_eds(), encoding="ascii")
    return path


def run_lely(*arguments: str) -> None:
    """Run a tool of lely-core's dcf-tools; a warning of it is an error."""
    done = subprocess.run(
        [sys.executable, "-W", "error::UserWarning", "-W", "ignore:pkg_resources:UserWarning", "-m", *arguments],
        capture_output=True,
        text=True,
        check=False,
    )
    assert (done.returncode, done.stderr) == (0, "")


@pytest.mark.slow
def test_lely_dcfchk_accepts_it(sheet: Path) -> None:
    run_lely("dcf.cli", "-n", "16", str(sheet))


@pytest.mark.slow
def test_lely_dcfgen_configures_four_nodes_with_it(fast_kernel: Kernel, tmp_path: Path, sheet: Path) -> None:
    """The configurator of ros2_canopen writes what its master will send; nodes take each of these values."""
    nodes = range(0x10, 0x14)
    axes = "".join(AXIS.format(node_id=node_id, eds=sheet) for node_id in nodes)
    configuration = tmp_path / "master.yml"
    configuration.write_text(MASTER.format(folder=tmp_path) + axes, encoding="ascii")
    run_lely("dcfgen.cli", "-r", "-d", str(tmp_path), str(configuration))
    assert "[1F81Value]\nNrOfEntries=4\n" in (tmp_path / "master.dcf").read_text(encoding="ascii")
    board = BenchBoard(fast_kernel, axes=4)
    for axis, node_id in enumerate(nodes):
        board.nmt(NmtCommand.ENTER_PRE_OPERATIONAL)
        for address, data in concise(tmp_path / f"axis_{node_id}.bin"):
            board.firmware.nodes[axis].dictionary.write(address, data)
        assert {address: board.value(address, axis) for address in CONFIGURED} == CONFIGURED


def concise(path: Path) -> Iterator[tuple[int, bytes]]:
    """Yield the address and the bytes of each write in a concise DCF (CiA 302-3, object 1F22h)."""
    data = path.read_bytes()
    (count,), place = struct.unpack_from("<I", data), 4
    for _ in range(count):
        index, subindex, size = struct.unpack_from("<HBI", data, place)
        place += 7
        yield index << 8 | subindex, data[place : place + size]
        place += size
    assert place == len(data)


@pytest.fixture(scope="module")
def database() -> Database:
    loaded = cantools.database.load_string(render_dbc((SLIDE, PLAIN)), "dbc")
    assert isinstance(loaded, Database)
    return loaded


def test_every_default_pdo_of_every_axis_is_there(database: Database) -> None:
    for node_id in (0x10, 0x11):
        for base, mappings in (
            ((0x200, 0x300, 0x400, 0x500), [pdo.mapping for pdo in RPDO_DEFAULTS]),
            ((0x180, 0x280, 0x380, 0x480), [pdo.mapping for pdo in TPDO_DEFAULTS]),
        ):
            for cob_id, mapping in zip(base, mappings, strict=True):
                message = database.get_message_by_frame_id(cob_id + node_id)
                types = [ENTRIES[address].data_type for address in mapping]
                assert message.length == sum(kind.size for kind in types)
                assert [(s.start, s.length) for s in message.signals] == _places([8 * kind.size for kind in types])
                assert [s.is_signed for s in message.signals] == [kind.signed for kind in types]


def decode(database: Database, cob_id: int, data: bytes) -> dict[str, Any]:
    decoded = database.decode_message(cob_id, data)
    assert isinstance(decoded, dict)
    return decoded


def _places(widths: list[int]) -> list[tuple[int, int]]:
    places, first = [], 0
    for bits in widths:
        places.append((first, bits))
        first += bits
    return places


def test_a_record_decodes_in_the_axis_units(database: Database) -> None:
    data = PvtRecord(-40_960, 64 * 41, 10, 200).encode()
    decoded = decode(database, 0x510, data)
    assert decoded["Displacement"] == pytest.approx(-1.0)  # 40 960 units are 1 mm
    assert decoded["EndVelocity"] == pytest.approx(41 * 1000 / 40_960)  # 41 units/ms, in mm/s
    assert (decoded["Duration"], decoded["SequenceNumber"]) == (10, 200)
    message = database.get_message_by_frame_id(0x510)
    assert [signal.unit for signal in message.signals] == ["mm", "mm/s", "ms", None]
    assert decode(database, 0x511, data)["Displacement"] == -40_960
    assert database.get_message_by_frame_id(0x511).signals[0].unit == "1/16384 full step"


def test_status_emergency_heartbeat_and_nmt(database: Database) -> None:
    status = decode(database, COB_TPDO[0] + 0x10, bytes.fromhex("37160700A00000"))
    assert status["Statusword"] == 0x1637
    assert status["PositionActualValue"] == pytest.approx(1.0)
    emergency = decode(database, COB_EMCY + 0x11, bytes.fromhex("01FF810000000000"))
    assert (emergency["ErrorCode"], emergency["ErrorRegister"]) == (0xFF01, 0x81)
    assert str(decode(database, 0x710, b"\x05")["NmtState"]) == "OPERATIONAL"
    assert str(decode(database, 0x77F, b"\x05")["NmtState"]) == "OPERATIONAL"
    assert str(decode(database, 0, b"\x01\x00")["Command"]) == "START"


def test_senders_and_names(database: Database) -> None:
    assert [node.name for node in database.nodes] == ["Master", "sx", "Axis1"]
    assert database.get_message_by_frame_id(0x190).senders == ["sx"]
    assert database.get_message_by_frame_id(0x190).name == "sx_TPDO1_Status"
    assert database.get_message_by_frame_id(0x610).senders == ["Master"]
    assert database.get_message_by_frame_id(0x77F).senders == ["Master"]
    assert len({message.name for message in database.messages}) == len(database.messages)
