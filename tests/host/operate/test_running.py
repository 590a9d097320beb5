"""Runs on a live board: start, end, repetitions, and other programs that interfere."""

import json
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from steptwin.host.common.errors import BusError, DeviceFaultError, InputError
from steptwin.host.operate.moving import move
from steptwin.host.operate.recovering import axis_states, emergency_stop, reset, stop
from steptwin.host.operate.running import check_repeatable, execute_live
from steptwin.host.operate.session import Session
from steptwin.host.operate.status import MachineStatus, read_status
from steptwin.host.planning.jobs import make_job
from steptwin.host.planning.motions.composer import Composer
from steptwin.host.planning.motions.joint_move import fastest_law
from steptwin.host.planning.plan import Plan
from steptwin.host.planning.planner import plan
from steptwin.host.planning.trajectory_file import read_trajectory
from steptwin.host.twin.embedded.embedded_board import EmbeddedBoard
from tests.host.client.machines import SX, Neighbour, sdo_requests
from tests.host.operate.sessions import HALF_STEPS, ROBOT, CommandLine
from tests.messages import refusing


@pytest.fixture(scope="module")
def pull() -> Plan:
    return plan(ROBOT, make_job(ROBOT, "pull-line", {"duration_s": "2", "ramp_s": "0.5"}))


@pytest.mark.slow
def test_it_ends_where_planned(board: EmbeddedBoard, session: Session, pull: Plan) -> None:
    heard: list[float] = []
    outcome = execute_live(session, pull, "pull-line", approach=True, progress=heard.append)
    assert outcome.passed
    end = pull.points_units[-1] / ROBOT.wire_units_per_unit
    counted = np.array(board.driver_positions()) / ROBOT.steps_per_unit
    assert np.all(np.abs(counted - end) <= HALF_STEPS)
    assert outcome.end == pytest.approx(counted.tolist(), abs=1e-9)
    assert heard[-1] == 1.0
    assert [state.state for state in axis_states(session)] == ["OPERATION ENABLED"] * 6


@pytest.mark.slow
def test_without_approach_the_machine_must_stand_at_the_start(session: Session, pull: Plan) -> None:
    move(session, [5.0, *ROBOT.home[1:]])
    with refusing(InputError):
        execute_live(session, pull, "pull-line")
    move(session, pull.start_joints)
    assert execute_live(session, pull, "pull-line").passed


@pytest.mark.slow
def test_an_axis_that_ends_elsewhere_is_seen(session: Session, pull: Plan, monkeypatch: pytest.MonkeyPatch) -> None:
    positions = session.machine.positions_units
    one_step = 16384 // ROBOT.joints[SX].transmission.microsteps

    def shifted() -> list[int]:
        return [position + (one_step if i == SX else 0) for i, position in enumerate(positions())]

    monkeypatch.setattr(session.machine, "positions_units", shifted)
    outcome = execute_live(session, pull, "pull-line", approach=True)
    assert not outcome.passed
    assert [axis.passed for axis in outcome.axes] == [False, *[True] * 5]


@pytest.mark.slow
@pytest.mark.parametrize(
    "interfere",
    [stop, emergency_stop],
)
def test_a_stop_by_another_program_ends_it(
    board: EmbeddedBoard,
    session: Session,
    pull: Plan,
    monkeypatch: pytest.MonkeyPatch,
    interfere: object,
) -> None:
    other = Session(Neighbour(board, monkeypatch), ROBOT)
    move(session, pull.start_joints)

    def halfway(fraction: float) -> None:
        if fraction > 0.5:
            assert callable(interfere)
            interfere(other)

    with refusing(DeviceFaultError) as caught:
        execute_live(session, pull, "pull-line", progress=halfway)
    assert caught.value.exit_code == 3
    assert all(axis.position_known for axis in axis_states(session))
    reset(session)
    assert execute_live(session, pull, "pull-line", approach=True).passed


@pytest.mark.slow
def test_another_program_may_read_the_status(
    board: EmbeddedBoard, session: Session, pull: Plan, monkeypatch: pytest.MonkeyPatch
) -> None:
    """`status` beside a run asks only how fast it is, in one frame, and a move beside it is refused."""
    other = Session(Neighbour(board, monkeypatch), ROBOT)
    move(session, pull.start_joints)
    seen: list[MachineStatus] = []

    def halfway(fraction: float) -> None:
        if fraction > 0.5 and not seen:
            begin = len(board.bus_log)
            seen.append(read_status(other))
            (request,) = sdo_requests(board, begin)
            assert (request.cob_id, request.data) == (0x610, bytes.fromhex("4010200400000000"))
            with refusing(BusError):
                move(other, pull.start_joints)

    assert execute_live(session, pull, "pull-line", progress=halfway).passed
    status = seen[0]
    assert status.streaming
    assert status.pose is not None
    assert {axis.state for axis in status.axes} == {"OPERATION ENABLED"}
    assert {axis.mode for axis in status.axes} == {"interpolated position"}
    assert all(axis.moving and axis.supply_v is None and axis.queue and axis.queue.free < 64 for axis in status.axes)


@pytest.mark.slow
def test_a_run_after_a_reset_shows_no_error(session: Session, pull: Plan) -> None:
    """While a trajectory is streamed the reports alone say what the present error is: none, whatever was before."""
    emergency_stop(session)
    reset(session)
    assert session.machine.axes[SX].error_codes
    seen: list[MachineStatus] = []
    execute_live(session, pull, "pull-line", approach=True, progress=lambda _: seen.append(read_status(session)))
    streaming = [status for status in seen if status.streaming]
    assert streaming
    assert {axis.error for status in streaming for axis in status.axes} == {None}


@pytest.fixture(scope="module")
def there_and_back(tmp_path_factory: pytest.TempPathFactory) -> Plan:
    """A trajectory that ends where it starts, which can be repeated."""
    home = ",".join(map(str, ROBOT.home))
    away = ",".join(map(str, [50.0, *ROBOT.home[1:]]))
    file = tmp_path_factory.mktemp("points") / "there-and-back.csv"
    file.write_text(f"t,{','.join(ROBOT.joint_names)}\n0,{home}\n1.5,{away}\n3,{home}\n")
    return plan(ROBOT, read_trajectory(str(file), ROBOT))


@pytest.mark.slow
def test_repetitions(session: Session, there_and_back: Plan) -> None:
    begun_s: list[float] = []
    outcome = execute_live(
        session,
        there_and_back,
        "there-and-back",
        repeat=3,
        approach=True,
        begun=lambda: begun_s.append(session.link.now_s()),
    )
    assert np.diff(begun_s) == pytest.approx([there_and_back.motion.duration_s] * 2, abs=0.3)
    assert (outcome.repetitions, outcome.passed) == (3, True)
    assert outcome.to_dict()["repetitions"] == 3


@pytest.mark.slow
@pytest.mark.parametrize("off_steps", [1, -1])
def test_no_repetition_follows_one_that_ended_elsewhere(
    board: EmbeddedBoard, session: Session, there_and_back: Plan, off_steps: int
) -> None:
    """At the end of the second repetition another program tells the first axis that it stands a step elsewhere."""
    step_units = 16_384 // ROBOT.joints[0].transmission.microsteps
    standing_units = session.units(list(ROBOT.home))
    ends: list[float] = []

    def meddle(fraction: float) -> None:
        if fraction < 1 or session.link.now_s() < begun_s[-1] + 3.0:
            return
        ends.append(session.link.now_s())
        if len(ends) == 2:
            elsewhere = [standing_units[0] + off_steps * step_units, *standing_units[1:]]
            session.machine.preset(elsewhere)

    begun_s: list[float] = []
    outcome = execute_live(
        session,
        there_and_back,
        "there-and-back",
        repeat=4,
        progress=meddle,
        begun=lambda: begun_s.append(session.link.now_s()),
    )
    assert (outcome.repetitions, outcome.passed, len(begun_s)) == (2, False, 2)
    assert outcome.axes[0].error_steps == off_steps
    assert [axis.passed for axis in outcome.axes] == [False, *[True] * 5]
    assert board.driver_positions()[0] == 0.0
    assert outcome.to_dict()["repetitions"] == 2


def test_a_plan_that_ends_elsewhere_is_not_repeated(pull: Plan) -> None:
    check_repeatable(pull, 1)
    with refusing(InputError):
        check_repeatable(pull, 2)
    with refusing(InputError):
        check_repeatable(pull, 0)


@pytest.mark.slow
@pytest.mark.usefixtures("session")
def test_the_command(steptwin: CommandLine) -> None:
    document = steptwin.json("run warehouse-scara pull-line --approach")
    assert document["passed"]
    assert [axis["name"] for axis in document["axes"]] == list(ROBOT.joint_names)
    assert all(abs(axis["error_steps"]) <= 0.5625 for axis in document["axes"])
    exit_code, out, err = steptwin.run("run warehouse-scara pull-line")
    assert (exit_code, out) == (2, "")
    assert "the board stands at" in err
    assert err.endswith("; --approach moves it there first\n")
    for options, message in (
        ("--out somewhere", "--out: is for a run in virtual time, without --connect or -i"),
        ("-m stand-at=1", "--machine stand-at: is for a run in virtual time, without --connect or -i"),
        ("--cut-stream 1", "--cut-stream: is for a run in virtual time, without --connect or -i"),
        ("--input part=on@1", "--input: is for a run in virtual time, without --connect or -i"),
        ("--motors", "--motors: is for a run in virtual time, without --connect or -i"),
        ("--kernel python", "--kernel: is for a run in virtual time, without --connect or -i"),
        (
            "-m driver-profile=3a-module",
            "--machine driver-profile: is for a run in virtual time, without --connect or -i",
        ),
    ):
        assert steptwin.run(f"run warehouse-scara pull-line {options}") == (2, "", f"steptwin: {message}\n")


@pytest.mark.parametrize("suffix", [".csv", pytest.param(".toml", marks=pytest.mark.slow)])
@pytest.mark.usefixtures("session")
def test_a_stretched_file_or_program(suffix: str, board: EmbeddedBoard, steptwin: CommandLine, tmp_path: Path) -> None:
    """Too fast as it is; as slow as the refusal says the machine makes it, in the time that this takes."""
    home, away = (",".join(map(str, [sx, *ROBOT.home[1:]])) for sx in (ROBOT.home[SX], 20.0))
    file = tmp_path / f"fast{suffix}"
    file.write_text(
        f"t,{','.join(ROBOT.joint_names)}\n0,{home}\n0.1,{away}\n"
        if suffix == ".csv"
        else "[[step]]\ngo = { sx = 20 }\nduration_s = 0.1\n",
        encoding="utf-8",
    )
    exit_code, _, err = steptwin.run(f"run warehouse-scara {file}")
    assert exit_code == 2
    factor = float(err.rsplit("(--stretch ", 1)[1].rstrip(")\n"))
    begin_s = board.now_s()
    exit_code, out, err = steptwin.run(f"run warehouse-scara {file} --stretch {factor} --json")
    document = json.loads(out)
    assert (exit_code, document["passed"]) == (0, True)
    assert f" times: {document['duration_s']:.3f} s instead of 0.100 s\n" in err
    assert document["duration_s"] == pytest.approx(0.1 * factor, abs=1e-3)
    assert board.now_s() - begin_s > document["duration_s"]
    assert document["joints"]["end"][SX] == pytest.approx(20.0, abs=HALF_STEPS[SX])
    assert steptwin.run(f"run warehouse-scara {file} --speed 50")[0] == 2


@pytest.mark.slow
def test_pause_and_resume_by_another_program(
    board: EmbeddedBoard, session: Session, steptwin: CommandLine, pull: Plan
) -> None:
    """Pause and resume in the middle of a run: it takes longer and ends where planned."""
    seen: list[dict[str, Any]] = []

    def halfway(fraction: float) -> None:
        if fraction > 0.5 and not seen:
            seen.append(steptwin.json("pause warehouse-scara"))
            begun_s = board.now_s()
            session.link.wait(10.0)
            seen.append(steptwin.json("resume warehouse-scara"))
            assert board.now_s() - begun_s > 10.0

    assert execute_live(session, pull, "pull-line", progress=halfway).passed
    assert seen == [{"robot": "warehouse-scara", "halted": True}, {"robot": "warehouse-scara", "halted": False}]


@pytest.mark.slow
def test_an_approach_through_the_shelf_is_refused(board: EmbeddedBoard, session: Session) -> None:
    """From home to beyond the shelf the tool would drag along the drawers; the machine stays where it is."""
    beyond = Composer(ROBOT, np.array([1900.0, 0.0, 200.0, *ROBOT.home[3:]]))
    beyond.pause(0.1)
    motion, before = plan(ROBOT, beyond.sequence()), board.driver_positions()
    with pytest.raises(InputError) as error:
        execute_live(session, motion, "beyond", approach=True)
    found = re.fullmatch(
        r"approach=True: sx at (\S+) mm, (\S+) s on the way to the start, brings the tool to (\S+),"
        r" at x (\S+), y 169\.9, z (\S+) mm; moving sx sz first, then the others, is clear",
        str(error.value),
    )
    assert found, error.value
    sx_mm, at_s, x_mm, z_mm = (float(found[i]) for i in (1, 2, 4, 5))
    assert x_mm == pytest.approx(sx_mm + 275.0, abs=0.1)
    assert z_mm == pytest.approx(60.0 + 100.0 * sx_mm / 1900.0, abs=0.1)
    law = fastest_law(ROBOT, np.subtract(motion.start_joints, ROBOT.home))
    assert law.position(np.array([at_s]))[0] == pytest.approx(sx_mm / 1900.0, abs=1e-4)
    assert board.driver_positions() == before


@pytest.mark.slow
def test_an_approach_past_the_shelf_is_made(session: Session) -> None:
    move(session, [0.0, 0.0, 100.0, -60.0, 60.0, 30.0])
    beyond = Composer(ROBOT, np.array([1900.0, 0.0, 150.0, -60.0, 60.0, 30.0]))
    beyond.pause(0.1)
    assert execute_live(session, plan(ROBOT, beyond.sequence()), "beyond", approach=True).passed
