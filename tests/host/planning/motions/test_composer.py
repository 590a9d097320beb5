"""Composing a sequence: speeds of joints, positions reached, times of output_changes, and moves that are refused."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from steptwin.host.common.arrays import FloatArray
from steptwin.host.common.errors import InputError
from steptwin.host.planning.laws import Quintic, Trapezoid
from steptwin.host.planning.motion import Motion, OutputChange
from steptwin.host.planning.motions.composer import JERK_TIME_S, PACE, SWITCHING_S, Composer, Sequence
from steptwin.host.planning.motions.joint_move import JointMove
from steptwin.host.planning.planner import plan
from steptwin.host.robots import load_robot
from steptwin.host.robots.joint import Joint
from steptwin.host.robots.kinematics import make_kinematics
from steptwin.host.robots.robot import Robot
from tests.host.complaints import complaint_of
from tests.laws import law_of
from tests.messages import refusing

WAREHOUSE = load_robot("warehouse-scara")
LAB = load_robot("lab-scara")


def composer(robot: Robot = WAREHOUSE) -> Composer:
    return Composer(robot, np.array(robot.home))


def inside(joint: Joint) -> st.SearchStrategy[float]:
    return st.floats(joint.lower, joint.upper)


def positions(robot: Robot = WAREHOUSE) -> st.SearchStrategy[FloatArray]:
    return st.tuples(*map(inside, robot.joints)).map(np.array)


def only_part(moves: Composer) -> Motion:
    (part,) = law_of(moves.sequence(), Sequence).parts
    return part


@pytest.mark.slow
@given(positions(), positions())
def test_joints_go_as_fast_as_their_pace_allows(start: FloatArray, goal: FloatArray) -> None:
    """Moves use at most 80 % of each joint's speed and acceleration, reached in 0.1 s, and one joint reaches it."""
    moves = Composer(WAREHOUSE, start)
    moves.go(goal)
    if np.abs(goal - start).max() < 1e-9:
        assert law_of(moves.sequence(), Sequence).parts == ()
        return
    part = only_part(moves)
    t_s = np.arange(round(1000 * part.duration_s) + 1) / 1000  # the grid contains all breakpoints
    speeds_max = np.array([joint.speed_max for joint in WAREHOUSE.joints])
    accelerations_max = np.array([joint.acceleration_max for joint in WAREHOUSE.joints])
    accelerations = law_of(part, JointMove).accelerations(t_s)
    jerks = np.diff(accelerations, axis=0) / 0.001
    used = [
        (np.abs(part.velocities(t_s)) / speeds_max).max(),
        (np.abs(accelerations) / accelerations_max).max(),
        (np.abs(jerks) / accelerations_max).max() * JERK_TIME_S,
    ]
    assert max(used) <= PACE * (1.0 + 1e-6)
    if part.duration_s > 0.5:  # for shorter moves whole milliseconds are coarse
        assert max(used) > 0.97 * PACE
    assert part.positions(np.array([0.0, part.duration_s])) == pytest.approx(np.array([start, goal]), abs=1e-9)
    assert moves.joints == pytest.approx(goal, abs=1e-9)


def test_a_long_move_reaches_the_pace() -> None:
    """sx reaches 240 mm/s after 0.7 s and 400 mm/s^2 after 0.1 s; the duration is S / v + v / a + tj."""
    moves = composer()
    moves.go_some({"sx": 1200.0})
    part = only_part(moves)
    assert part.duration_s == pytest.approx(1200.0 / 240.0 + 240.0 / 400.0 + 0.1)
    assert np.abs(part.velocities(np.array([1.0]))[0, 0]) == pytest.approx(240.0)
    assert np.abs(law_of(part, JointMove).accelerations(np.array([0.3]))[0, 0]) == pytest.approx(400.0)


@pytest.mark.slow
@given(positions(), positions())
def test_a_move_to_the_present_position_adds_nothing(start: FloatArray, goal: FloatArray) -> None:
    """This holds although the end of a move differs from its goal by a rounding error."""
    moves = Composer(WAREHOUSE, start)
    moves.go(start)
    assert law_of(moves.sequence(), Sequence).parts == ()
    moves.go_by(Quintic(1.0, 1.0), goal)
    moves.go(goal)
    moves.go_some({"sx": float(goal[0]), "th3": float(goal[5])})
    assert moves.sequence().duration_s == 1.0


def test_a_goal_of_nan_is_refused() -> None:
    """Inverse kinematics gives NaN out of reach; a move that did nothing then would spoil all later moves."""
    with refusing(InputError):
        composer().go(np.array([0.0, 0.0, 100.0, np.nan, np.nan, np.nan]))


def test_some_joints_go_and_the_others_stay() -> None:
    moves = composer()
    moves.go_some({"th2": -30.0, "sz": 12.5})
    assert moves.joints.tolist() == [0.0, 12.5, 100.0, 0.0, -30.0, 30.0]
    with refusing(InputError):
        moves.go_some({"th": 1.0})


def test_a_move_by_a_given_law() -> None:
    moves = composer(LAB)
    moves.go_by(Quintic(1.0, 1.6), np.array([160.0, 10.0, 40.0, 90.0]))
    assert law_of(only_part(moves), JointMove).law == Quintic(1.0, 1.6)
    assert moves.joints.tolist() == [160.0, 10.0, 40.0, 90.0]


def test_a_line_begins_at_the_tools_position() -> None:
    moves = composer()
    moves.go_some({"sx": 300.0, "th1": 10.0})
    from_s = moves.sequence().duration_s
    begin = make_kinematics(WAREHOUSE).forward(moves.joints[np.newaxis])[0]
    moves.line("right", (-30.0, 40.0, 0.0), Trapezoid(50.0, 2.0, 0.5))
    sequence = moves.sequence()
    poses = make_kinematics(WAREHOUSE).forward(sequence.positions(from_s + np.linspace(0.0, 2.0, 41)))
    assert sequence.duration_s == from_s + 2.0
    assert poses - begin == pytest.approx(
        np.outer(Trapezoid(50.0, 2.0, 0.5).position(np.linspace(0.0, 2.0, 41)), [-0.6, 0.8, 0.0, 0.0]), abs=1e-9
    )
    assert moves.joints == pytest.approx(sequence.positions(np.array([sequence.duration_s]))[0])


def test_nothing_jumps_from_move_to_move() -> None:
    moves = composer()
    moves.go_some({"sx": 300.0, "sz": 40.0})
    moves.line("right", (0.0, -60.0, 0.0), Trapezoid(60.0, 2.0, 0.5))
    moves.switch("lock", on=True)
    moves.line("right", (0.0, 60.0, 0.0), Trapezoid(60.0, 2.0, 0.5))
    moves.pause(0.25)
    moves.go(np.array(WAREHOUSE.home))
    sequence = moves.sequence()
    meets_s = np.array(law_of(sequence, Sequence).starts_ms[1:-1]) / 1000
    assert len(meets_s) == 5
    assert sequence.positions(meets_s - 1e-9) == pytest.approx(sequence.positions(meets_s), abs=1e-9)
    assert np.abs(sequence.velocities(meets_s)).max() == 0.0
    assert plan(WAREHOUSE, sequence).times_ms[-1] == law_of(sequence, Sequence).starts_ms[-1]


def test_outputs_switch_while_the_machine_waits() -> None:
    moves = composer()
    moves.pause(1.25)
    moves.switch("magnet", on=True)
    moves.go_some({"sx": 300.0})
    later_s = moves.sequence().duration_s
    moves.switch("magnet", on=False)
    sequence = moves.sequence()
    assert sequence.output_changes == (
        OutputChange("magnet", True, 1.25, 1.25 + SWITCHING_S),
        OutputChange("magnet", False, later_s, round(later_s + SWITCHING_S, 3)),
    )
    for switching in sequence.output_changes:
        waiting_s = np.linspace(switching.from_s, switching.until_s, 31)
        assert np.ptp(sequence.positions(waiting_s), axis=0).tolist() == [0.0] * 6
        assert np.abs(sequence.velocities(waiting_s)).max() == 0.0


def test_a_sequence_is_what_was_composed_until_then() -> None:
    moves = composer()
    moves.pause(0.5)
    early = moves.sequence()
    moves.pause(0.5)
    assert (early.duration_s, moves.sequence().duration_s) == (0.5, 1.0)


@pytest.mark.parametrize(
    ("robot", "output", "message"),
    [
        (WAREHOUSE, "magnt", "outputs: 'magnt' is unknown: did you mean magnet?"),
        (WAREHOUSE, "pump", "outputs: 'pump' is unknown: there are magnet, lock"),
        (
            LAB,
            "magnet",
            "outputs: lab-scara has none; its file names them under [outputs], such as magnet = "
            '{ joint = "th4", out = 1 }',
        ),
    ],
)
def test_an_unknown_output(robot: Robot, output: str, message: str) -> None:
    moves = composer(robot)
    told = complaint_of(lambda: moves.switch(output, on=True))
    assert told == message
    assert law_of(moves.sequence(), Sequence).parts == ()


@pytest.mark.parametrize(
    ("way_mm", "words"),
    [
        ((200.0, 0.0, 0.0), "at t = 6.{}s the tool's path breaks off: shoulder to wrist 350."),
        ((0.0, 0.0, 0.0), "a straight line of 0 mm has both ends at one place"),
    ],
)
def test_a_line_out_of_reach(way_mm: tuple[float, float, float], words: str) -> None:
    """Home is 304 mm from the shoulder; after 5 s the line begins, at 100 mm/s."""
    moves = composer()
    moves.pause(5.0)
    told = complaint_of(lambda: moves.line("right", way_mm, Trapezoid(200.0, 4.0, 0.5)))
    begin, _, end = words.partition("{}")
    assert told.startswith(begin)
    assert end in told


def test_a_line_on_the_other_branch() -> None:
    moves = composer()
    moves.pause(5.0)
    with refusing(InputError):
        moves.line("left", (0.0, -10.0, 0.0), Trapezoid(10.0, 1.0, 0.25))


@pytest.mark.parametrize("duration_s", [0.0, -0.001, 0.0015, float("nan")])
def test_a_pause_must_last(duration_s: float) -> None:
    with refusing(InputError):
        composer().pause(duration_s)


def test_limits_are_the_robots_own() -> None:
    joints = tuple(replace(joint, speed_max=joint.speed_max / 10, homing=None) for joint in LAB.joints)
    lazy = replace(LAB, joints=joints)
    durations_s = []
    for robot in (LAB, lazy):
        moves = composer(robot)
        moves.go_some({"th2": 100.0})
        durations_s.append(moves.sequence().duration_s)
    assert durations_s[1] > 5 * durations_s[0]
