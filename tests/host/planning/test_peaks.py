"""Peaks: each against the closed form of a law of time."""

from math import isclose

import numpy as np

from steptwin.host.planning.laws import Trapezoid
from steptwin.host.planning.motions.joint_move import joint_move
from steptwin.host.planning.peaks import Peak, Quantity
from steptwin.host.planning.planner import plan
from steptwin.host.robots import load_robot

ROBOT = load_robot("warehouse-scara")


def peak_of(peaks: tuple[Peak, ...], joint: str, quantity: Quantity) -> Peak:
    return next(peak for peak in peaks if (peak.joint, peak.quantity) == (joint, quantity))


def test_a_trapezoid_peaks_at_its_own_speed_acceleration_and_step_rate() -> None:
    goal = np.array(ROBOT.home)
    goal[3] += 18.0
    law = Trapezoid(1.0, 1.1, 0.2)  # 18 deg: 20 deg/s reached in 0.2 s, so 100 deg/s^2
    peaks = plan(ROBOT, joint_move(ROBOT.joint_names, ROBOT.home, tuple(goal.tolist()), law)).peaks
    joint = ROBOT.joint("th1")
    speed, acceleration, rate = (
        peak_of(peaks, "th1", quantity) for quantity in (Quantity.SPEED, Quantity.ACCELERATION, Quantity.STEP_RATE)
    )
    assert isclose(speed.value, 20.0, rel_tol=1e-9)
    assert isclose(acceleration.value, 100.0, rel_tol=1e-6)
    assert isclose(rate.value, 20.0 * joint.transmission.steps_per_unit, rel_tol=1e-3)
    assert isclose(speed.percent, 100 * 20.0 / joint.speed_max, rel_tol=1e-9)
    assert isclose(acceleration.percent, 100 * 100.0 / joint.acceleration_max, rel_tol=1e-6)
    assert 0.0 <= acceleration.t_s < 0.2 or 0.9 <= acceleration.t_s < 1.1
    assert all(peak.value == 0.0 for peak in peaks if peak.joint != "th1")


def test_only_rounding_errors_may_exceed_a_limit_and_none_of_a_step_rate() -> None:
    for quantity, factor, exceeded in (
        (Quantity.SPEED, 1 + 1e-10, False),
        (Quantity.SPEED, 1 + 1e-8, True),
        (Quantity.STEP_RATE, 1.0, False),
        (Quantity.STEP_RATE, 1 + 1e-10, True),
    ):
        assert Peak(quantity, "th1", 15_000.0 * factor, 15_000.0, "Hz", 0.0).exceeded is exceeded
