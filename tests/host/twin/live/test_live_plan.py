"""The plan that a live board leaves: the records of the last motion, or the reason why there is no plan."""

import json
from collections.abc import Callable
from pathlib import Path

import pytest

from steptwin.controller.motion.backend import Kernel
from steptwin.features.view.model import Replay
from steptwin.host.cli.app import run
from steptwin.host.common.errors import InputError
from steptwin.host.record.folder import read_run, verify_folder
from steptwin.protocol.frame import Frame
from steptwin.protocol.pvt import PvtRecord
from tests.host.twin.live.live_session import (
    JOINT,
    NMT_START,
    NODE,
    ROBOT,
    SYNC,
    THERE_AND_BACK,
    UNITS_PER_STEP,
    LiveSession,
    control,
    enable,
    queue,
    start_at_sync,
)
from tests.messages import refusing

HALF_A_STEP_DEG = 0.5 * 360 / (200 * 16 * 3) + 1e-9
"""Half a step of th3, the largest: joints without records are known no better."""


def plan_rows(folder: Path) -> list[list[float]]:
    lines = (folder / "trajectory.csv").read_text().splitlines()
    assert lines[0] == "t,sx,sz,L1,th1,th2,th3,v_sx,v_sz,v_L1,v_th1,v_th2,v_th3"
    return [[float(word) for word in line.split(",")] for line in lines[1:]]


@pytest.mark.slow
def test_the_records_of_the_last_motion_are_its_plan(
    fast_kernel: Kernel, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """In the machine's positions, although the firmware, which has not been homed, counts from 0; verify agrees."""
    (tmp_path / "trajectory.csv").write_text("of an earlier session")
    session = LiveSession(fast_kernel, tmp_path)
    session.send(NMT_START)
    session.send(*queue(PvtRecord(20 * UNITS_PER_STEP, 64 * 1024, 40, 0)))
    session.send(*queue(*(PvtRecord(20 * UNITS_PER_STEP, 0, 40, sequence) for sequence in (1, 1, 7))))
    session.send(*enable(), start_at_sync(), SYNC)
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


def prepare(session: LiveSession, *records: PvtRecord, nodes: tuple[int, ...] = (NODE,)) -> None:
    """Enable axes and queue records for them, which the next SYNC starts."""
    session.send(NMT_START)
    for node in nodes:
        session.send(*enable(node=node))
        session.send(*queue(*records, node=node))
        session.send(start_at_sync(node))


def no_plan(session: LiveSession, folder: Path) -> str:
    """End a session that leaves no file of a plan; return the reason for that."""
    session.end()
    assert not list(folder.glob("trajectory.*"))
    reason: str = json.loads((folder / "report.json").read_text())["no_plan"]
    return reason


@pytest.mark.slow
def test_a_motion_that_was_halted_and_made_slower_is_judged_by_its_records(
    fast_kernel: Kernel, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """In its own time: the recording has the changes of its speed, in report.json and with the edges."""
    session = LiveSession(fast_kernel, tmp_path)
    prepare(session, *THERE_AND_BACK)
    session.send(SYNC)
    session.wait(20)
    session.send(control(0x11F))
    session.wait(20)
    session.send(control(0x1F), Frame(0x600 + NODE, bytes.fromhex("2310200300800000")))
    session.wait(250)
    session.end()
    assert run(["verify", str(tmp_path)]) == 0
    assert capsys.readouterr().out.endswith("warehouse-scara live: PASSED\n")
    report = json.loads((tmp_path / "report.json").read_text())
    assert report["no_plan"] is None
    assert [speed["percent"] for speed in report["speeds"]] == [0, 100, 50]
    assert report["speeds"][0]["after_s"] == pytest.approx(0.021, abs=0.002)
    assert report["speeds"][1]["at_s"] < report["speeds"][1]["after_s"] == pytest.approx(0.042, abs=0.002)


@pytest.mark.slow
def test_a_recording_without_an_end_is_read_in_its_own_time(fast_kernel: Kernel, tmp_path: Path) -> None:
    """Its motion goes on at half speed: what is recorded of it is as long as the motion's own time."""
    session = LiveSession(fast_kernel, tmp_path)
    prepare(session, *(THERE_AND_BACK[i % 2]._replace(sequence=i) for i in range(8)))
    session.send(SYNC, Frame(0x600 + NODE, bytes.fromhex("2310200300800000")))
    session.wait(400)
    verdict = verify_folder(tmp_path)
    assert verdict.interruption is not None
    assert verdict.interruption.endswith("so far it is right")
    lasts_s = float(verdict.interruption.split(" s into the last motion")[0].rsplit(" ", 1)[1])
    assert 0.1 < lasts_s <= 0.25


def test_boards_that_halt_each_by_itself_leave_no_plan(
    fast_kernel: Kernel, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Their times part; verify gives the reason."""
    session = LiveSession(fast_kernel, tmp_path, axes_per_board=(3, 3))
    prepare(session, *THERE_AND_BACK)
    session.send(SYNC)
    session.wait(20)
    session.send(control(0x11F))
    session.wait(20)
    session.send(control(0x1F))
    session.wait(150)
    why = "it was halted on its way, each board by a ramp of its own"
    assert no_plan(session, tmp_path) == why
    assert run(["verify", str(tmp_path)]) == 2
    assert f"trajectory.csv: is missing: {why}; --plan DIR" in capsys.readouterr().err


@pytest.mark.parametrize("stop_ms", [None, 30, 80])
def test_a_motion_that_was_not_ended_has_no_plan(fast_kernel: Kernel, tmp_path: Path, stop_ms: int | None) -> None:
    """The session ends before, or a quick stop does."""
    session = LiveSession(fast_kernel, tmp_path)
    prepare(session, *THERE_AND_BACK)
    session.send(SYNC)
    session.wait(30 if stop_ms is None else stop_ms - 1)
    if stop_ms is not None:
        session.send(control(0x0B))
        session.wait(200)
    assert no_plan(session, tmp_path) == "it has not come to the end of its records"


def test_axes_whose_records_differ_in_duration_have_no_plan(fast_kernel: Kernel, tmp_path: Path) -> None:
    session = LiveSession(fast_kernel, tmp_path)
    prepare(session, *THERE_AND_BACK)
    prepare(session, THERE_AND_BACK[0]._replace(duration_ms=60), nodes=(NODE + 1,))
    session.send(SYNC)
    session.wait(150)
    assert no_plan(session, tmp_path) == "the axes' records do not last equally long"


def test_an_axis_with_fewer_records_has_no_plan(fast_kernel: Kernel, tmp_path: Path) -> None:
    session = LiveSession(fast_kernel, tmp_path)
    prepare(session, *THERE_AND_BACK)
    prepare(session, THERE_AND_BACK[0], nodes=(NODE + 1,))
    session.send(SYNC)
    session.wait(150)
    assert no_plan(session, tmp_path) == "the axes' records do not last equally long"


def test_an_axis_that_is_set_up_otherwise_has_no_plan(fast_kernel: Kernel, tmp_path: Path) -> None:
    """Its steps are not of the size that the robot's file says."""
    session = LiveSession(fast_kernel, tmp_path)
    session.send(Frame(0x600 + NODE, bytes.fromhex("2f00200108000000")))
    prepare(session, *THERE_AND_BACK)
    session.send(SYNC)
    session.wait(150)
    assert no_plan(session, tmp_path) == "th1 is set up otherwise than in the robot's file"


PROFILE = [*enable(1), Frame(0x600 + NODE, bytes.fromhex("237a600000400000")), control(0x1F, 1)]
"""Frames that move an axis by profile position, without records, to 16 384 units."""


def jog(session: LiveSession) -> None:
    session.send(*PROFILE, SYNC)
    session.wait(400)
    session.send(control(0x0F, 1))


def stop_amid_records(session: LiveSession) -> None:
    session.send(*enable(), *queue(*(record._replace(sequence=2 + i) for i, record in enumerate(THERE_AND_BACK))))
    session.send(start_at_sync(), SYNC)
    session.wait(30)
    session.send(control(0x0B))
    session.wait(200)


def pause(session: LiveSession) -> None:
    session.send(*enable(), *queue(*(record._replace(sequence=2 + i) for i, record in enumerate(THERE_AND_BACK))))
    session.send(start_at_sync(), SYNC)
    session.wait(20)
    session.send(control(0x11F))
    session.wait(50)
    session.send(control(0x1F))
    session.wait(200)


@pytest.mark.slow
@pytest.mark.parametrize("ended", [True, False], ids=["ended", "interrupted"])
@pytest.mark.parametrize("later", [jog, stop_amid_records])
def test_the_last_motion_with_a_plan_is_verified_whatever_moves_the_machine_later(
    fast_kernel: Kernel,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    later: Callable[[LiveSession], None],
    ended: bool,
) -> None:
    session = LiveSession(fast_kernel, tmp_path)
    prepare(session, *THERE_AND_BACK)
    session.send(SYNC)
    session.wait(150)
    later(session)
    jog(session)
    if ended:
        session.end()
        assert run(["verify", str(tmp_path)]) == 0
        assert capsys.readouterr().out.endswith("warehouse-scara live: PASSED\n")
        report = json.loads((tmp_path / "report.json").read_text())
        assert report["no_plan"] is None
        assert report["started_s"] + 0.1 <= report["next_motion_s"] <= report["started_s"] + 0.2
        assert [row[0] for row in plan_rows(tmp_path)] == [0.0, 0.05, 0.1]
    session.board.record()
    stored = read_run(tmp_path)
    assert stored.no_plan is None
    assert stored.duration_s == pytest.approx(0.1)
    assert verify_folder(tmp_path).report.passed
    th1 = stored.comparison.counted[JOINT]
    assert th1.time_s.size == 40
    assert 0.0 < th1.time_s[0] < th1.time_s[-1] < 0.1


@pytest.mark.slow
def test_the_last_motion_with_a_plan_may_have_been_paused(fast_kernel: Kernel, tmp_path: Path) -> None:
    """It counts in its own time, and what moves the machine later does not count."""
    session = LiveSession(fast_kernel, tmp_path)
    prepare(session, *THERE_AND_BACK)
    session.send(SYNC)
    session.wait(150)
    pause(session)
    jog(session)
    session.end()
    report = json.loads((tmp_path / "report.json").read_text())
    assert report["started_s"] + 0.15 < report["next_motion_s"]
    stored = read_run(tmp_path)
    assert stored.no_plan is None
    assert stored.duration_s == pytest.approx(0.1)
    assert verify_folder(tmp_path).report.passed
    th1 = stored.comparison.counted[JOINT]
    assert th1.time_s.size == 40
    assert 0.0 < th1.time_s[0] < th1.time_s[-1] < 0.1


@pytest.mark.slow
def test_counts_without_any_plan_are_shown(
    fast_kernel: Kernel, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """After a jog alone there is nothing to verify, but a replay of every step."""
    session = LiveSession(fast_kernel, tmp_path)
    session.send(NMT_START)
    jog(session)
    assert no_plan(session, tmp_path) == "no trajectory was run; a jog, a move or a homing has no plan"
    assert run(["verify", str(tmp_path)]) == 2
    assert "trajectory.csv: is missing: no trajectory was run" in capsys.readouterr().err
    stored = read_run(tmp_path, counts_suffice=True)
    assert stored.no_plan == "no trajectory was run; a jog, a move or a homing has no plan"
    (first_s, *_, last_s) = stored.comparison.counted[JOINT].time_s.tolist()
    assert (first_s, stored.duration_s - last_s) == pytest.approx((0.001, 0.001))
    replay = Replay.of_folder(tmp_path)
    end = replay.at(replay.record.to_counts)
    assert not end.has_plan
    assert end.joints[JOINT].counted == pytest.approx(ROBOT.home[JOINT] + 360 / 200 / 5, abs=HALF_A_STEP_DEG)  # a step
    assert (replay.path.errors_mm == 0.0).all()


def test_a_recording_in_which_nothing_has_moved_cannot_be_shown(fast_kernel: Kernel, tmp_path: Path) -> None:
    LiveSession(fast_kernel, tmp_path).end()
    with refusing(InputError):
        read_run(tmp_path, counts_suffice=True)


def test_a_session_without_motion_has_no_plan(fast_kernel: Kernel, tmp_path: Path) -> None:
    session = LiveSession(fast_kernel, tmp_path)
    session.send(SYNC)
    assert no_plan(session, tmp_path) == "no trajectory was run; a jog, a move or a homing has no plan"
