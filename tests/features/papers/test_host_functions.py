"""The classroom paper's host functions: a point for joints, joints for a point, a flag for each arm."""

import numpy as np
import pytest

from steptwin.features.papers.host_functions import forward, inverse
from steptwin.host.robots import load_robot
from tests.host.complaints import complaint_of


def test_forward_and_both_arms() -> None:
    """Golden values of the paper's arm of 95 and 100 mm."""
    ok, (x_mm, y_mm, z_mm, phi_deg) = forward([30.0, 60.0, 20.0, 15.0])
    assert ok
    assert (x_mm, y_mm, z_mm, phi_deg) == pytest.approx((82.272413360, 147.5, -60.0, 105.0))
    right, left = (inverse(x_mm, y_mm, elbow, z_mm, phi_deg) for elbow in ("right", "left"))
    assert right.joints == pytest.approx((30.0, 60.0, 20.0, 15.0))
    assert left.joints == pytest.approx((91.696272694, -60.0, 20.0, 73.303727306))
    assert (right.in_workspace, left.in_workspace, right.reason) == (True, True, None)


def test_a_point_alone_is_at_the_height_of_home() -> None:
    """The paper's goal, with d3 = 0 and the attitude 0; the other arm's th1 is 1.029725762 rad."""
    goal = np.rad2deg([-0.522315, 1.504080, 0.0, -0.981765])
    assert inverse(137.888910092, 35.753580548, "right").joints == pytest.approx(goal, abs=1e-4)
    assert inverse(137.888910092, 35.753580548, "left").joints[0] == pytest.approx(np.rad2deg(1.029725762), abs=1e-6)


def test_the_flags_are_each_arms_own() -> None:
    """At (-150, 60) th1 is beyond its 130 degrees for the left arm only; beyond 195 mm for both."""
    right, left = (inverse(-150.0, 60.0, elbow) for elbow in ("right", "left"))
    assert right.in_workspace
    assert not left.in_workspace
    assert str(left.reason).startswith("th1: ")
    beyond = inverse(195.001, 0.0, "left")
    assert not beyond.in_workspace
    assert np.isnan(beyond.joints[0])
    assert str(beyond.reason).startswith("shoulder to wrist 195.001 mm is outside 5..195 mm")
    assert inverse(195.0, 0.0, "left").in_workspace


def test_another_robot_and_bad_arguments() -> None:
    robot = load_robot("calibration-scara")
    assert inverse(350.0, 250.0, "right", robot=robot).in_workspace
    assert not forward([131.0, 0.0, 0.0, 0.0])[0]
    complaint_of(lambda: inverse(100.0, 0.0, "rigth"))
    complaint_of(lambda: forward([1.0]))
