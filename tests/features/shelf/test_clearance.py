"""The swept check of the arm against the shelf, held against points on the arm at many instants."""

from dataclasses import replace
from math import radians

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from steptwin.features.shelf import clearance
from steptwin.features.shelf.clearance import MARGIN_MM, clear_orders, first_contact
from steptwin.host.common.arrays import FloatArray
from steptwin.host.common.errors import InputError
from steptwin.host.robots import load_robot
from steptwin.host.robots.box import Box
from steptwin.host.robots.kinematics import make_kinematics
from steptwin.host.robots.robot import Robot
from tests.features.shelf.shelves import ROBOT, SHELF
from tests.messages import refusing

RADIUS_MM = 20.0
HOME = list(ROBOT.home)
COORDINATES = st.floats(-100.0, 100.0)


def with_box(box: Box) -> Robot:
    """Return the robot with a single obstacle."""
    boxes = {**ROBOT.boxes, "only": box}
    return replace(ROBOT, boxes=boxes, sections={"shelf": replace(SHELF, obstacles=("only",))})


def points_of_arm(joints: FloatArray) -> FloatArray:
    """Points on the arm's middle lines, shape (n, points, 3): written out from the paper's dimensions."""
    sx, sz, lift = joints[:, 0], joints[:, 1], joints[:, 2]
    first, second, third = (np.deg2rad(joints[:, 3:6]).cumsum(axis=1)).T
    height = sz + lift

    def at(x: FloatArray, y: FloatArray, z: FloatArray) -> FloatArray:
        return np.stack([x, y, z], axis=-1)

    shoulder = at(sx, 0 * sx, height)
    elbow = shoulder + 200.0 * at(np.cos(first), np.sin(first), 0 * sx)
    wrist = elbow + 150.0 * at(np.cos(second), np.sin(second), 0 * sx)
    below = wrist - [0.0, 0.0, 40.0]
    tip = below + 40.0 * at(np.cos(third), np.sin(third), 0 * sx)
    bottom, top = at(sx, 0 * sx, sz), at(sx, 0 * sx, sz + 200.0)
    pieces = [(bottom, top), (shoulder, elbow), (elbow, wrist), (wrist, below), (below, tip)]
    along = np.linspace(0.0, 1.0, 41)[:, None, None]
    return np.concatenate([a + along * (b - a) for a, b in pieces]).transpose(1, 0, 2)


def free_mm(boxes: list[Box], joints: FloatArray) -> FloatArray:
    """Distance of the arm's surface from the nearest box, shape (n,)."""
    points = points_of_arm(joints)
    distances = []
    for box in boxes:
        low, high = np.array([box.x_mm, box.y_mm, box.z_mm]).T
        outside = np.maximum(low - points, 0.0) + np.maximum(points - high, 0.0)
        distances.append(np.linalg.norm(outside, axis=2).min(axis=1))
    return np.asarray(np.min(distances, axis=0) - RADIUS_MM)


@pytest.mark.slow
@given(st.lists(COORDINATES, min_size=6, max_size=6), st.tuples(COORDINATES, COORDINATES, COORDINATES))
def test_the_distance_of_a_box_from_a_line(ends: list[float], corner: tuple[float, float, float]) -> None:
    """No point of the line is nearer than the one found, and the point found has the distance told."""
    x, y, z = corner
    box = Box((x, x + 40.0), (y, y + 0.1), (z, z + 70.0))
    first, second = ends[:3], ends[3:]
    distance, along = box.nearest_on_line(first, second)
    assert 0.0 <= along <= 1.0

    def distance_at(part: FloatArray) -> FloatArray:
        points = np.array(first) + part[:, None] * np.subtract(second, first)
        low, high = np.array([box.x_mm, box.y_mm, box.z_mm]).T
        outside = np.maximum(low - points, 0.0) + np.maximum(points - high, 0.0)
        return np.asarray(np.linalg.norm(outside, axis=1))

    assert distance_at(np.array([along])) == pytest.approx([distance], abs=1e-9)
    assert distance_at(np.linspace(0.0, 1.0, 400)).min() >= distance - 1e-9


def joints_between(number: int) -> st.SearchStrategy[float]:
    joint = ROBOT.joints[number]
    return st.floats(joint.lower, joint.upper)


POSITIONS = st.tuples(*(joints_between(number) for number in range(6)))


@pytest.mark.slow
@settings(max_examples=12)
@given(POSITIONS, POSITIONS)
def test_nothing_slips_through_on_any_way(start: tuple[float, ...], goal: tuple[float, ...]) -> None:
    """Held against 41 points on each part at 500 instants."""
    contact = first_contact(ROBOT, start, goal)
    until = 1.0 if contact is None else contact.part_of_way
    parts = np.linspace(0.0, until, 500)[:, None]
    free = free_mm([ROBOT.boxes[name] for name in SHELF.obstacles], np.array(start) + parts * np.subtract(goal, start))
    between_points_mm = 200.0 / 40 / 2
    if until > 0.0:  # or the arm stands there already
        assert free[:-1].min() > MARGIN_MM / 2 - 1e-6
    if contact is None:
        assert free.min() > MARGIN_MM / 2 - 1e-6
    else:
        assert free[-1] < MARGIN_MM + between_points_mm


@pytest.mark.parametrize(("gap_mm", "blocked"), [(0.99, True), (1.01, False)])
@pytest.mark.parametrize("thickness_mm", [0.01, 50.0])
def test_an_arm_that_passes_a_post_beside_it(gap_mm: float, thickness_mm: float, *, blocked: bool) -> None:
    """The stretched arm, along y, ends at y = 390; the post begins so much behind its rounded end."""
    behind_mm = 390.0 + RADIUS_MM + gap_mm
    robot = with_box(Box((900.0, 900.0 + thickness_mm), (behind_mm, behind_mm + 10.0), (-500.0, 500.0)))
    contact = first_contact(robot, [0.0, 0.0, 100.0, 90.0, 0.0, 0.0], [1900.0, 0.0, 100.0, 90.0, 0.0, 0.0])
    assert (contact is not None) is blocked
    if contact:
        assert (contact.joint, contact.link, contact.box) == ("sx", "tool", "only")
        assert contact.position == pytest.approx(900.0, abs=10.0)
        assert contact.at_mm == pytest.approx((contact.position, 390.0, 60.0), abs=1e-6)


def test_the_joint_that_moves_the_arm_there_most_is_named() -> None:
    """The shoulder swings the stretched arm into a box; the slide moves it by less meanwhile."""
    robot = with_box(Box((-500.0, 500.0), (300.0, 320.0), (0.0, 300.0)))
    contact = first_contact(robot, [0.0, 0.0, 100.0, 0.0, 0.0, 0.0], [50.0, 0.0, 100.0, 90.0, 0.0, 0.0])
    assert contact is not None
    assert contact.joint == "th1"
    tip_y_mm = 390.0 * np.sin(radians(contact.position))
    assert tip_y_mm + RADIUS_MM == pytest.approx(300.0 - MARGIN_MM, abs=MARGIN_MM)


def test_a_way_that_is_blocked_only_for_all_joints_together() -> None:
    """Straight, the tool drags along the drawers; with the slides first the arm is still drawn back."""
    start, goal = [0.0, 0.0, 100.0, -90.0, 60.0, 30.0], [400.0, 100.0, 100.0, 0.0, 60.0, 29.0]
    contact = first_contact(ROBOT, start, goal)
    assert contact is not None
    assert clear_orders(ROBOT, start, goal) == ""  # the goal itself touches the drawer
    drawn_back = [400.0, 100.0, 100.0, -90.0, 60.0, 30.0]
    assert first_contact(ROBOT, start, drawn_back) is None
    over_all = [1900.0, 100.0, 100.0, -10.0, 60.0, 30.0]
    raised = [0.0, 100.0, *HOME[2:]]
    assert first_contact(ROBOT, raised, over_all) is not None
    assert clear_orders(ROBOT, raised, over_all) == "L1 th1 th2 th3"


def test_a_way_of_no_length_and_a_robot_without_obstacles() -> None:
    assert first_contact(ROBOT, HOME, HOME) is None
    through = [700.0, 200.0, 100.0, 90.0, 0.0, 0.0]
    assert first_contact(ROBOT, through, through) is not None
    assert first_contact(replace(ROBOT, sections={}), HOME, through) is None
    lab = load_robot("lab-scara")
    assert first_contact(lab, list(lab.home), list(lab.home)) is None


def test_a_mechanism_whose_parts_are_not_known(monkeypatch: pytest.MonkeyPatch) -> None:
    hybrid = make_kinematics(load_robot("hybrid-arm"))
    monkeypatch.setattr(clearance, "make_kinematics", lambda _: hybrid)
    with refusing(InputError):
        first_contact(ROBOT, HOME, HOME)
