"""The EDS of a personality is true: other readers take it, the checks of `conform` pass, a master reads its objects."""

import subprocess
import sys
from pathlib import Path

import canopen
import pytest
from canopen.profiles.p402 import BaseNode402

from steptwin.controller.motion.backend import Kernel
from steptwin.features.conform.check import CheckResult, Need
from steptwin.features.conform.conformance import conformance
from steptwin.features.conform.node import Description, NodeUnderTest
from steptwin.features.personalities.file import personality_names
from steptwin.features.personalities.options import PersonalityOptions
from steptwin.features.personalities.personality import load_personality
from steptwin.host.robots import load_robot
from steptwin.host.twin.board_under_test import BoardUnderTest
from steptwin.protocol.entry import Access, DataType
from steptwin.protocol.exports import render_eds

AXIS = 0x10
each_personality = pytest.mark.parametrize("name", personality_names())


def written(name: str, folder: Path) -> Path:
    file = folder / f"{name}.eds"
    file.write_text(render_eds(load_personality(name).eds()), encoding="utf-8")
    return file


def board_of(name: str, kernel: Kernel) -> BoardUnderTest:
    return BoardUnderTest(load_robot("teaching-scara"), kernel=kernel, extras=[PersonalityOptions(personality=name)])


@pytest.mark.slow
@each_personality
def test_the_checks_of_conform_pass(name: str, fast_kernel: Kernel, tmp_path: Path) -> None:
    described = Description.read(str(written(name, tmp_path)), AXIS)
    done = list(conformance(NodeUnderTest(board_of(name, fast_kernel), AXIS, described), list(Need)))
    assert {each.check.id: each.reason for each in done if each.result is CheckResult.FAILED} == {}
    differs = [each.check.id for each in done if each.result is CheckResult.DIFFERS]
    assert differs == (["Y1", "F8"] if name == "nanotec-cl3" else [])


@pytest.mark.slow
@each_personality
def test_lely_s_checker_takes_the_eds(name: str, tmp_path: Path) -> None:
    command = [str(Path(sys.executable).parent / "dcfchk"), "-n", "16", str(written(name, tmp_path))]
    assert subprocess.run(command, capture_output=True, text=True, check=False).stdout == ""


@each_personality
def test_each_value_is_the_eds_default(name: str, fast_kernel: Kernel, tmp_path: Path) -> None:
    """As canopen reads the EDS; positions and states that the machine determines are left out."""
    personality, board = load_personality(name), board_of(name, fast_kernel)
    sheet = canopen.import_od(str(written(name, tmp_path)), AXIS)
    node = canopen.RemoteNode(AXIS, sheet)
    board.network.add_node(node)
    for address, entry in personality.entries.items():
        row = personality.rows.get(address)
        measured = row is not None and row.firmware is not None and entry.access is Access.READ_ONLY
        if entry.data_type is DataType.VISIBLE_STRING or entry.access is Access.WRITE_ONLY or measured:
            continue
        variable = sheet.get_variable(address >> 8, address & 0xFF)
        assert variable is not None
        read = node.sdo.upload(address >> 8, address & 0xFF)
        assert variable.decode_raw(read) == variable.default, f"{address:06X}"


@pytest.mark.slow
@each_personality
def test_canopen_s_drive_profile_moves_it(name: str, fast_kernel: Kernel, tmp_path: Path) -> None:
    """`BaseNode402` of python-canopen, unmodified, in profile position mode."""
    board = board_of(name, fast_kernel)
    node = BaseNode402(AXIS, str(written(name, tmp_path)))  # type: ignore[no-untyped-call]
    board.network.add_node(node)
    node.nmt.state = "PRE-OPERATIONAL"
    node.setup_402_state_machine()  # type: ignore[no-untyped-call]
    node.nmt.state = "OPERATIONAL"
    node.op_mode = "PROFILED POSITION"  # before the state: the RPDO that carries it carries a controlword, too
    for state in ("READY TO SWITCH ON", "SWITCHED ON", "OPERATION ENABLED"):
        node.state = state
    node.sdo[0x607A].raw = 500
    node.controlword = 0x1F
    board.wait(3)
    assert node.sdo[0x6062].raw == 500
    assert node.sdo[0x6041].raw & 0x400
    node.state = "SWITCHED ON"
