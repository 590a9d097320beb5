"""Slower and faster while a run is in motion: by another program, within the motion's limits, also through a pause."""

from collections.abc import Callable
from typing import Any

import pytest

from steptwin.host.client.pausing import change_speed, pause_trajectory, resume_trajectory
from steptwin.host.common.errors import InputError
from steptwin.host.operate.inputs_outputs import streamed_motion
from steptwin.host.operate.moving import move
from steptwin.host.operate.running import execute_live
from steptwin.host.operate.session import Session
from steptwin.host.operate.status import read_status
from steptwin.host.planning.jobs import make_job
from steptwin.host.planning.laws import Cubic
from steptwin.host.planning.motions.joint_move import joint_move
from steptwin.host.planning.plan import Plan, highest_speed
from steptwin.host.planning.planner import plan
from steptwin.host.twin.embedded.embedded_board import EmbeddedBoard
from steptwin.host.twin.machine.machine_options import MachineOptions
from steptwin.protocol import od
from tests.host.client.machines import Neighbour
from tests.host.operate.sessions import HOME, ROBOT, CommandLine, preset
from tests.messages import refusing


@pytest.fixture(scope="module")
def pull() -> Plan:
    """A motion of 4 s that may be half as fast again."""
    made = plan(ROBOT, make_job(ROBOT, "pull-line", {"duration_s": "4", "ramp_s": "1"}))
    assert highest_speed(made).percent == 150
    return made


def once_at(part: float, act: Callable[[], None]) -> Callable[[float], None]:
    """Return a listener to progress that acts once, when this part of the records has been sent."""
    done: list[float] = []

    def heard(fraction: float) -> None:
        if fraction > part and not done:
            done.append(fraction)
            act()

    return heard


def run_s(session: Session, made: Plan, act: Callable[[], None], part: float = 0.3) -> float:
    """Run a plan whose start the machine goes to first; return the time that it takes from its begin on."""
    move(session, made.start_joints)
    begun: list[float] = []
    outcome = execute_live(
        session, made, "pull", progress=once_at(part, act), begun=lambda: begun.append(session.link.now_s())
    )
    assert outcome.passed
    return session.link.now_s() - begun[0]


@pytest.mark.parametrize(
    ("percent", "least_s", "most_s"),
    [
        pytest.param(50, 6.0, 8.0, marks=pytest.mark.slow),
        pytest.param(10, 25.0, 40.0, marks=pytest.mark.slow),
        (150, 2.65, 3.5),
    ],
)
def test_it_takes_longer_or_less_and_ends_where_planned(
    session: Session, steptwin: CommandLine, pull: Plan, percent: int, least_s: float, most_s: float
) -> None:
    seen: list[dict[str, Any]] = []

    def act() -> None:
        seen.append(steptwin.json(f"speed warehouse-scara {percent}"))

    took_s = run_s(session, pull, act)
    assert seen == [{"robot": "warehouse-scara", "speed_percent": percent, "highest_percent": 150}]
    assert least_s < took_s < most_s


@pytest.mark.slow
def test_status_shows_the_speed(session: Session, steptwin: CommandLine, pull: Plan) -> None:
    seen: list[float | None] = []

    def act() -> None:
        seen.append(steptwin.json("status warehouse-scara")["speed_percent"])
        assert steptwin.run("speed warehouse-scara 40%") == (0, "goes on at 40 % of the planned speed\n", "")
        session.machine.wait(1.0)
        assert "speed: 40 % of the planned one\n" in steptwin.run("status warehouse-scara")[1]
        pause_trajectory(session.machine)
        seen.append(steptwin.json("status warehouse-scara")["speed_percent"])
        resume_trajectory(session.machine)
        session.machine.wait(1.0)
        seen.append(steptwin.json("status warehouse-scara")["speed_percent"])

    run_s(session, pull, act)
    assert seen == [100, 0, 40]
    assert read_status(session).speed_percent is None
    assert steptwin.json("status warehouse-scara")["speed_percent"] is None


@pytest.mark.slow
def test_the_next_run_begins_as_planned(session: Session, pull: Plan) -> None:
    told: list[int] = []
    run_s(session, pull, lambda: told.append(change_speed(session.machine, 60)))
    assert told == [150]
    assert run_s(session, pull, lambda: None) == pytest.approx(4.0, abs=0.1)


@pytest.mark.slow
def test_more_than_the_motion_allows_is_refused_with_what_passes(session: Session, steptwin: CommandLine) -> None:
    goal = (*ROBOT.home[:3], ROBOT.home[3] + 30.0, *ROBOT.home[4:])
    fast = plan(ROBOT, joint_move(ROBOT.joint_names, ROBOT.home, goal, Cubic(1.0, 0.7)))
    highest = highest_speed(fast).percent
    assert 100 <= highest < 150
    told: list[object] = []

    def act() -> None:
        told.append(steptwin.run(f"speed warehouse-scara {highest + 1}"))
        told.append(steptwin.run(f"speed warehouse-scara {highest}")[0])

    run_s(session, fast, act, part=0.2)
    says = (
        f"steptwin: speed {highest + 1} %: this motion can be made at most {highest} % as fast as planned,"
        f" by its limits; {highest} % passes\n"
    )
    assert told == [(2, "", says), 0]


@pytest.mark.parametrize(
    ("words", "says"),
    [
        ("9", "speed 9 %: is not from 10 to 150 %; 10 % passes"),
        ("151", "speed 151 %: is not from 10 to 150 %; 150 % passes"),
        ("-5", None),
        ("fast", "after the robot: a whole number of percent, such as 50, not fast"),
        ("50 60", "after the robot: a whole number of percent, such as 50, not 50 60"),
        ("", "after the robot: a whole number of percent, such as 50, not nothing"),
        ("50", "nothing to make slower or faster: no axis runs a trajectory"),
    ],
)
@pytest.mark.usefixtures("session")
def test_refusals_are_one_line(steptwin: CommandLine, words: str, says: str | None) -> None:
    exit_code, out, err = steptwin.run(f"speed warehouse-scara {words}")
    assert (exit_code, out, err.count("\n")) == (2, "", 1)
    if says is not None:
        assert err == f"steptwin: {says}\n"


@pytest.mark.slow
def test_a_second_program_is_no_disturbance(
    board: EmbeddedBoard, session: Session, pull: Plan, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Changes all the time, of the rate and by pauses, while outputs and records are sent."""
    other = Session(Neighbour(board, monkeypatch, session.link.wait), ROBOT)
    move(session, pull.start_joints)
    percents = iter([50, 150, 30, 120, 10, 100, 150, 70] * 4)

    def act(fraction: float) -> None:
        if 0.05 < fraction < 0.95:
            change_speed(other.machine, next(percents, 100))

    assert execute_live(session, pull, "pull", progress=act).passed


@pytest.mark.slow
def test_axes_on_several_boards_keep_their_speed(fast_kernel: object, pull: Plan) -> None:
    board = EmbeddedBoard(ROBOT, fast_kernel, MachineOptions(stand_at=HOME, axes_per_board=[4, 2]))  # type: ignore[arg-type]
    session = preset(board, HOME)
    told: list[str] = []

    def act() -> None:
        with pytest.raises(InputError) as refused:
            change_speed(session.machine, 50)
        told.append(str(refused.value))

    run_s(session, pull, act)
    assert told == ["speed 50 %: the axes are on several boards, whose times would part; 100 % passes"]


@pytest.mark.slow
def test_a_program_that_knows_no_limits_may_only_be_slowed(session: Session, pull: Plan) -> None:
    """So is a step of the tool, whose speed has a limit of its own: it is streamed without a word of its peaks."""
    move(session, pull.start_joints)
    run = session.machine.start(streamed_motion(pull))
    session.machine.wait(1.0)
    assert {axis.read(od.GROUP_RATE_HIGHEST_Q16) for axis in session.machine.axes} == {od.FULL_RATE_Q16}
    with refusing(InputError):
        change_speed(session.machine, 101)
    assert change_speed(session.machine, 80) == 100
    session.machine.wait(12.0)
    assert run.ended
