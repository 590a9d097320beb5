"""Runs that wait for inputs, in virtual time and on a live board: each is verified against what it has executed."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from steptwin.controller.motion.backend import Kernel
from steptwin.host.cli.app import run
from steptwin.host.client.waits import HOLD_MS, LEAD_MS
from steptwin.host.common.errors import InputError, WaitTimeoutError
from steptwin.host.operate.inputs_outputs import streamed_motion
from steptwin.host.operate.running import execute_live
from steptwin.host.operate.session import Session
from steptwin.host.operate.status import read_status
from steptwin.host.planning.motion import Motion
from steptwin.host.planning.motions.composer import Composer, Sequence
from steptwin.host.planning.planner import plan, plan_stretched
from steptwin.host.record.folder import read_run, verify_folder
from steptwin.host.robots import load_robot
from steptwin.host.twin.embedded.embedded_board import EmbeddedBoard
from steptwin.host.twin.embedded.execution import execute
from steptwin.host.twin.embedded.outcome import Outcome
from steptwin.host.twin.machine.input_changes import InputChange
from steptwin.host.verify import Expectation, compare, verify_comparison
from steptwin.protocol.pvt import PvtRecord
from tests.host.complaints import complaint_of
from tests.laws import law_of
from tests.messages import refusing

ROBOT = load_robot("teaching-scara")


def motion() -> Motion:
    """Return a motion of th1 there and back, with a wait for each level of the input."""
    composer = Composer(ROBOT, np.array(ROBOT.home))
    composer.go_some({"th1": 30.0, "th4": 10.0})
    composer.wait("part_ready", on=True, timeout_s=3.0, place="step 2")
    composer.switch("gripper", on=True)
    composer.wait("part_ready", on=False, timeout_s=3.0, place="step 4")
    composer.go_some({"th1": 0.0})
    return composer.sequence()


MOTION = motion()
PLAN = plan(ROBOT, MOTION)
COMES, GOES = InputChange("part_ready", on=True, at_s=2.0), InputChange("part_ready", on=False, at_s=4.0)


@pytest.fixture(scope="module")
def outcome(fast_kernel: Kernel) -> Outcome:
    return execute(PLAN, "waits", fast_kernel, inputs=[GOES, COMES])


def test_it_goes_on_after_the_inputs(outcome: Outcome) -> None:
    assert outcome.passed, outcome.report.reasons
    first, second = outcome.waits
    for wait, change in ((first, COMES), (second, GOES)):
        late_ms = 1000 * (wait.at_s + wait.stood_s - change.at_s)
        assert LEAD_MS - HOLD_MS <= late_ms <= LEAD_MS + 3 * HOLD_MS
    stood_s = first.stood_s + second.stood_s
    assert outcome.report.run.duration_s == pytest.approx(PLAN.motion.duration_s + stood_s)
    assert outcome.to_dict()["waits"][0] == {
        "input": "part_ready", "on": True, "at_s": first.at_s, "stood_s": first.stood_s,
    }  # fmt: skip


def test_the_executed_plan_has_exactly_the_records_that_were_sent(outcome: Outcome) -> None:
    for axis, records in enumerate(outcome.plan.records()):
        sent = [frame.data for _, frame in outcome.bus_log if frame.cob_id == 0x510 + axis]
        numbered = zip(*records, (i % 256 for i in range(len(sent))), strict=True)
        assert sent == [PvtRecord(*fields).encode() for fields in numbered]


def test_the_folder_holds_what_was_executed(outcome: Outcome, tmp_path: Path) -> None:
    outcome.save(tmp_path)
    verdict = verify_folder(tmp_path)
    assert verdict.passed, verdict.reasons
    assert read_run(tmp_path).duration_s == pytest.approx(outcome.report.run.duration_s)


def test_against_the_plan_without_the_standstills_it_fails(outcome: Outcome) -> None:
    expected = Expectation.of(ROBOT, PLAN.motion)
    report = verify_comparison(compare(expected, outcome.comparison.evidence), outcome.report.run)
    assert not report.passed


@pytest.mark.parametrize("factor", [1.0, pytest.param(2.345, marks=pytest.mark.slow)])
def test_a_stretched_motion_waits_too(fast_kernel: Kernel, factor: float) -> None:
    slow = execute(plan_stretched(ROBOT, MOTION, factor), "waits", fast_kernel, inputs=[COMES, GOES])
    assert slow.passed, slow.report.reasons
    assert len(slow.waits) == 2


def test_an_input_that_is_on_from_the_start(fast_kernel: Kernel) -> None:
    outcome = execute(PLAN, "waits", fast_kernel, inputs=[COMES._replace(at_s=0.0), GOES._replace(at_s=1.3)])
    assert outcome.passed, outcome.report.reasons
    assert outcome.waits[0].stood_s <= (LEAD_MS + 2 * HOLD_MS) / 1000


@pytest.mark.slow
def test_a_time_out_ends_the_run_at_rest(
    fast_kernel: Kernel, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """The run is verified as far as it went: it ends with the standstill at the wait."""
    outcome = execute(PLAN, "waits", fast_kernel, inputs=[COMES])
    assert outcome.fault is not None
    assert outcome.fault.message == "step 4: the input part_ready was not off within 3 s"
    assert outcome.fault.positions_agree
    assert not any(outcome.fault.codes.values())
    assert outcome.fault.joints["th1"] == pytest.approx(30.0, abs=0.02)
    assert outcome.waits[1].stood_s == pytest.approx(3.0 + LEAD_MS / 1000, abs=0.03)
    assert [wait.timed_out for wait in outcome.waits] == [False, True]
    assert outcome.report.passed, outcome.report.reasons
    last = outcome.waits[1]
    assert outcome.report.run.duration_s == pytest.approx(last.at_s + last.stood_s)
    assert [output["changed_s"] is not None for output in outcome.to_dict()["outputs"]] == [True]
    for axis, records in enumerate(outcome.plan.records()):
        assert len([1 for _, frame in outcome.bus_log if frame.cob_id == 0x510 + axis]) == len(records.durations_ms)
    outcome.save(tmp_path)
    verdict = verify_folder(tmp_path)
    assert (verdict.passed, verdict.reasons) == (False, ())
    assert run(["verify", str(tmp_path)]) == 3
    printed = capsys.readouterr().out
    assert "waits: STOPPED BY A WAIT THAT TIMED OUT\n  up to the wait every pulse is right\n" in printed


def test_a_plan_is_cut_only_where_it_stands_at_a_point() -> None:
    at_ms = round(1000 * MOTION.waits[0].at_s)
    assert PLAN.until(at_ms).times_ms[-1] == at_ms
    for end_ms in (at_ms - 200, at_ms + 1, int(PLAN.times_ms[-1]) + 1):
        with refusing(ValueError):
            PLAN.until(end_ms)


@pytest.mark.slow
def test_runs_are_deterministic(fast_kernel: Kernel, outcome: Outcome) -> None:
    assert execute(PLAN, "waits", fast_kernel, inputs=[GOES, COMES]).bus_log == outcome.bus_log


@pytest.mark.slow
def test_a_cut_stream_keeps_the_waits_before_the_cut(fast_kernel: Kernel) -> None:
    outcome = execute(PLAN, "waits", fast_kernel, inputs=[COMES, GOES], cut_stream_s=MOTION.waits[1].at_s + 0.3)
    assert len(outcome.waits) == 2
    assert outcome.fault is not None
    assert "pvt underrun" in outcome.fault.message


def test_unknown_inputs_and_waits_in_motion_are_refused(fast_kernel: Kernel) -> None:
    said = complaint_of(lambda: execute(PLAN, "waits", fast_kernel, inputs=[InputChange("part", on=True, at_s=1.0)]))
    assert said == "input of teaching-scara 'part' is unknown: did you mean part_ready?"
    moving = replace(MOTION, waits=(replace(MOTION.waits[0], at_s=0.3),))
    said = complaint_of(lambda: streamed_motion(plan(ROBOT, moving)))
    assert said == "step 2: the machine does not stand at t = 0.300 s to wait for part_ready on"
    with pytest.raises(InputError):
        execute(plan(ROBOT, moving), "waits", fast_kernel)


class TestLive:
    @pytest.fixture
    def board(self, fast_kernel: Kernel) -> EmbeddedBoard:
        return EmbeddedBoard(ROBOT, fast_kernel)

    @pytest.fixture
    def session(self, board: EmbeddedBoard) -> Session:
        session = Session(board, ROBOT)
        with session.charge("preset", needs=()) as charge:
            machine = charge.enable()
            machine.preset(session.units(list(ROBOT.home)))
        return session

    @pytest.mark.slow
    def test_it_waits_and_ends_where_planned(self, board: EmbeddedBoard, session: Session) -> None:
        back = Composer(ROBOT, np.array(ROBOT.home))
        back.wait("part_ready", on=True, timeout_s=2.0)
        there_and_back = plan(ROBOT, back.sequence())
        board.change_inputs([COMES._replace(at_s=1.0)])
        outcome = execute_live(session, there_and_back, "waits", repeat=2)
        assert outcome.passed
        (wait,) = outcome.waits  # of the last repetition, at which the input was on already
        assert wait.stood_s == pytest.approx(LEAD_MS / 1000, abs=0.03)
        assert outcome.to_dict()["duration_s"] == pytest.approx(0.01 + wait.stood_s)

    @pytest.mark.slow
    def test_a_time_out_leaves_the_machine_at_rest(self, board: EmbeddedBoard, session: Session) -> None:
        with refusing(WaitTimeoutError):
            execute_live(session, PLAN, "waits")
        status = read_status(session)
        assert [axis.state for axis in status.axes] == ["QUICK STOP ACTIVE"] * 4  # as after any error, with power
        assert status.inputs == {"part_ready": False}
        board.set_input("part_ready", on=True)
        assert read_status(session).inputs == {"part_ready": True}
        assert execute_live(session, plan(ROBOT, law_of(MOTION, Sequence).parts[0]), "on", approach=True).passed
