"""Run-in and run-out: golden values by hand, where they are missing, and the shortest within accelerations."""

from dataclasses import replace

import numpy as np
import pytest

from steptwin.host.planning.motion import Motion
from steptwin.host.planning.motions.composer import Sequence
from steptwin.host.planning.motions.sampled import hermite_spline
from steptwin.host.planning.trajectory_file.file_motion import shortest_ramps_s, with_ramps
from steptwin.host.robots import load_robot
from steptwin.host.robots.coupling import Coupling
from tests.host.complaints import complaint_of
from tests.laws import law_of

ROBOT = load_robot("teaching-scara")
NAMES = ("a", "b")


def moving(start: tuple[float, float], end: tuple[float, float]) -> Motion:
    """Return a motion of one second with these velocities at its ends."""
    return hermite_spline(NAMES, np.array([0.0, 1.0]), np.array([[0.0, 5.0], [10.0, 6.0]]), np.array([start, end]))


def test_a_ramp_goes_straight_on_at_constant_acceleration() -> None:
    motion = moving((20.0, -4.0), (0.0, 8.0))
    ramped = with_ramps(motion, 0.5)
    assert (ramped.duration_s, ramped.breakpoints_s) == (2.0, (0.5, 1.5))
    t_s = np.array([0.0, 0.25, 0.5, 1.5, 1.75, 2.0])
    assert ramped.velocities(t_s)[:, 0] == pytest.approx([0, 10, 20, 0, 0, 0], abs=1e-12)
    assert ramped.velocities(t_s)[:, 1] == pytest.approx([0, -2, -4, 8, 4, 0], abs=1e-12)
    assert ramped.positions(t_s)[:, 0] == pytest.approx([-5, -3.75, 0, 10, 10, 10], abs=1e-12)
    assert ramped.positions(t_s)[:, 1] == pytest.approx([6, 5.75, 5, 6, 7.5, 8], abs=1e-12)
    own_s = np.linspace(0.0, 1.0, 101)
    assert np.allclose(ramped.positions(own_s + 0.5), motion.positions(own_s), atol=1e-12)


def test_an_end_at_rest_gets_none() -> None:
    assert law_of(with_ramps(moving((0.0, 0.0), (1.0, 0.0)), 0.25), Sequence).starts_ms == (0, 1000, 1250)
    assert law_of(with_ramps(moving((0.0, 1e-6), (0.0, 1e-10)), 0.25), Sequence).starts_ms == (0, 250, 1250)


@pytest.mark.parametrize(
    ("ramps_s", "end"),
    [
        (0.5, 0.0),
        (-1.0, 9.0),
        (0.0, 9.0),
        (0.0005, 9.0),
    ],
)
def test_refused(ramps_s: float, end: float) -> None:
    complaint_of(lambda: with_ramps(moving((0.0, 0.0), (end, 0.0)), ramps_s))


def test_the_shortest_within_the_limits_of_joints_and_axes() -> None:
    """th1 of the classroom robot has 1000 deg/s^2; an axis that turns with it in full adds up both speeds."""
    velocities = np.array([[200.5, 150.0, 0.0, 0.0], [0.0, 0.0, 0.0, 0.0]])
    motion = hermite_spline(ROBOT.joint_names, np.array([0.0, 1.0]), np.full((2, 4), 20.0), velocities)
    assert shortest_ramps_s(ROBOT, motion) == 0.201
    assert shortest_ramps_s(ROBOT, motion, 2.0) == 0.051
    coupled = replace(ROBOT, coupling=Coupling.of(ROBOT.joint_names, {"th2": {"th1": 1.0}}))
    summed_s = 350.5 / coupled.axis_accelerations_max[1]
    assert shortest_ramps_s(coupled, motion) == np.ceil(1000 * max(summed_s, 0.2005)) / 1000
    at_rest = hermite_spline(ROBOT.joint_names, np.array([0.0, 1.0]), np.full((2, 4), 20.0), np.zeros((2, 4)))
    assert shortest_ramps_s(ROBOT, at_rest) == 0.0
