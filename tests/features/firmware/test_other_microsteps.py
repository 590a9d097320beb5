"""The fixture's verdict names what a firmware has set otherwise than the robot's file."""

import shutil
import subprocess
from pathlib import Path
from typing import Final

import pytest

from steptwin.features.firmware.options import FirmwareOptions
from steptwin.features.firmware.process import interface_files
from steptwin.host.planning.jobs import make_job
from steptwin.host.planning.plan import Plan
from steptwin.host.planning.planner import plan
from steptwin.host.robots import load_robot
from steptwin.host.twin.board_under_test import BoardUnderTest

GCC: Final = shutil.which("gcc")
TEACHING = load_robot("teaching-scara")


@pytest.fixture(scope="module")
def standing() -> Plan:
    return plan(TEACHING, make_job(TEACHING, "carry", {}))


@pytest.mark.skipif(GCC is None, reason="no C compiler is installed")
def test_a_firmware_that_sets_other_microsteps_is_named(standing: Plan, tmp_path: Path) -> None:
    """The example sets 16 at each driver."""
    for name, text in interface_files().items():
        (tmp_path / name).write_text(text, encoding="utf-8")
    command = [GCC or "", "-shared", "-fPIC", "-o", "fw.so", "example.c", "steptwin_hal.c"]
    subprocess.run(command, check=True, timeout=60, cwd=tmp_path)
    board = BoardUnderTest(TEACHING, extras=[FirmwareOptions(firmware=tmp_path / "fw.so")])
    board.wait(0.01)
    named = [reason for reason in board.verify(standing.motion).reasons if "microsteps" in reason]
    assert named == ["d3: driver and board make 16 microsteps, the robot's file says 8"]
