"""A live board whose time the test advances: what it records, in bounded memory, and which SYNC started the motion."""

import json
from pathlib import Path

import numpy as np
import pytest

from steptwin.controller.motion.backend import Kernel
from steptwin.emulator.board.board import Board
from steptwin.emulator.drivers.axis_wires import Wire, WireState
from steptwin.host.cli.app import run
from steptwin.host.record.folder import read_edges, read_report
from steptwin.host.twin.live.live_board import RECORD_EVERY_S
from steptwin.protocol.frame import Frame
from tests.host.twin.live.live_session import (
    JOINT,
    NMT_START,
    NODE,
    PROFILE_POSITION,
    ROBOT,
    SYNC,
    THERE_AND_BACK,
    LiveSession,
    control,
    enable,
    queue,
    start_at_sync,
)
from tests.operations import OscCapacitor, SetWire


def test_t_0_is_the_start_of_the_last_motion_whatever_other_syncs_pass(fast_kernel: Kernel, tmp_path: Path) -> None:
    session = LiveSession(fast_kernel, tmp_path)
    session.send(NMT_START, SYNC, SYNC)
    session.move(0)
    session.send(SYNC)
    begun_ns = session.now_ns
    session.move(2)
    session.send(SYNC, SYNC)
    session.end()
    evidence = read_edges(tmp_path)
    first_step_counts = evidence.axes[JOINT].step_counts[40]
    assert evidence.start_counts % 18_000 == 0
    assert begun_ns * 9 / 125 < evidence.start_counts < first_step_counts < evidence.start_counts + 10 * 72_000
    assert evidence.axes[JOINT].step_counts.size == 80
    assert read_report(tmp_path).document["started_s"] == evidence.start_counts / 72e6


def test_a_profile_move_is_not_started_by_a_sync(fast_kernel: Kernel, tmp_path: Path) -> None:
    """Although SYNCs have passed before and during it."""
    session = LiveSession(fast_kernel, tmp_path)
    session.send(SYNC)
    write = Frame(0x600 + NODE, bytes.fromhex("237a600000c80000"))
    session.send(NMT_START, *enable(PROFILE_POSITION), write, SYNC)
    session.send(control(0x1F, PROFILE_POSITION), SYNC)
    session.wait(300)
    session.end()
    evidence = read_edges(tmp_path)
    assert read_report(tmp_path).document["started_s"] is None
    assert evidence.start_counts == 0
    assert evidence.axes[JOINT].step_counts.size == 50


@pytest.mark.parametrize("recorded", [True, False], ids=["recorded", "not recorded"])
def test_nothing_is_held_in_memory(fast_kernel: Kernel, tmp_path: Path, recorded: bool) -> None:
    session = LiveSession(fast_kernel, tmp_path if recorded else None)
    session.send(NMT_START)
    for i in range(3):
        session.move(2 * i)
    session.board.record()
    board: Board = session.board.live.simulation.boards[0]
    assert board.trace(JOINT).step_counts.size == 0
    assert board.trace(JOINT).position_steps == 0
    assert board.pin_changes == []
    assert not session.board.bus.log_frames
    report = session.board.report()
    assert report["axes"][JOINT]["pulses"] == 120
    assert report["joints"]["end"] == pytest.approx(list(ROBOT.home), abs=0.02)
    session.end()


def test_axes_have_turns_where_no_folder_holds_them_together(fast_kernel: Kernel) -> None:
    """As many calls as axes forget all of them, so a board in real time is never held up for long."""
    session, axes = LiveSession(fast_kernel), len(ROBOT.joints)
    board = session.board
    assert board.record_every_s == pytest.approx(RECORD_EVERY_S / axes)
    emulated: Board = board.live.simulation.boards[0]
    board.record()
    for frame in (NMT_START, *enable(), *queue(*THERE_AND_BACK), start_at_sync(), SYNC):
        board.live.send(frame, "a client", session.now_ns)
    for now_ms in range(11, 300):
        board.live.advance(now_ms * 1_000_000)
    held = []
    for _ in range(axes):
        held.append(emulated.trace(JOINT).step_counts.size)
        board.record_next()
    assert sorted(held, reverse=True) == held
    assert set(held) == {40, 0}
    assert emulated.pin_changes == []
    assert board.report()["axes"][JOINT]["pulses"] == 40
    session.end()


def test_a_folder_gets_all_axes_at_once(fast_kernel: Kernel, tmp_path: Path) -> None:
    session = LiveSession(fast_kernel, tmp_path)
    assert session.board.record_every_s == RECORD_EVERY_S
    session.send(NMT_START)
    session.move(0)
    session.board.record_next()
    assert session.board.report()["axes"][JOINT]["pulses"] == 40
    session.end()


@pytest.mark.slow
@pytest.mark.parametrize("axes_per_board", [(3, 3), (4, 2), (1,) * 6])
def test_several_boards_record_the_same(axes_per_board: tuple[int, ...], fast_kernel: Kernel, tmp_path: Path) -> None:
    """Each axis has its node id, its edges and its place in the folder, whichever board it is on."""
    reports, evidence = [], []
    for i, boards in enumerate((None, axes_per_board)):
        folder = tmp_path / str(i)
        folder.mkdir()
        session = LiveSession(fast_kernel, folder, axes_per_board=boards)
        session.send(NMT_START)
        session.move(0)
        session.end()
        reports.append(read_report(folder).document)
        evidence.append(read_edges(folder))
    assert reports[0]["boards"] == [6]
    assert reports[1]["boards"] == list(axes_per_board)
    assert reports[0]["axes"] == reports[1]["axes"]
    assert reports[0]["started_s"] == reports[1]["started_s"]
    assert [axis.name for axis in evidence[1].axes] == list(ROBOT.joint_names)
    assert evidence[0].axes[JOINT].step_counts.tolist() == evidence[1].axes[JOINT].step_counts.tolist()
    assert evidence[1].axes[JOINT].pins["enable"].levels.tolist() == [1]


@pytest.mark.slow
def test_other_drivers_break_their_limits(fast_kernel: Kernel, tmp_path: Path) -> None:
    """Drivers that require 150 us before the falling edge count no pulse of 33 us."""
    session = LiveSession(fast_kernel, tmp_path, drivers="slow-blue-board")
    session.send(NMT_START)
    session.move(0)
    session.move(2)
    session.end()
    report, axis = read_report(tmp_path), read_edges(tmp_path).axes[JOINT]
    assert report.driver_profile == "slow-blue-board"
    assert [(figures["pulses"], figures["violations"]) for figures in report.axes][2:5] == [(0, 0), (80, 80), (0, 0)]
    assert axis.active_edge == "falling"
    assert axis.clk_rise_counts.size == 80
    assert axis.step_counts.size == 0
    assert {axis.violations.limits[i].rule for i in axis.violations.which} == {"clk_low"}
    assert axis.violations.values.tolist() == pytest.approx([33] * 80)
    assert run(["verify", str(tmp_path)]) == 1  # the records are a plan, of which the drivers made nothing


def test_currents_are_recorded_across_pieces(fast_kernel: Kernel, tmp_path: Path) -> None:
    """One cycle of the field is 64 steps of 1/16: 20 steps up and down turn it by 20 and back."""
    session = LiveSession(fast_kernel, tmp_path)
    session.send(NMT_START)
    session.move(0)
    session.end()
    axis = read_edges(tmp_path).axes[JOINT]
    moved = np.isin(axis.phases.counts, axis.step_counts)
    sixteenths = axis.phases.substeps[moved]
    turn = 16 // ROBOT.joints[JOINT].transmission.microsteps
    expected = [-turn * steps % 64 for steps in (*range(1, 21), *range(19, -1, -1))]
    assert sixteenths.tolist() == expected
    peak_ma = max(abs(axis.phases.a_ma).max(), abs(axis.phases.b_ma).max())
    assert peak_ma == 1500


def test_the_bus_log_alone(fast_kernel: Kernel, tmp_path: Path) -> None:
    session = LiveSession(fast_kernel, log=tmp_path / "run.log")
    session.send(SYNC)
    session.end()
    lines = (tmp_path / "run.log").read_text().splitlines()
    assert len(lines) == session.board.bus.frames == 7
    assert lines[-1].endswith("steptwin0 080#")
    assert [path.name for path in tmp_path.iterdir()] == ["run.log"]


def test_a_session_without_motion_has_no_waveform(
    fast_kernel: Kernel, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    LiveSession(fast_kernel, tmp_path).end()
    assert run(["trace", str(tmp_path)]) == 2
    assert "no pin has changed since power-up" in capsys.readouterr().err


def test_the_report_is_stored(fast_kernel: Kernel, tmp_path: Path) -> None:
    session = LiveSession(fast_kernel, tmp_path)
    session.end()
    report = json.loads((tmp_path / "report.json").read_text())
    assert report["robot"] == "warehouse-scara"
    assert report["real_time"]["speed"] == 1.0
    assert report["simulated_s"] == pytest.approx(0.01)


@pytest.mark.slow
def test_faults_of_drivers_and_wires_are_recorded_too(fast_kernel: Kernel, tmp_path: Path) -> None:
    """A limit that a driver has got since the beginning, and a pulse that lasts for several pieces of the recording."""
    session = LiveSession(fast_kernel, tmp_path)
    session.send(NMT_START)
    session.move(0)
    session.board.operate(OscCapacitor(JOINT, 1000))
    session.move(2)
    session.board.operate(SetWire(JOINT, Wire.STEP, WireState.HIGH))
    session.wait(200)
    session.move(4)
    session.board.operate(SetWire(JOINT, Wire.STEP, WireState.WHOLE))
    session.wait(200)
    session.end()
    axis = read_edges(tmp_path).axes[JOINT]
    rules = [axis.violations.limits[which].limit for which in axis.violations.which.tolist()]
    assert rules == [90.0] * 40
    assert axis.step_counts.size == 40 + 1
    assert axis.clk_rise_counts.size == 80 + 1
    assert axis.clk_fall_counts[-1] - axis.clk_rise_counts[-1] > 3_600
