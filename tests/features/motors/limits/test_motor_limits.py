"""Programs as fast as the motors manage: the planned torque is what is asked for, and the rotors keep step."""

from typing import Any

import numpy as np
import pytest

from steptwin.features.fastest.chain import driven
from steptwin.features.fastest.corners import JointLeg, flowing
from steptwin.features.fastest.drives import LoadChange, PathLoad
from steptwin.features.fastest.flow_path import FlowPath
from steptwin.features.fastest.pieces import PiecewisePath
from steptwin.features.motors.limits import motor_forecast, motor_limits
from steptwin.features.motors.turning import motors_of_run
from steptwin.features.motors.turning.after_run import first_slip
from steptwin.host.common.findings import Findings
from steptwin.host.planning.jobs import make_job
from steptwin.host.planning.motions.whole import Pace
from steptwin.host.planning.planner import plan
from steptwin.host.planning.programs import CompiledProgram, compile_program, parse_program, read_program
from steptwin.host.robots import load_robot
from steptwin.host.twin.embedded.execution import execute
from tests.end_to_end.pages import ROOT
from tests.host.complaints import complaint_of

ROBOT = load_robot("lab-scara")
A, B = np.array([100.0, -30, 60, 0]), np.array([100.0, 40, -20, 90])
PROGRAM = """
law = "fastest"
start = "a"
{limits}
[positions]
a = {{ d1 = 100.0, th2 = -30.0, th3 = 60.0, th4 = 0.0 }}
b = {{ d1 = 100.0, th2 = 40.0, th3 = -20.0, th4 = 90.0 }}
[[step]]
go = "b"
speed_percent = 100.0
[[step]]
go = "a"
speed_percent = 100.0
"""
LIMITS = '[limits]\nfrom = "motors"\nleft_percent = {left}'


def compiled(limits: str, **known: Any) -> CompiledProgram:
    found = Findings()
    program = parse_program(PROGRAM.format(limits=limits), found)
    found.raise_first()
    return compile_program(program, ROBOT, **({"drives": motor_limits} | known))


@pytest.fixture(scope="module")
def thirty() -> CompiledProgram:
    return compiled(LIMITS.format(left=30))


def path_there() -> FlowPath | PiecewisePath:
    return flowing(ROBOT, [JointLeg(ROBOT, A, B, Pace())], []).path


@pytest.mark.slow
def test_the_static_margin_is_what_is_asked_for(thirty: CompiledProgram) -> None:
    answers = [row.drives for row in thirty.steps]
    assert all(answers)
    for answer in answers:
        assert answer is not None
        assert 29.0 <= answer.left_percent <= 32.0
        assert answer.joint == "th2"
        assert answer.load_deg <= 85.0
        assert answer.slips_at is None or answer.slips_at < 0.87
        assert answer.average_s == pytest.approx(0.255, abs=0.015)  # 0.75 / 0.85 periods of its slowest swing


@pytest.mark.slow
def test_a_run_with_motors_keeps_step_and_one_by_the_joints_alone_does_not(thirty: CompiledProgram) -> None:
    ends = []
    for program in (thirty, compiled("")):
        outcome = execute(plan(ROBOT, program.motion), "pick")
        verdict = motors_of_run(ROBOT, outcome.comparison).verdict
        ends.append(verdict.kept_step)
    assert ends == [True, False]


@pytest.mark.slow
def test_less_torque_left_is_faster_and_more_is_slower(thirty: CompiledProgram) -> None:
    slow = compiled(LIMITS.format(left=60))
    assert slow.motion.duration_s > 1.2 * thirty.motion.duration_s
    assert slow.steps[0].drives is not None
    assert slow.steps[0].drives.left_percent >= 59.0


@pytest.mark.slow
def test_too_short_an_average_is_refused_by_the_rotors(monkeypatch: pytest.MonkeyPatch) -> None:
    """At 30 % and averaged over 0.05 s the torques suffice, and the arm swings until a rotor slips."""
    path = path_there()
    found = driven(ROBOT, path, motor_limits(ROBOT, 30.0), PathLoad(True))
    assert found.drives is not None
    assert found.drives.average_s > 0.15
    monkeypatch.setattr("steptwin.features.motors.limits.motor_rows.SOFTER", 1e9)
    monkeypatch.setattr("steptwin.features.motors.limits.motor_rows.AVERAGE_S", 0.05)
    limits = motor_limits(ROBOT, 30.0)
    text = complaint_of(lambda: driven(ROBOT, path, limits, PathLoad(True), tries=0))
    assert "rotor" in text
    assert "leaves 3" in text
    assert "averaged over 0.050 s: the motors do not keep step" in text
    text = complaint_of(lambda: driven(ROBOT, path, limits, PathLoad(True)))
    assert "the last of 7 that were tried: the motors do not keep step" in text


@pytest.mark.slow
def test_the_spiral_in_less_than_4_seconds_and_not_faster() -> None:
    """The paper's spiral took 18.8 s: 3.9 s are promised, and at 0.769 of the time its rotors slip."""
    motion = make_job(ROBOT, "spiral", {"law": "fastest"}, drives=motor_limits(ROBOT, 30.0))
    assert motion.duration_s <= 3.9
    outcome = execute(plan(ROBOT, motion), "spiral")
    run = motors_of_run(ROBOT, outcome.comparison)
    assert run.verdict.kept_step
    assert np.abs(run.trace.load_deg).max() <= 85.0
    assert first_slip(run.driving.stretched(0.769)) is not None


@pytest.mark.parametrize(("left", "passes"), [(29, True), (30, False)])
def test_weights_that_alone_need_too_much_are_refused_with_the_number(left: int, passes: bool) -> None:
    """The warehouse's vertical slide carries the arm: of its motor's torque 29 % can be left."""
    robot = load_robot("warehouse-scara")
    start = np.array(robot.home)
    goal = np.add(start, (0.0, 100.0, 0.0, 0.0, 0.0, 0.0))
    rates = flowing(robot, [JointLeg(robot, start, goal, Pace())], []).path.rates()
    limits = motor_limits(robot, float(left))
    if passes:
        assert limits.along(rates, PathLoad(False)).axes == len(robot.axes)
        return
    text = complaint_of(lambda: limits.along(rates, PathLoad(False)))
    assert "sz: weight and friction alone need 0.338 of 0.477 Nm at the motor" in text
    assert "of its torque 29 % can be left, not 30 %" in text


def test_motors_limit_no_other_law() -> None:
    drives = motor_limits(ROBOT, 30.0)
    complaint_of(lambda: make_job(ROBOT, "spiral", drives=drives))


@pytest.mark.parametrize(
    ("limits", "message"),
    [
        ('[limits]\nfrom = "motor"', "limits.from: 'motor' is not one of motors"),
        (LIMITS.format(left=91), "limits.left_percent: 91.0 % is outside 0..90 %; the nearest is 90 %"),
        (LIMITS.format(left=-1), "limits.left_percent: -1.0 % is outside 0..90 %; the nearest is 0 %"),
        ("[limits]\nleft_percent = 30", "limits.from: is missing"),
        ('[limits]\nfrom = "motors"\nleft = 30', "limits.left"),
    ],
)
def test_each_mistake(limits: str, message: str) -> None:
    text = complaint_of(lambda: compiled(limits))
    assert message in text, text


def test_planning_alone_knows_no_motors() -> None:
    text = complaint_of(lambda: compiled(LIMITS.format(left=30), drives=None))
    assert "planning alone knows no motors" in text


def test_a_program_without_a_fastest_step_asks_for_nothing() -> None:
    found = Findings()
    text = PROGRAM.format(limits=LIMITS.format(left=30)).replace('law = "fastest"', "")
    program = parse_program(text, found)
    told = complaint_of(lambda: compile_program(program, ROBOT, drives=motor_limits))
    assert "is for steps with law = 'fastest', and this program has none" in told


def test_a_robot_without_motors_is_refused() -> None:
    robot = load_robot("turntable")
    assert "is missing" in complaint_of(lambda: motor_limits(robot, 30.0)) or robot.dynamics is not None


def test_the_payload_counts_from_where_it_hangs() -> None:
    """A change counts both ways around its place, and one way behind it."""
    load = PathLoad(False, (LoadChange(2.0, 3.0, True), LoadChange(6.0, 7.0, False)))
    without, with_it = load.at(np.array([0.0, 2.5, 4.0, 6.5, 8.0]))
    assert without.tolist() == [True, True, False, True, True]
    assert with_it.tolist() == [False, True, True, True, False]


class TestForecast:
    """What a new user is told before a program runs."""

    @pytest.mark.slow
    def test_three_answers(self, thirty: CompiledProgram) -> None:
        fast = motor_forecast(ROBOT, compiled("").motion)
        assert fast is not None
        assert "th2's motor needs " in fast
        assert "its rotor will slip" in fast
        assert motor_forecast(ROBOT, thirty.motion) is None
        close = motor_forecast(ROBOT, compiled(LIMITS.format(left=10)).motion)
        assert close is not None
        assert "more than the usual 70 %: its rotor may slip" in close

    def test_nothing_of_a_robot_without_motors(self) -> None:
        robot = load_robot("turntable")
        program = compile_program(read_program(str(ROOT / "docs" / "programs" / "turntable.toml")), robot)
        assert motor_forecast(robot, program.motion) is None
