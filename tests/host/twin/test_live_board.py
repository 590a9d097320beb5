"""A robot's live board without a clock: what it records, in how small a space, and which SYNC began the motion."""

import json
from pathlib import Path

import numpy as np
import pytest

from steptwin.controller.backend import Kernel
from steptwin.emulator.board import Board
from steptwin.host.cli.app import run
from steptwin.host.record.folder import read_edges, read_report
from steptwin.host.robots import load_robot
from steptwin.host.twin.live_board import LiveBoard
from steptwin.protocol.frame import Frame
from steptwin.protocol.pvt import PvtRecord

MS = 1_000_000
NODE = 0x13
SYNC = Frame(0x080, b"")
ROBOT = load_robot("warehouse-scara")
HALF_A_STEP_DEG = 0.5 * 360 / (200 * 16 * 3) + 1e-9
"""Of th3, whose steps are the largest: so well is it known where a joint without records stands."""


class Session:
    """Frames go in and time passes, as told; recorded is every 50 ms."""

    def __init__(
        self,
        kernel: Kernel,
        out: Path | None = None,
        log: Path | None = None,
        axes_per_board: tuple[int, ...] | None = None,
        drivers: str | None = None,
    ) -> None:
        self.board = LiveBoard(
            ROBOT,
            list(ROBOT.home),
            kernel,
            bitrate=ROBOT.board.bitrate,
            speed=1.0,
            axes_per_board=axes_per_board,
            out=out,
            log=log,
            driver_profile_name=drivers,
        )
        self.board.live.start(0, 0)
        self.now_ns = 0
        self.wait(10)

    def wait(self, dt_ms: int) -> None:
        for _ in range(dt_ms):
            self.now_ns += MS
            self.board.live.advance(self.now_ns)
            if self.now_ns % (50 * MS) == 0:
                self.board.record()

    def send(self, *frames: Frame) -> None:
        for frame in frames:
            self.board.live.send(frame, "a client", self.now_ns)
            self.wait(1)

    def move(self, sequence: int) -> None:
        """20 steps up and down again in 100 ms, by PVT, begun by a SYNC."""
        self.send(
            *(Frame(0x200 + NODE, bytes((word, 0, 7))) for word in (0x06, 0x07, 0x0F)),
            *(
                Frame(0x500 + NODE, PvtRecord(units, 0, 50, (sequence + i) % 256).encode())
                for i, units in enumerate((20 * 1024, -20 * 1024))
            ),
            Frame(0x300 + NODE, b"\x1f\x00"),
            SYNC,
        )
        self.wait(120)

    def end(self) -> None:
        self.board.record()
        self.board.close(self.board.report())


def test_t_0_is_the_begin_of_the_last_motion_however_many_syncs_pass(fast_kernel: Kernel, tmp_path: Path) -> None:
    session = Session(fast_kernel, tmp_path)
    session.send(Frame(0x000, b"\x01\x00"), SYNC, SYNC)
    session.move(0)
    session.send(SYNC)
    begun_ns = session.now_ns
    session.move(2)
    session.send(SYNC, SYNC)
    session.end()
    evidence = read_edges(tmp_path)
    first_step_counts = evidence.axes[3].step_counts[40]
    assert evidence.start_counts % 18_000 == 0
    assert begun_ns * 9 / 125 < evidence.start_counts < first_step_counts < evidence.start_counts + 10 * 72_000
    assert evidence.axes[3].step_counts.size == 80
    assert read_report(tmp_path).document["started_s"] == evidence.start_counts / 72e6


def plan_rows(folder: Path) -> list[list[float]]:
    lines = (folder / "trajectory.csv").read_text().splitlines()
    assert lines[0] == "t,sx,sz,L1,th1,th2,th3,v_sx,v_sz,v_L1,v_th1,v_th2,v_th3"
    return [[float(word) for word in line.split(",")] for line in lines[1:]]


def test_the_records_of_the_last_motion_are_its_plan(
    fast_kernel: Kernel, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Where the machine stands, not where the firmware takes it to be, which nobody has homed; and verify agrees."""
    (tmp_path / "trajectory.csv").write_text("of an earlier session")
    session = Session(fast_kernel, tmp_path)
    session.send(Frame(0x000, b"\x01\x00"))
    session.send(Frame(0x500 + NODE, PvtRecord(20 * 1024, 64 * 1024, 40, 0).encode()))
    session.send(*(Frame(0x500 + NODE, PvtRecord(20 * 1024, 0, 40, sequence).encode()) for sequence in (1, 1, 7)))
    session.send(*(Frame(0x200 + NODE, bytes((w, 0, 7))) for w in (6, 7, 15)), Frame(0x300 + NODE, b"\x1f\0"), SYNC)
    session.wait(100)
    session.move(2)
    session.end()
    assert json.loads((tmp_path / "report.json").read_text())["no_plan"] is None
    home = list(ROBOT.home)
    th1_deg = [40 * 360 / (200 * 16 * 5), 60 * 360 / (200 * 16 * 5), 40 * 360 / (200 * 16 * 5)]
    expected = [[t_s, *home[:3], th1, *home[4:], *[0] * 6] for t_s, th1 in zip((0, 0.05, 0.1), th1_deg, strict=True)]
    assert plan_rows(tmp_path) == [pytest.approx(row, abs=HALF_A_STEP_DEG) for row in expected]
    assert run(["verify", str(tmp_path)]) == 0
    assert capsys.readouterr().out.endswith("warehouse-scara live: PASSED\n")
    assert not (tmp_path / "trajectory.part").exists()


def enabled(session: Session, *records: PvtRecord, nodes: tuple[int, ...] = (NODE,)) -> None:
    """Nodes with records, to be started by a SYNC."""
    session.send(Frame(0x000, b"\x01\x00"))
    for node in nodes:
        session.send(*(Frame(0x200 + node, bytes((word, 0, 7))) for word in (0x06, 0x07, 0x0F)))
        session.send(*(Frame(0x500 + node, record.encode()) for record in records))
        session.send(Frame(0x300 + node, b"\x1f\x00"))


def no_plan(session: Session, folder: Path) -> str:
    """Why there is none, at the end of a session; nothing of one is left."""
    session.end()
    assert not list(folder.glob("trajectory.*"))
    reason: str = json.loads((folder / "report.json").read_text())["no_plan"]
    return reason


THERE_AND_BACK = (PvtRecord(20 * 1024, 0, 50, 0), PvtRecord(-20 * 1024, 0, 50, 1))


def test_a_motion_that_was_halted_has_no_plan(
    fast_kernel: Kernel, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Its time is not that of its records; verify says so."""
    session = Session(fast_kernel, tmp_path)
    enabled(session, *THERE_AND_BACK)
    session.send(SYNC)
    session.wait(20)
    session.send(Frame(0x200 + NODE, b"\x1f\x01\x07"))
    session.wait(20)
    session.send(Frame(0x200 + NODE, b"\x1f\x00\x07"))
    session.wait(150)
    assert no_plan(session, tmp_path) == "it was halted on its way"
    assert run(["verify", str(tmp_path)]) == 2
    assert "trajectory.csv: is missing: it was halted on its way; --plan DIR" in capsys.readouterr().err


@pytest.mark.parametrize("stop_ms", [None, 30, 80])
def test_a_motion_that_was_not_ended_has_no_plan(fast_kernel: Kernel, tmp_path: Path, stop_ms: int | None) -> None:
    """The session ends first, or a quick stop comes before."""
    session = Session(fast_kernel, tmp_path)
    enabled(session, *THERE_AND_BACK)
    session.send(SYNC)
    session.wait(30 if stop_ms is None else stop_ms - 1)
    if stop_ms is not None:
        session.send(Frame(0x200 + NODE, b"\x0b\x00\x07"))
        session.wait(200)
    assert no_plan(session, tmp_path) == "it has not come to the end of its records"


def test_axes_whose_records_do_not_go_together_have_no_plan(fast_kernel: Kernel, tmp_path: Path) -> None:
    session = Session(fast_kernel, tmp_path)
    enabled(session, *THERE_AND_BACK)
    enabled(session, THERE_AND_BACK[0]._replace(duration_ms=60), nodes=(NODE + 1,))
    session.send(SYNC)
    session.wait(150)
    assert no_plan(session, tmp_path) == "the axes' records do not last equally long"


def test_an_axis_with_fewer_records_has_no_plan(fast_kernel: Kernel, tmp_path: Path) -> None:
    session = Session(fast_kernel, tmp_path)
    enabled(session, *THERE_AND_BACK)
    enabled(session, THERE_AND_BACK[0], nodes=(NODE + 1,))
    session.send(SYNC)
    session.wait(150)
    assert no_plan(session, tmp_path) == "the axes' records do not last equally long"


def test_a_driver_that_is_set_up_otherwise_has_no_plan(fast_kernel: Kernel, tmp_path: Path) -> None:
    """Steps of another size are no steps of the robot's file."""
    session = Session(fast_kernel, tmp_path)
    session.send(Frame(0x600 + NODE, bytes.fromhex("2f00200108000000")))
    enabled(session, *THERE_AND_BACK)
    session.send(SYNC)
    session.wait(150)
    assert no_plan(session, tmp_path) == "th1 is set up otherwise than in the robot's file"


def test_where_nothing_has_moved_there_is_no_plan(fast_kernel: Kernel, tmp_path: Path) -> None:
    session = Session(fast_kernel, tmp_path)
    session.send(SYNC)
    assert no_plan(session, tmp_path) == "no SYNC has started a motion"


def test_a_profile_move_is_begun_by_no_sync(fast_kernel: Kernel, tmp_path: Path) -> None:
    """Although some have passed."""
    session = Session(fast_kernel, tmp_path)
    session.send(SYNC)
    write = Frame(0x600 + NODE, bytes.fromhex("237a600000c80000"))
    session.send(Frame(0x000, b"\x01\x00"), *(Frame(0x200 + NODE, bytes((w, 0, 1))) for w in (6, 7, 15)), write, SYNC)
    session.send(Frame(0x200 + NODE, b"\x1f\x00\x01"), SYNC)
    session.wait(300)
    session.end()
    evidence = read_edges(tmp_path)
    assert read_report(tmp_path).document["started_s"] is None
    assert evidence.start_counts == 0
    assert evidence.axes[3].step_counts.size == 50


@pytest.mark.parametrize("recorded", [True, False], ids=["into a folder", "nowhere"])
def test_nothing_is_held_in_memory(fast_kernel: Kernel, tmp_path: Path, recorded: bool) -> None:
    session = Session(fast_kernel, tmp_path if recorded else None)
    session.send(Frame(0x000, b"\x01\x00"))
    for i in range(3):
        session.move(2 * i)
    session.board.record()
    board: Board = session.board.live.simulation.boards[0]
    assert board.trace(3).step_counts.size == 0
    assert board.trace(3).position_steps == 0
    assert board.pin_changes == []
    assert not session.board.bus.log_frames
    report = session.board.report()
    assert report["axes"][3]["pulses"] == 120
    assert report["joints"]["end"] == pytest.approx(list(ROBOT.home), abs=0.02)
    session.end()


@pytest.mark.parametrize("axes_per_board", [(3, 3), (4, 2), (1,) * 6])
def test_on_several_boards_it_is_the_same(axes_per_board: tuple[int, ...], fast_kernel: Kernel, tmp_path: Path) -> None:
    """Each axis has its node id, its edges and its place in the folder, whichever board it is on."""
    reports, evidence = [], []
    for i, boards in enumerate((None, axes_per_board)):
        folder = tmp_path / str(i)
        folder.mkdir()
        session = Session(fast_kernel, folder, axes_per_board=boards)
        session.send(Frame(0x000, b"\x01\x00"))
        session.move(0)
        session.end()
        reports.append(read_report(folder).document)
        evidence.append(read_edges(folder))
    assert reports[0]["boards"] == [6]
    assert reports[1]["boards"] == list(axes_per_board)
    assert reports[0]["axes"] == reports[1]["axes"]
    assert reports[0]["started_s"] == reports[1]["started_s"]
    assert [axis.name for axis in evidence[1].axes] == list(ROBOT.joint_names)
    assert evidence[0].axes[3].step_counts.tolist() == evidence[1].axes[3].step_counts.tolist()
    assert evidence[1].axes[3].pins["enable"].levels.tolist() == [1]


def test_other_drivers_break_their_limits(fast_kernel: Kernel, tmp_path: Path) -> None:
    """Pulses of 33 us for drivers that ask for 150 us before the falling edge: none is counted."""
    session = Session(fast_kernel, tmp_path, drivers="slow-blue-board")
    session.send(Frame(0x000, b"\x01\x00"))
    session.move(0)
    session.move(2)
    session.end()
    report, axis = read_report(tmp_path), read_edges(tmp_path).axes[3]
    assert report.driver_profile == "slow-blue-board"
    assert [(figures["pulses"], figures["violations"]) for figures in report.axes][2:5] == [(0, 0), (80, 80), (0, 0)]
    assert axis.active_edge == "falling"
    assert axis.clk_rise_counts.size == 80
    assert axis.step_counts.size == 0
    assert {axis.violations.limits[i].rule for i in axis.violations.which} == {"clk_low"}
    assert axis.violations.values.tolist() == pytest.approx([33] * 80)
    assert run(["verify", str(tmp_path)]) == 1  # the records are a plan, of which nothing was made


def test_currents_are_recorded_as_they_are_of_the_whole(fast_kernel: Kernel, tmp_path: Path) -> None:
    """One cycle of the field is 64 steps of 1/16: 20 steps up and down turn it by 20 and back."""
    session = Session(fast_kernel, tmp_path)
    session.send(Frame(0x000, b"\x01\x00"))
    session.move(0)
    session.end()
    axis = read_edges(tmp_path).axes[3]
    moved = np.isin(axis.phases.counts, axis.step_counts)
    sixteenths = axis.phases.sixteenths[moved]
    turn = 16 // ROBOT.joints[3].transmission.microsteps
    expected = [-turn * steps % 64 for steps in (*range(1, 21), *range(19, -1, -1))]
    assert sixteenths.tolist() == expected
    peak_ma = max(abs(axis.phases.a_ma).max(), abs(axis.phases.b_ma).max())
    assert peak_ma == 1500


def test_the_bus_log_alone(fast_kernel: Kernel, tmp_path: Path) -> None:
    session = Session(fast_kernel, log=tmp_path / "run.log")
    session.send(SYNC)
    session.end()
    lines = (tmp_path / "run.log").read_text().splitlines()
    assert len(lines) == session.board.bus.frames == 7
    assert lines[-1].endswith("steptwin0 080#")
    assert [path.name for path in tmp_path.iterdir()] == ["run.log"]


def test_where_nothing_moved_there_is_no_waveform(
    fast_kernel: Kernel, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    Session(fast_kernel, tmp_path).end()
    assert run(["trace", str(tmp_path)]) == 2
    assert "no pin has changed since power-up" in capsys.readouterr().err


def test_the_report_is_a_document(fast_kernel: Kernel, tmp_path: Path) -> None:
    session = Session(fast_kernel, tmp_path)
    session.end()
    report = json.loads((tmp_path / "report.json").read_text())
    assert report["robot"] == "warehouse-scara"
    assert report["real_time"]["speed"] == 1.0
    assert report["simulated_s"] == pytest.approx(0.01)
