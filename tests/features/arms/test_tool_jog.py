"""Ways of the tool for a held button: straight, at the speed asked for, as far as the arm reaches."""

import numpy as np
import pytest

from steptwin.host.common.errors import InputError
from steptwin.host.planning.tool_by_hand import (
    SPEED_MAX_MM_S,
    WAY_MAX_MM,
    StepFrame,
    ToolStep,
    check_tool_jog,
    farthest_part,
    plan_tool_jog,
)
from steptwin.host.robots import load_robot
from steptwin.host.robots.kinematics import make_kinematics
from steptwin.host.robots.robot import Robot
from tests.features.arms.test_tool_step import ROBOTS, STANDING, poses, standing
from tests.messages import refusing

DIRECTIONS = [("x", -1.0), pytest.param("y", 1.0, marks=pytest.mark.slow), ("z", -1.0)]


@pytest.mark.parametrize(("axis", "sign"), DIRECTIONS)
@pytest.mark.parametrize("robot", ROBOTS, ids=list(STANDING))
def test_the_way_is_straight_and_ends_where_the_reach_ends(robot: Robot, axis: str, sign: float) -> None:
    """A search by whole plans finds the same end; the way may end a millimetre or a fiftieth before it."""
    start = standing(robot)
    plan = plan_tool_jog(robot, start, axis, 25.0 * sign)
    path = poses(plan, np.linspace(0.0, plan.motion.duration_s, 101))
    ways = path[:, :3] - path[0, :3]
    column = "xyz".index(axis)
    assert np.abs(np.delete(ways, column, axis=1)).max() < 1e-6
    farthest = farthest_part(robot, start, ToolStep({axis: sign * WAY_MAX_MM}, 20.0))
    assert farthest
    reach = farthest.distances[axis]
    assert 0.98 * abs(reach) - 1.0 <= sign * ways[-1, column] <= abs(reach) + 0.1


def test_the_speed_is_what_was_asked_for_where_the_joints_allow_it() -> None:
    robot = load_robot("calibration-scara")
    for speed in (10.0, 50.0):
        plan = plan_tool_jog(robot, standing(robot), "x", -speed)
        t_s = np.linspace(0.0, plan.motion.duration_s, 2001)
        speeds = np.linalg.norm(np.diff(poses(plan, t_s)[:, :3], axis=0), axis=1) / np.diff(t_s)
        assert speeds.max() == pytest.approx(speed, rel=0.02)


def test_where_it_is_too_fast_soon_it_is_slower_and_goes_as_far() -> None:
    """The warehouse's lift makes some 60 mm/s: at 250 mm/s not even a millimetre would pass."""
    robot = load_robot("warehouse-scara")
    fast, slow = (plan_tool_jog(robot, standing(robot), "z", speed) for speed in (SPEED_MAX_MM_S, 10.0))
    ends = [poses(plan, np.array([plan.motion.duration_s]))[0, 2] for plan in (fast, slow)]
    assert ends[0] == pytest.approx(ends[1], abs=1e-6)
    assert fast.motion.duration_s < slow.motion.duration_s


def test_bad_jogs_are_refused() -> None:
    robot = load_robot("lab-scara")
    with refusing(InputError):
        check_tool_jog(robot, "w", 1.0)
    for speed in (0.0, SPEED_MAX_MM_S * 1.001, -SPEED_MAX_MM_S * 1.001):
        with refusing(InputError):
            check_tool_jog(robot, "x", speed)
    top = [robot.joints[0].upper, *standing(robot)[1:]]
    with refusing(InputError):
        plan_tool_jog(robot, top, "z", 10.0)


@pytest.mark.slow
@pytest.mark.parametrize("frame", StepFrame)
def test_a_six_axis_arm_turns_on_the_spot_at_the_speed_that_was_asked_for(frame: StepFrame) -> None:
    robot = load_robot("ar4-mk3")
    plan = plan_tool_jog(robot, [0.0, 10.0, 20.0, 0.0, 45.0, 0.0], "rz", 8.0, frame)
    t_s = np.linspace(0.0, plan.motion.duration_s, 1001)
    path = poses(plan, t_s)
    assert np.abs(path[:, :3] - path[0, :3]).max() < 1e-6
    rates = make_kinematics(robot).task.off_deg(path[1:], path[:-1]) / np.diff(t_s)
    assert rates.max() == pytest.approx(8.0, rel=0.02)


@pytest.mark.slow
def test_a_jog_that_is_refused_names_the_joint() -> None:
    """By the least way: that the end of a long one were out of reach would be no reason."""
    robot = load_robot("ar4-mk3")
    for joints, name, speed, reason in (
        ([0.0] * 6, "y", 20.0, "J4 would move by 90 deg in a millisecond, near the stretched wrist"),
        ([0.0, 0.0, -89.0, 0.0, 0.0, 0.0], "x", -20.0, "J3: -89.03 deg is outside -89..52 deg"),
    ):
        with pytest.raises(InputError) as refused:
            plan_tool_jog(robot, joints, name, speed, StepFrame.TOOL)
        assert reason in str(refused.value)
        assert str(refused.value).startswith(f"the tool's {name} {'-' if speed < 0 else '+'}0.1 mm: ")
