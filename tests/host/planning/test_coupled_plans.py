"""Plans of coupled joints: limits of joints in their own positions, limits of motors in the axes'."""

import numpy as np
import pytest

from steptwin.host.common.errors import InputError
from steptwin.host.planning.laws import Trapezoid
from steptwin.host.planning.motion import Motion
from steptwin.host.planning.motions.joint_move import joint_move, limits_along
from steptwin.host.planning.peaks import Quantity
from steptwin.host.planning.planner import plan, plan_stretched
from steptwin.host.robots.robot import Robot
from tests.host.robots.coupled import DIRECT, TWO_TO_ONE, UNITS_PER_DEG, coupled_robot
from tests.messages import refusing


def arm_move(robot: Robot, th1: float, th2: float, law: Trapezoid) -> Motion:
    return joint_move(robot.joint_names, robot.home, (th1, th2, 0.0, 0.0), law)


@pytest.mark.parametrize(("coupling", "elbow_axis_deg"), [(DIRECT, 50.0), (TWO_TO_ONE, 80.0)])
def test_points_are_axis_positions(coupling: str, elbow_axis_deg: float) -> None:
    robot = coupled_robot(coupling)
    made = plan(robot, arm_move(robot, 30.0, 20.0, Trapezoid(1.0, 2.0, 0.5)))
    ends = [30 * UNITS_PER_DEG, elbow_axis_deg * UNITS_PER_DEG, 0, 0]
    assert made.points_units[-1] == pytest.approx(ends, abs=0.5)
    assert made.points_units[:, 1] == pytest.approx(made.points_units[:, 0] * elbow_axis_deg / 30, abs=2)
    assert made.velocities[:, 1] == pytest.approx(made.velocities[:, 0] * elbow_axis_deg / 30, abs=3)
    assert [peak.joint for peak in made.peaks if peak.quantity is Quantity.AXIS_SPEED] == ["th2"]


def test_an_elbow_that_counters_the_shoulder_has_a_motor_at_rest() -> None:
    robot = coupled_robot()
    made = plan(robot, arm_move(robot, 60.0, -60.0, Trapezoid(1.0, 1.0, 0.2)))
    assert not made.points_units[:, 1].any()


def test_the_motor_turns_faster_than_either_joint() -> None:
    """60 deg by ramps of 0.15 s and 0.35 s between are 120 deg/s at each joint, 240 deg/s at the elbow's motor."""
    law, both = Trapezoid(1.0, 0.65, 0.15), (60.0, 60.0)
    robot = coupled_robot()
    complaint = r"^th2: an axis speed of 240.0 deg/s at t = 0.\d+ s is more than 180.0 deg/s; 1.333 times slower passes"
    with pytest.raises(InputError, match=complaint):
        plan(robot, arm_move(robot, *both, law))
    stretched = plan_stretched(robot, arm_move(robot, *both, law), 1.333)
    assert stretched.motion.duration_s == pytest.approx(0.867, abs=1e-3)
    weak = coupled_robot(axis_speed_max="240.1", axis_acceleration_max="1599.0")
    with refusing(InputError):
        plan(weak, arm_move(weak, *both, law))
    strong = coupled_robot(axis_speed_max="240.1", axis_acceleration_max="1601.0")
    plan(strong, arm_move(strong, *both, law))


def test_limits_of_position_are_the_joints() -> None:
    """The elbow's axis may go to 280 deg, but the joint only to 150."""
    robot, law = coupled_robot(), Trapezoid(1.0, 9.0, 2.0)
    assert plan(robot, arm_move(robot, 130.0, 150.0, law)).points_units[-1, 1] == pytest.approx(280 * UNITS_PER_DEG)
    with refusing(InputError):
        plan(robot, arm_move(robot, -130.0, 151.0, law))


def test_limits_along_a_way() -> None:
    robot = coupled_robot(TWO_TO_ONE)
    assert limits_along(robot, np.array([1.0, 0.0, 0.0, 0.0])) == pytest.approx((90.0, 500.0))
    assert limits_along(robot, np.array([0.0, 1.0, 0.0, 0.0])) == pytest.approx((180.0, 1000.0))
    assert limits_along(robot, np.array([1.0, -2.0, 0.0, 0.0])) == pytest.approx((90.0, 500.0))
    assert limits_along(robot, np.array([1.0, -1.0, 0.0, 0.0])) == pytest.approx((180.0, 1000.0))


def test_the_start_is_compared_in_steps_of_the_axes() -> None:
    """Half a step is 0.014 deg; the elbow's axis is off by the sum of both joints."""
    robot = coupled_robot()
    made = plan(robot, arm_move(robot, 30.0, 20.0, Trapezoid(1.0, 2.0, 0.5)))
    made.check_start([0.008, -0.008, 0.0, 0.0])
    with refusing(InputError):
        made.check_start([0.008, 0.008, 0.0, 0.0])
