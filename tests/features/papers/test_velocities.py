"""Joint velocities against finite differences, and at singularities."""

import numpy as np
import pytest

from steptwin.host.common.arrays import FloatArray
from tests.features.papers.mechanisms import (
    HYBRID,
    LAB,
    Mechanism,
    each_mechanism,
    each_scara,
    hybrid_arm,
    singularity_measure,
)

L_MM, H_MM = 350.0, 150.0
"""Length of the hybrid arm's links, and half the distance between its screws."""

STEP_S = 1e-6


@each_mechanism
def test_joint_velocities_are_those_of_finite_differences(mechanism: Mechanism) -> None:
    forward = mechanism.kinematics.forward
    joints = mechanism.random_joints(3000, seed=6)
    joints = joints[singularity_measure(mechanism.kinematics, joints) > 0.1]
    speeds = np.random.default_rng(7).uniform(-50.0, 50.0, joints.shape)
    if mechanism.name == "warehouse-scara":
        speeds[:, :2] = 0.0  # the slides, which the pose does not determine, stand still
    tool = forward(joints + STEP_S * speeds) - forward(joints - STEP_S * speeds)
    tool[:, 3] = (tool[:, 3] + 180.0) % 360.0 - 180.0
    found = mechanism.kinematics.joint_velocities(joints, tool / (2 * STEP_S))
    assert len(joints) > 2000
    assert np.abs(found - speeds).max() < 1e-4


@each_scara
def test_a_stretched_arm_has_no_joint_velocities(mechanism: Mechanism) -> None:
    joints = mechanism.placed(mechanism.scara.elbow, 0.0)
    with np.errstate(all="raise"):  # a singular pose gives no numpy warning
        speeds = mechanism.kinematics.joint_velocities(joints, np.array([[1.0, 0.0, 0.0, 0.0]]))
    assert not np.isfinite(speeds).all()


@each_scara
def test_a_scara_is_singular_by_the_sine_of_its_elbow(mechanism: Mechanism) -> None:
    joints = mechanism.random_joints(1000, seed=8)
    (elbow,) = mechanism.kinematics.singularities(joints)
    assert elbow.values == pytest.approx(np.abs(np.sin(np.deg2rad(joints[:, mechanism.scara.elbow]))), abs=1e-15)
    assert singularity_measure(mechanism.kinematics, joints).tolist() == elbow.values.tolist()


@each_scara
@pytest.mark.parametrize("straight_deg", [0.0, 180.0])
@pytest.mark.parametrize("side", [-1, 1])
def test_a_scara_near_its_singularity(mechanism: Mechanism, straight_deg: float, side: int) -> None:
    """The arc sine of 0.005 is 0.28648 degrees."""
    threshold_deg = np.rad2deg(np.arcsin(0.005))
    for off_deg, kept in ((0.0, False), (threshold_deg - 1e-6, False), (threshold_deg + 1e-6, True)):
        joints = mechanism.placed(mechanism.scara.elbow, straight_deg + side * off_deg)
        (elbow,) = mechanism.kinematics.singularities(joints)
        assert elbow.kept.tolist() == [kept]
        assert elbow.values == pytest.approx([np.sin(np.deg2rad(off_deg))], abs=1e-12)


def level(sine: float) -> FloatArray:
    """Return joints of the hybrid arm whose left link has a slope with this sine."""
    out_mm = L_MM * np.sqrt(1 - sine**2) - H_MM  # the platform, towards the other screw
    return np.array([[10.0, -L_MM * sine, -np.sqrt(L_MM**2 - (out_mm - H_MM) ** 2), 20.0]])


def level_right(sine: float) -> FloatArray:
    """Return the same for the right link."""
    return level(sine)[:, [0, 2, 1, 3]]


def in_line(sine: float) -> FloatArray:
    """Return joints of the hybrid arm whose links have an angle with this sine between them."""
    apart_mm = 2 * L_MM * np.sin((np.pi - np.arcsin(sine)) / 2)
    half_mm = np.sqrt(apart_mm**2 - 4 * H_MM**2) / 2
    return np.array([[10.0, half_mm, -half_mm, 20.0]])


NEAR = [
    (level, "Z5: near singular, |sin| of its link's slope"),
    (level_right, "Z6: near singular, |sin| of its link's slope"),
    (in_line, "Z5: near singular, |sin| of the angle between its link and Z6's"),
]


@pytest.mark.parametrize(("sine", "kept"), [(1e-6, False), (0.005 - 1e-8, False), (0.005 + 1e-8, True), (0.1, True)])
@pytest.mark.parametrize("which", range(3), ids=["left link level", "right link level", "links in line"])
def test_the_hybrid_arm_near_its_singularities(which: int, sine: float, kept: bool) -> None:
    """Near the line, rounding errors of 2e-16 are divided by the sine and become 1e-9."""
    place, quantity = NEAR[which]
    constraints = HYBRID.kinematics.singularities(place(sine))
    assert constraints[which].values == pytest.approx([sine], abs=1e-9)
    assert constraints[which].kept.tolist() == [kept]
    assert constraints[which].quantity == quantity
    assert singularity_measure(HYBRID.kinematics, place(sine)) == pytest.approx([sine], abs=1e-9)


def test_the_complaint_about_a_singularity() -> None:
    (elbow,) = LAB.kinematics.singularities(LAB.placed(2, 0.0))
    assert elbow.complaint(0) == "th3: near singular, |sin th3| 0.00 is outside 0.005..1"
    slope = HYBRID.kinematics.singularities(level(0.001))[0]
    assert slope.complaint(0) == "Z5: near singular, |sin| of its link's slope 0.00 is outside 0.005..1"


def test_the_hybrid_arm_with_its_links_in_line() -> None:
    """The sliders are 2 sqrt(L^2 - h^2) apart; at a larger distance the links do not reach."""
    half_mm = np.sqrt(L_MM**2 - H_MM**2)
    assert in_line(1e-6)[0, 1] == pytest.approx(half_mm)
    assert np.isnan(hybrid_arm().forward(np.array([[0.0, half_mm + 1e-6, -half_mm - 1e-6, 0.0]]))[0, :3]).all()
