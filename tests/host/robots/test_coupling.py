"""Coupled joints: golden values by hand, both ways, and matrices that are refused."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from steptwin.host.common.errors import InputError
from steptwin.host.robots import load_robot
from steptwin.host.robots.coupling import CONDITION_MAX, Coupling
from tests.host.robots.coupled import DIRECT, STEPS_PER_DEG, TWO_TO_ONE, UNITS_PER_DEG, coupled_robot
from tests.messages import refusing

JOINTS = np.array([30.0, 40.0, 10.0, 90.0])
NAMES = ("a", "b", "c")


@pytest.mark.parametrize(("coupling", "elbow_axis_deg"), [(DIRECT, 70.0), (TWO_TO_ONE, 100.0), ("", 40.0)])
def test_axes_by_hand(coupling: str, elbow_axis_deg: float) -> None:
    """The shoulder at 30 deg turns the elbow's motor along by the belt's ratio."""
    robot = coupled_robot(coupling)
    units, steps = robot.to_units(JOINTS), robot.to_steps(JOINTS)
    assert units[:2] == pytest.approx([30 * UNITS_PER_DEG, elbow_axis_deg * UNITS_PER_DEG], abs=0.5)
    assert steps[:2] == pytest.approx([30 * STEPS_PER_DEG, elbow_axis_deg * STEPS_PER_DEG])
    assert robot.to_positions(units) == pytest.approx(JOINTS, abs=2 / UNITS_PER_DEG)
    assert robot.from_steps(steps) == pytest.approx(JOINTS)


def test_one_axis_alone_by_hand() -> None:
    """The shoulder's motor alone turns the upper arm; the elbow's motor stands, so the forearm keeps its direction."""
    robot = coupled_robot()
    assert robot.from_steps(np.array([90 * STEPS_PER_DEG, 0, 0, 0])) == pytest.approx([90.0, -90.0, 0.0, 0.0])
    assert robot.from_steps(np.array([0, 90 * STEPS_PER_DEG, 0, 0])) == pytest.approx([0.0, 90.0, 0.0, 0.0])
    assert robot.coupling.axes_moved_by(0) == {0: 1.0, 1: 1.0}
    assert robot.coupling.axes_moved_by(1) == {1: 1.0}
    assert robot.coupling.axes_of(1) == {0: -1.0, 1: 1.0}
    assert [robot.coupling.couples(axis) for axis in range(4)] == [False, True, False, False]


def test_a_ball_screw_spline_couples_mm_to_degrees() -> None:
    """Nut and spline on one shaft with a lead of 20 mm: a turn of the tool lifts it unless the nut turns too."""
    robot = coupled_robot(f"d3 = {{ th4 = {20 / 360} }}")
    assert robot.to_steps(np.array([0.0, 0.0, 7.0, 360.0]))[2] == pytest.approx(27.0 * 200 * 8 / 5)


elements = st.floats(-2.0, 2.0)


@pytest.mark.slow
@given(st.lists(elements, min_size=6, max_size=6), st.lists(st.floats(-1e3, 1e3), min_size=3, max_size=3))
def test_both_ways(beside: list[float], joints: list[float]) -> None:
    """A matrix with 5 on its diagonal, which is more than the sum beside it, has an inverse."""
    ab, ac, ba, bc, ca, cb = beside
    rows = {"a": {"a": 5.0, "b": ab, "c": ac}, "b": {"a": ba, "b": 5.0, "c": bc}, "c": {"a": ca, "b": cb, "c": 5.0}}
    coupling, q = Coupling.of(NAMES, rows), np.array(joints)
    matrix = np.array([[row[name] for name in NAMES] for row in rows.values()])
    assert coupling.to_axes(q) == pytest.approx(matrix @ q)
    assert coupling.to_joints(coupling.to_axes(np.stack([q, -q]))) == pytest.approx(np.stack([q, -q]), abs=1e-9)


def test_the_identity_changes_no_bit() -> None:
    q = np.array([[0.1, np.nan, -0.0]])
    coupling = Coupling.of(NAMES, {"a": {"a": 1.0, "b": 0.0}})
    assert coupling == Coupling()
    assert coupling.to_axes(q) is q
    assert coupling.to_joints(q) is q
    robot = load_robot("teaching-scara")
    assert replace(robot, coupling=Coupling.of(robot.joint_names, {})) == robot


def test_rounding_of_a_row_depends_on_no_other_row() -> None:
    coupling = Coupling.of(NAMES, {"b": {"a": 1 / 3, "c": 0.1}})
    q = np.random.default_rng(1).uniform(-300, 300, (1000, 3))
    assert (coupling.to_axes(q) == np.stack([coupling.to_axes(row) for row in q])).all()
    assert (coupling.to_axes(q)[:, 0] == q[:, 0]).all()


@pytest.mark.parametrize(
    "coupling",
    [
        "th2 = { th2 = 0.0 }",
        "th1 = { th2 = 1.0 }\nth2 = { th1 = 1.0 }",
        "th2 = { th9 = 1.0 }",
        "elbow = { th1 = 1.0 }",
        "th2 = { th1 = 'x' }",
        "th2 = { th1 = 1.0, th2 = -1.0 }",
        "th1 = { th2 = 2.0 }\nth2 = { th1 = 2.0 }",
        "th2 = { th1 = 3000.0 }",
        'th1 = { th2 = 0.5 }\nth2 = { th1 = 0.5 }\n[joints.th1.second_motor]\nname = "s"\nskew_max = 1.0',
        "th1 = { th2 = 1.0 }\nth2 = { th1 = -4.5 }",
        "th1 = { th1 = 5.0 }",
    ],
)
def test_what_is_refused(coupling: str) -> None:
    with refusing(InputError):
        coupled_robot(coupling)


def test_both_sides_of_the_condition_number() -> None:
    """diag(1, s) has the condition number s."""
    assert Coupling.of(("a", "b"), {"b": {"b": CONDITION_MAX}}).matrix
    with refusing(InputError):
        Coupling.of(("a", "b"), {"b": {"b": CONDITION_MAX * (1 + 1e-9)}})


def test_limits_of_a_coupled_axis() -> None:
    robot = coupled_robot(axis_speed_max="300.0", axis_acceleration_max="1500.0")
    assert robot.axis_speeds_max.tolist() == [180.0, 300.0, 40.0, 360.0]
    assert robot.axis_accelerations_max.tolist() == [1000.0, 1500.0, 200.0, 2000.0]
    assert coupled_robot().axis_speeds_max.tolist() == [180.0, 180.0, 40.0, 360.0]
    with refusing(InputError):
        coupled_robot("", axis_speed_max="300.0")
    with refusing(InputError):
        coupled_robot(axis_speed_max="-1.0")
    coupled_robot(axis_speed_max="421.8")  # 15 kHz are 421.875 deg/s
    with refusing(InputError):
        coupled_robot(axis_speed_max="422.0")


def test_both_sides_of_the_wire() -> None:
    """The wire's i32 reaches 58982.4 deg here: 150 deg of the elbow times 393.2, but its search would be too fast."""
    with refusing(InputError):
        coupled_robot("th2 = { th2 = 393.3 }")
    with refusing(InputError):
        coupled_robot("th2 = { th2 = 393.0 }")


@pytest.mark.parametrize(
    ("rows", "levels"),
    [
        ({}, [[0, 1, 2]]),
        ({"b": {"a": 1.0}}, [[0, 2], [1]]),
        ({"a": {"b": 1.0}, "b": {"c": 1.0}}, [[2], [1], [0]]),
        ({"a": {"b": 0.5}, "b": {"a": 0.5}}, [[2], [0], [1]]),
        ({"a": {"b": 0.5}, "b": {"a": 0.5}, "c": {"a": 1.0}}, [[0], [1], [2]]),
        ({"a": {"b": 0.5}, "b": {"c": 0.5}, "c": {"a": 0.5}}, [[0], [1], [2]]),
        ({"b": {"c": 0.5, "a": 1.0}, "c": {"b": 0.5}}, [[0], [1], [2]]),
    ],
)
def test_homing_levels(rows: dict[str, dict[str, float]], levels: list[list[int]]) -> None:
    assert Coupling.of(NAMES, rows).homing_levels(3) == levels


def test_axes_that_home_a_joint() -> None:
    """Both of a CoreXY, each as far as the joint goes; of a belt about the shoulder the elbow's motor stands."""
    belts = Coupling.of(NAMES, {"a": {"a": 1.0, "b": 1.0}, "b": {"a": -1.0, "b": 1.0}, "c": {"a": 1.0}})
    assert [belts.mutual(joint) for joint in range(3)] == [{0, 1}, {0, 1}, {2}]
    assert [belts.homing_axes(joint) for joint in range(3)] == [{0: 1.0, 1: -1.0}, {0: 1.0, 1: 1.0}, {2: 1.0}]
    assert Coupling.of(NAMES, {"b": {"a": 1.0}}).homing_axes(0) == {0: 1.0}
    assert Coupling().with_second_motors(3, (1,)).homing_axes(1) == {1: 1.0, 3: 1.0}
