"""Boxes around a machine: their edges, what touches them, and how the tool moves one that it holds."""

import numpy as np
import pytest

from steptwin.host.common.arrays import FloatArray
from steptwin.host.robots import load_robot
from steptwin.host.robots.box import TOUCH_MM, Box
from steptwin.host.robots.kinematics import make_kinematics

BOX = Box((0.0, 10.0), (20.0, 40.0), (-5.0, 5.0), "lock")


def test_the_edges() -> None:
    edges_mm = BOX.edges_mm
    assert edges_mm.shape == (12, 2, 3)
    lengths_mm = np.abs(np.diff(edges_mm, axis=1))[:, 0]
    assert sorted(lengths_mm.sum(axis=1)) == [10.0] * 8 + [20.0] * 4
    assert (np.count_nonzero(lengths_mm, axis=1) == 1).all()
    assert len({tuple(corner) for edge in edges_mm for corner in edge.tolist()}) == 8


@pytest.mark.parametrize("axis", range(3))
@pytest.mark.parametrize("end", range(2))
def test_a_point_touches_the_box_up_to_a_millimetre_from_it(axis: int, end: int) -> None:
    point_mm = np.array([5.0, 30.0, 0.0])
    outwards = 2 * end - 1
    for beyond_mm, touches in ((TOUCH_MM, True), (TOUCH_MM + 1e-6, False)):
        point_mm[axis] = (BOX.x_mm, BOX.y_mm, BOX.z_mm)[axis][end] + outwards * beyond_mm
        assert BOX.touched_by(point_mm) is touches


def tip_at(t_s: FloatArray) -> FloatArray:
    """A tool that starts at the box's front and goes along -y at 10 mm/s, then back from 5 s on."""
    along_mm = np.where(t_s < 5.0, 10.0 * t_s, 100.0 - 10.0 * t_s)
    return np.column_stack([np.full_like(t_s, 5.0), 20.0 - along_mm, np.zeros_like(t_s)])


def test_a_held_box_moves_with_the_tool() -> None:
    t_s = np.array([0.0, 1.0, 2.0, 3.0, 4.0, 8.0, 9.0])
    shifts_mm = BOX.shifts_mm(t_s, [(0.0, 3.0), (7.0, 8.0)], tip_at)
    assert shifts_mm[:, 1].tolist() == [0, -10, -20, -30, -30, -20, -20]
    assert not shifts_mm[:, ::2].any()


def test_the_tool_must_touch_the_box_where_it_is_now() -> None:
    t_s = np.array([4.0, 6.5])
    assert not BOX.shifts_mm(t_s, [(1.0, 3.0)], tip_at).any()  # the tool is 10 mm in front of it by then
    assert BOX.shifts_mm(t_s, [(0.0, 3.0), (6.0, 6.5)], tip_at)[:, 1].tolist() == [-30, -30]


def test_the_warehouse_hand_locks_onto_each_drawer_of_its_own() -> None:
    """Only the slot's drawer is touched at the pose in which the jobs lock onto it."""
    robot = load_robot("warehouse-scara")
    for slot in ("A1", "A2", "B1", "B2"):
        place = robot.places[slot]
        tip_mm = make_kinematics(robot).forward(np.array([[place["sx"], place["sz"], *robot.home[2:]]]))[0, :3]
        held = [name for name, box in robot.boxes.items() if box.held_by and box.touched_by(tip_mm)]
        assert held == [f"drawer-{slot}"]
        x_mm, y_mm, z_mm = robot.boxes[f"drawer-{slot}"].x_mm, *tip_mm[1:]
        assert (x_mm[0] + x_mm[1]) / 2 == tip_mm[0]
        assert (y_mm, z_mm) == pytest.approx((170.0, place["sz"] + 60.0), abs=0.1)
