"""A joint with two motors: the matrix with more rows than columns, and what a robot file may say."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from steptwin.host.common.errors import InputError
from steptwin.host.robots import load_robot, robot_names
from steptwin.host.robots.coupling import Coupling
from steptwin.host.robots.reader import parse_robot
from steptwin.host.robots.robot import AXES_MAX
from tests.host.robots.gantries import SECOND, STEPS_PER_MM, UNITS_PER_MM, gantry_robot, gantry_text
from tests.messages import refusing

NAMES = ("a", "b", "c")


def test_axes_are_joints_and_behind_them_second_motors() -> None:
    robot = gantry_robot()
    assert robot.joint_names == ("X", "Y")
    assert robot.axis_names == ("X", "Y", "Y2")
    assert robot.second_motors == (1,)
    assert [robot.coupling.joint_of(axis) for axis in range(3)] == [0, 1, 1]
    assert [robot.coupling.motors_of(joint) for joint in range(2)] == [(0,), (1, 2)]
    assert robot.axes[2].transmission == robot.joints[1].transmission
    assert robot.axis_position_text(2) == "axis position = 1 Y"
    assert [robot.coupling.couples(axis) for axis in range(3)] == [False] * 3


@pytest.mark.parametrize("name", robot_names())
def test_without_second_motors_the_axes_are_the_joints(name: str) -> None:
    robot = load_robot(name)
    if not robot.second_motors:
        assert robot.axes == robot.joints
        assert robot.axis_names == robot.joint_names


def test_by_hand() -> None:
    """Y is in the middle between its motors; the second is 2 mm ahead."""
    robot = gantry_robot()
    assert robot.to_units(np.array([10.0, 20.0])).tolist() == pytest.approx(
        [10 * UNITS_PER_MM, *[20 * UNITS_PER_MM] * 2]
    )
    steps = np.array([10.0, 20.0, 22.0]) * STEPS_PER_MM
    assert robot.from_steps(steps).tolist() == pytest.approx([10.0, 21.0])
    assert robot.skews(np.array([10.0, 20.0, 22.0]) * UNITS_PER_MM).tolist() == pytest.approx([2.0])
    assert robot.coupling.axes_moved_by(1) == {1: 1.0, 2: 1.0}
    assert robot.coupling.axes_of(1) == {1: 0.5, 2: 0.5}
    assert robot.coupling.travel_of(2) == {2: 1.0}


def test_both_ends_at_one_place_change_no_bit() -> None:
    coupling = gantry_robot().coupling
    q = np.random.default_rng(1).uniform(-300, 300, (1000, 2))
    assert (coupling.to_joints(coupling.to_axes(q)) == q).all()
    assert not coupling.skews(coupling.to_axes(q)).any()


@pytest.mark.slow
@given(st.lists(st.floats(-2.0, 2.0), min_size=6, max_size=6), st.lists(st.integers(0, 2), max_size=3, unique=True))
def test_joints_are_the_least_squares_solution(beside: list[float], seconds: list[int]) -> None:
    """numpy's pseudo-inverse, by singular values, is the oracle; joints that depend on each other included."""
    ab, ac, ba, bc, ca, cb = beside
    rows = {"a": {"a": 5.0, "b": ab, "c": ac}, "b": {"a": ba, "b": 5.0, "c": bc}, "c": {"a": ca, "b": cb, "c": 5.0}}
    coupling = Coupling.of(NAMES, rows).with_second_motors(3, sorted(seconds))
    if not seconds:
        return
    assert np.array(coupling.inverse) == pytest.approx(np.linalg.pinv(np.array(coupling.matrix)), abs=1e-12)
    assert len(coupling.matrix) == 3 + len(seconds)


def test_a_skew_is_the_joints() -> None:
    """An axis that goes 2 for 1 of its joint: 4 between the motors are 2 at the joint; a CoreXY's motor gives half."""
    geared = Coupling.of(NAMES, {"a": {"a": 2.0}}).with_second_motors(3, (0,))
    assert geared.skews(np.array([0.0, 0.0, 0.0, 4.0])).tolist() == [2.0]
    belts = Coupling.of(NAMES, {"a": {"a": 1.0, "b": 1.0}, "b": {"a": -1.0, "b": 1.0}}).with_second_motors(3, (0,))
    assert belts.skews(np.array([0.0, 0.0, 0.0, 4.0])).tolist() == [2.0]
    assert belts.travel_of(3) == {1: -0.5, 3: 0.5}


def test_the_second_motors_switches_are_shifted() -> None:
    robot = gantry_robot(f"{SECOND}square_offset = 0.5\n")
    assert robot.joints[1].switches.negative_limit == -2.0
    assert robot.axes[2].switches.negative_limit == -1.5


@pytest.mark.parametrize(
    ("second", "complaint"),
    [
        (SECOND.replace("Y2", "X"), "joints.Y.second_motor.name: X is the name of another axis"),
        (SECOND.replace("3.0", "0.0"), "joints.Y.second_motor.skew_max: 0 is not above 0"),
        (SECOND.replace('name = "Y2"\n', ""), "joints.Y.second_motor.name: is missing"),
        (
            f"{SECOND}ratio = 2.0\n",
            "joints.Y.second_motor.ratio: key 'ratio' is unknown: there are name, skew_max, square_offset",
        ),
        (
            f"{SECOND}square_offset = 2.0\n",
            "joints.Y.second_motor.square_offset: switches.negative_limit: 0 mm is not below lower, 0 mm",
        ),
    ],
)
def test_what_a_file_may_not_say(second: str, complaint: str) -> None:
    with pytest.raises(InputError) as refused:
        gantry_robot(second)
    assert complaint in str(refused.value)


def test_a_switch_that_a_second_motor_just_does_not_reach() -> None:
    assert gantry_robot(f"{SECOND}square_offset = 1.999\n").axes[2].switches.negative_limit == pytest.approx(-0.001)


def test_a_board_drives_eight_motors() -> None:
    text = gantry_text("").replace('kind = "cartesian"', 'kind = "axes"').replace('axes = "XY"\n', "")
    head, slides = text.split("\n[joints.X]")[0], text.split("\n[joints.X]")[1].split("\n[joints.Y]")[0]
    homes = "\n".join(f"J{i} = 0.0" for i in range(7))

    def file(motors: int) -> str:
        joints = ["[joints.X]" + slides.replace("joints.X", f"joints.J{i}") for i in range(7)]
        joints = [joint.replace("[joints.X]", f"[joints.J{i}]") for i, joint in enumerate(joints)]
        joints += [f'[joints.J{i}.second_motor]\nname = "S{i}"\nskew_max = 1.0\n' for i in range(motors - 7)]
        return "\n".join([head.split("[home]")[0], "[home]", homes, *joints])

    assert len(parse_robot(file(AXES_MAX), "eight").axes) == AXES_MAX
    with refusing(InputError):
        parse_robot(file(AXES_MAX + 1), "nine")
