"""Axes and frames of pictures: a joint that moves leaves its axis where it is; the tool's frame is the product's."""

import numpy as np
import pytest

from steptwin.host.robots import load_robot, read_robot, robot_names
from steptwin.host.robots.joint import Unit
from steptwin.host.robots.kinematics import Role, make_kinematics
from steptwin.host.robots.kinematics.base import tool_frames
from steptwin.host.robots.kinematics.marks import AXIS_PART, FRAME_PART, Skeleton
from steptwin.host.robots.new_file import robot_text, with_settings
from steptwin.host.robots.robot import Robot

GANTRY = read_robot(robot_text("gantry", "cartesian", *with_settings("cartesian", {"axes": "XYZC"})))
BENCH = read_robot(robot_text("bench", "axes", *with_settings("axes", {})))
ROBOTS = [robot for robot in (*map(load_robot, robot_names()), GANTRY) if make_kinematics(robot).task.width]
each_robot = pytest.mark.parametrize("robot", ROBOTS, ids=[robot.name for robot in ROBOTS])


def within(robot: Robot) -> list[float]:
    return [0.55 * joint.lower + 0.45 * joint.upper for joint in robot.joints]


@each_robot
def test_a_turning_joint_leaves_its_axis_and_a_sliding_one_moves_along_it(robot: Robot) -> None:
    """By the motion of the tool's frame from one joint position to another, which carries the axis along."""
    start = within(robot)
    for i, (joint, axis) in enumerate(zip(robot.joints, Skeleton(robot).axes(np.array([start])), strict=True)):
        assert (axis.name, axis.role) == (f"axis {joint.name}", Role.AXIS)
        if joint.name in ("Z5", "Z6"):  # two slides of one platform: neither alone moves it along
            continue
        moved = list(start)
        moved[i] += 0.5
        if not np.isfinite(both := tool_frames(make_kinematics(robot), np.array([start, moved]))).all():
            continue
        motion = both[1] @ np.linalg.inv(both[0])
        ends_mm = axis.points_mm[0]
        carried_mm = ends_mm @ motion[:3, :3].T + motion[:3, 3]
        direction = (ends_mm[1] - ends_mm[0]) / np.linalg.norm(ends_mm[1] - ends_mm[0])
        if joint.unit is Unit.MM:
            assert carried_mm - ends_mm == pytest.approx(np.tile(0.5 * direction, (2, 1)), abs=1e-9), joint.name
            continue
        assert carried_mm == pytest.approx(ends_mm, abs=1e-9), joint.name
        skew = (motion[:3, :3] - motion[:3, :3].T) / 2
        turn = np.array([skew[2, 1], skew[0, 2], skew[1, 0]])
        assert turn == pytest.approx(np.sin(np.deg2rad(0.5)) * direction, abs=1e-12), joint.name


def test_axes_of_the_ar4_as_its_maker_draws_them() -> None:
    """At zero: J1 upwards, J2, J3 and J5 to the left, J4 and J6 to the front."""
    robot = load_robot("ar4-mk3")
    ways = [np.ptp(axis.points_mm[0], axis=0) for axis in Skeleton(robot).axes(np.zeros((1, 6)))]
    length_mm = 2 * AXIS_PART * Skeleton(robot).size_mm
    expected = [[0, 0, 1], [0, 1, 0], [0, 1, 0], [1, 0, 0], [0, 1, 0], [1, 0, 0]]
    assert np.array(ways) == pytest.approx(length_mm * np.array(expected), abs=1e-9)


def test_axes_of_a_machine_without_a_tool_are_its_guides() -> None:
    for joint, axis in zip(BENCH.joints, Skeleton(BENCH).axes(np.array([BENCH.home])), strict=True):
        way_mm = axis.points_mm[0, 1] - axis.points_mm[0, 0]
        assert np.flatnonzero(np.abs(way_mm) > 1e-9).tolist() == [0 if joint.unit is Unit.MM else 2]


@each_robot
def test_frames_are_those_of_the_base_each_joint_and_the_tool(robot: Robot) -> None:
    joints = np.array([within(robot), robot.home])
    drawn = Skeleton(robot).frames(joints)
    assert [part.role for part in drawn[:3]] == [Role.X, Role.Y, Role.Z]
    table = make_kinematics(robot).dh
    assert len(drawn) == 3 * (len([row for row in table.rows if row.theta_deg.variable or row.d_mm.variable]) + 2)
    tool = tool_frames(make_kinematics(robot), joints)
    for k, part in enumerate(drawn[-3:]):
        assert part.name == f"{'xyz'[k]} of tool"
        assert part.points_mm[:, 0] == pytest.approx(tool[:, :3, 3], abs=1e-9, nan_ok=True)
        way_mm = part.points_mm[:, 1] - part.points_mm[:, 0]
        assert way_mm == pytest.approx(FRAME_PART * Skeleton(robot).size_mm * tool[:, :3, k], abs=1e-9, nan_ok=True)
