"""The electronic data sheet, as programs read it that nobody here wrote: canopen, and lely's dcfchk and dcfgen."""

import configparser
import io
import struct
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest
from canopen.objectdictionary import eds as canopen_eds

from steptwin.controller.motion.backend import Kernel
from steptwin.protocol.eds import render_eds
from steptwin.protocol.entry import Access, DataType, ObjectCode
from steptwin.protocol.nmt import NmtCommand
from steptwin.protocol.objects import OBJECTS
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


@pytest.mark.parametrize("section", sections().values(), ids=sections())
def test_each_default_lies_within_its_limits(section: configparser.SectionProxy) -> None:
    code = int(section["DataType"], 0)
    if code == VISIBLE_STRING:
        return
    low, high = RANGES[code]
    low = max(low, int(section.get("LowLimit", str(low)), 0))
    high = min(high, int(section.get("HighLimit", str(high)), 0))
    for node_id in (1, 127):
        default = sum(node_id if part == "$NODEID" else int(part, 0) for part in section["DefaultValue"].split("+"))
        assert low <= default <= high


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


def test_lely_dcfchk_accepts_it(sheet: Path) -> None:
    run_lely("dcf.cli", "-n", "16", str(sheet))


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
