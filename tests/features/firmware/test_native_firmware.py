"""A user's firmware on emulated boards: the example makes a job's motion, and what is broken ends with a sentence."""

import struct
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from steptwin.emulator.board.board_firmware import FirmwareError
from steptwin.features.faults.kinds.machine import EmergencyStop, Supply
from steptwin.features.faults.options import FaultOptions
from steptwin.features.firmware.options import FirmwareOptions
from steptwin.host.common.errors import InputError
from steptwin.host.planning.jobs import make_job
from steptwin.host.planning.plan import Plan
from steptwin.host.planning.planner import plan
from steptwin.host.robots import load_robot
from steptwin.host.twin.board_under_test import BoardUnderTest
from steptwin.host.twin.embedded.execution import execute
from tests.features.firmware.compilers import NEEDS_GCC, Build
from tests.messages import refusing

pytestmark = NEEDS_GCC

FILED = load_robot("teaching-scara")
ROBOT = replace(
    FILED,
    joints=tuple(replace(joint, transmission=replace(joint.transmission, microsteps=16)) for joint in FILED.joints),
)
"""The teaching robot with the microsteps that the example sets at every driver."""
NODES = range(0x10, 0x14)
SET_POINT_MS = 5
QUEUED = 4


@pytest.fixture(scope="module")
def example(build: Build) -> Path:
    return build("example.c", "steptwin_hal.c")


@pytest.fixture(scope="module")
def planned() -> Plan:
    return plan(ROBOT, make_job(ROBOT, "carry", {}))


def carry(example: Path, planned: Plan, *axes_per_board: int) -> BoardUnderTest:
    """Let the example make the job's motion, by a set-point each 5 ms."""
    board = BoardUnderTest(
        ROBOT,
        extras=[FirmwareOptions(firmware=example)],
        stand_at=planned.start_joints,
        axes_per_board=axes_per_board or None,
    )
    for node in NODES:
        board.network.send_message(0x280 + node, b"\x01")
    board.wait(0.05)
    ends_s = np.arange(1, round(planned.motion.duration_s * 1000) // SET_POINT_MS + 1) * SET_POINT_MS / 1000
    steps = np.rint(planned.motion.positions(np.append(0.0, ends_s)) * ROBOT.steps_per_unit).astype(np.int64)
    begin_s = board.now_s()
    for number, targets in enumerate(steps[1:] - steps[0]):
        for node, target in zip(NODES, targets.tolist(), strict=True):
            board.network.send_message(0x200 + node, struct.pack("<iH", target, SET_POINT_MS))
        ahead_s = begin_s + (number - QUEUED) * SET_POINT_MS / 1000 - board.now_s()
        if ahead_s > 0.0:
            board.wait(ahead_s)
    board.wait(0.1)
    return board


@pytest.fixture(scope="module")
def carried(example: Path, planned: Plan) -> BoardUnderTest:
    return carry(example, planned)


def test_the_example_makes_every_step_of_a_job(carried: BoardUnderTest, planned: Plan) -> None:
    makes_every_step(carried, planned)


@pytest.mark.slow
def test_it_makes_them_on_two_boards(example: Path, planned: Plan) -> None:
    makes_every_step(carry(example, planned, 2, 2), planned)


def makes_every_step(board: BoardUnderTest, planned: Plan) -> None:
    report = board.verify(planned.motion, tolerance_steps=2.0)
    assert report.reasons == ()
    assert [axis.steps_end - axis.steps_start for axis in report.axes] == [-1064, 3064, 0, -1000]
    assert board.violations() == []
    assert {frame.cob_id for _, frame in board.bus_log} >= {0x300 + node for node in NODES}


@pytest.mark.slow
def test_it_is_the_same_each_time_and_is_kept(
    example: Path, planned: Plan, carried: BoardUnderTest, tmp_path: Path
) -> None:
    first, second = carried, carry(example, planned)
    for joint in ROBOT.joint_names:
        one, other = first.pins(joint), second.pins(joint)
        assert np.array_equal(one.clk_rise_counts, other.clk_rise_counts)
        assert np.array_equal(one.dir_edge_counts, other.dir_edge_counts)
    assert first.bus_log == second.bus_log
    first.save(tmp_path / "run")
    assert "another firmware" in (tmp_path / "run" / "report.json").read_text(encoding="utf-8")


def test_the_emergency_stop_and_a_power_cycle(example: Path) -> None:
    """It stops within a servo tick, and what it has written to its flash is there after the power."""
    board = BoardUnderTest(ROBOT, extras=[FirmwareOptions(firmware=example)])
    board.network.send_message(0x290, b"\x01")
    board.wait(0.01)
    board.network.send_message(0x210, struct.pack("<iH", 1000, 1000))
    board.wait(0.5)
    board.operate(EmergencyStop(pressed=True))
    board.wait(0.5)
    stood = board.steps()["th1"]
    assert stood == pytest.approx(500, abs=15)
    board.network.send_message(0x290, b"\x02")
    board.wait(0.01)
    board.operate(EmergencyStop(pressed=False))
    board.operate(Supply(0))
    board.wait(0.1)
    board.operate(Supply(2400))
    board.wait(0.1)
    told = [frame for _, frame in board.bus_log if frame.cob_id == 0x310]
    assert struct.unpack_from("<i", told[-1].data)[0] == stood


# --- what is broken

HANGS = 2
BROKEN = {
    1: "is made for interface 99, and this is 1",
    2: "st_run has not returned for 1 s: does it loop?",
    3: "st_run crashed: SIGABRT",
    4: "st_run went back in time: it returned at",
    5: "st_run ran beyond",
    6: "st_take_edges gives axis 77, pin 3, level 1",
    7: "st_take_frames gives a frame 0x9999 of 8 bytes",
    8: "st_next_due names an instant that has passed",
    9: "st_run ended the process, with exit code 7",
    10: "st_run stands still",
    11: "has no function st_flash (steptwin_firmware.h)",
}


@pytest.mark.parametrize("way", [pytest.param(way, marks=pytest.mark.live if way == HANGS else []) for way in BROKEN])
def test_a_broken_firmware_ends_with_a_sentence(way: int, build: Build, monkeypatch: pytest.MonkeyPatch) -> None:
    if way == HANGS:
        monkeypatch.setattr("steptwin.features.firmware.process.HANGS_S", 1.0)
    library = build("broken.c", BREAK=way)
    with pytest.raises((FirmwareError, InputError)) as error:
        BoardUnderTest(ROBOT, extras=[FirmwareOptions(firmware=library)]).wait(1.0)
    assert f"{library}: {BROKEN[way]}" in str(error.value)
    assert "\n" not in str(error.value)


def test_a_file_that_is_no_library_and_what_needs_our_firmware(example: Path, planned: Plan, tmp_path: Path) -> None:
    text = tmp_path / "fw.so"
    text.write_text("no library", encoding="utf-8")
    with refusing(InputError):
        BoardUnderTest(ROBOT, extras=[FirmwareOptions(firmware=text)])
    with refusing(InputError):
        BoardUnderTest(ROBOT, extras=[FirmwareOptions(firmware="none")])
    with refusing(InputError):
        execute(planned, "carry", extras=[FirmwareOptions(firmware=example)])
    with refusing(InputError):
        BoardUnderTest(
            ROBOT,
            extras=[FirmwareOptions(firmware=example), FaultOptions(scenario=[EmergencyStop(pressed=True)])],
        )
