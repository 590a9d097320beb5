"""The five robots built a second time, from the papers' numbers, with Corke's Robotics Toolbox for Python."""

from collections.abc import Callable
from typing import Any, Final

import numpy as np
import pytest

from steptwin.host.common.arrays import FloatArray
from tests.features.papers.mechanisms import (
    CALIBRATION,
    HYBRID,
    LAB,
    TEACHING,
    WAREHOUSE,
    Mechanism,
    singularity_measure,
)

rtb = pytest.importorskip("roboticstoolbox", reason="roboticstoolbox-python is not installed: nothing to compare with")
sm = pytest.importorskip("spatialmath", reason="spatialmath-python is not installed: nothing to compare with")

HALF_TURN, QUARTER_TURN = np.pi, np.pi / 2


def lab() -> Any:
    """Modified DH; the tool, 150 mm along its own z, points down."""
    return rtb.DHRobot(
        [
            rtb.PrismaticMDH(alpha=0, a=0, theta=QUARTER_TURN, qlim=[0, 250]),
            rtb.RevoluteMDH(alpha=0, a=0, d=0),
            rtb.RevoluteMDH(alpha=0, a=400, d=0),
            rtb.RevoluteMDH(alpha=HALF_TURN, a=400, d=0),
        ],
        tool=sm.SE3.Tz(150),
    )


def warehouse() -> Any:
    """Modified DH, without the slides; the paper's first row has two variables, L1 and th1."""
    return rtb.DHRobot(
        [
            rtb.PrismaticMDH(alpha=0, a=0, theta=0, qlim=[50, 200]),
            rtb.RevoluteMDH(alpha=0, a=0, d=0),
            rtb.RevoluteMDH(alpha=0, a=200, d=0),
            rtb.RevoluteMDH(alpha=0, a=150, d=0),
        ],
        tool=sm.SE3(40, 0, -40),
    )


def teaching() -> Any:
    """Modified DH; the third variable lifts, as in the paper's program."""
    return rtb.DHRobot(
        [
            rtb.RevoluteMDH(alpha=0, a=0, d=0),
            rtb.RevoluteMDH(alpha=0, a=95, d=0),
            rtb.PrismaticMDH(alpha=0, a=100, theta=0, qlim=[-60, 0]),
            rtb.RevoluteMDH(alpha=0, a=0, d=-40),
        ]
    )


def calibration() -> Any:
    """Standard DH; the third variable lifts."""
    return rtb.DHRobot(
        [
            rtb.RevoluteDH(alpha=0, a=250, d=300),
            rtb.RevoluteDH(alpha=0, a=350, d=0),
            rtb.PrismaticDH(alpha=HALF_TURN, a=0, theta=0, qlim=[-200, 0]),
            rtb.RevoluteDH(alpha=0, a=0, d=0),
        ]
    )


def hybrid() -> Any:
    """The equivalent serial chain R-P-P-R in modified DH; z2 and z3 are variables."""
    return rtb.DHRobot(
        [
            rtb.RevoluteMDH(alpha=0, a=0, d=400, offset=QUARTER_TURN),
            rtb.PrismaticMDH(alpha=QUARTER_TURN, a=0, theta=0, offset=100, qlim=[-150, 150]),
            rtb.PrismaticMDH(alpha=-QUARTER_TURN, a=0, theta=-QUARTER_TURN, qlim=[-200, 700]),
            rtb.RevoluteMDH(alpha=0, a=300, d=-120),
        ]
    )


ROTARY: Final = {
    "lab-scara": (1, 2, 3),
    "warehouse-scara": (1, 2, 3),
    "teaching-scara": (0, 1, 3),
    "calibration-scara": (0, 1, 3),
    "hybrid-arm": (0, 3),
}
"""Columns of the angles among the four variables of each model."""

each_model = pytest.mark.parametrize(
    ("mechanism", "build"),
    [
        pytest.param(mechanism, build, id=mechanism.name)
        for mechanism, build in (
            (LAB, lab),
            (WAREHOUSE, warehouse),
            (TEACHING, teaching),
            (CALIBRATION, calibration),
            (HYBRID, hybrid),
        )
    ],
)


def model_variables(mechanism: Mechanism, joints: FloatArray) -> FloatArray:
    """Return the variables of the toolbox's model for our joints, of shape (n, 4), in mm and radians."""
    variables = joints[:, -4:].copy()
    if mechanism in (TEACHING, CALIBRATION):
        variables[:, 2] *= -1.0
    if mechanism is HYBRID:
        platform = mechanism.kinematics.dh_variables(joints)
        variables[:, 1:3] = np.column_stack([platform["z2"], platform["z3"]])
    rotary = list(ROTARY[mechanism.name])
    variables[:, rotary] = np.deg2rad(variables[:, rotary])
    return variables


def slid_mm(mechanism: Mechanism, joints: FloatArray) -> FloatArray:
    """Return the shift of the arm by its slides, of shape (n, 3)."""
    zero = np.zeros(len(joints))
    slides = (joints[:, 0], zero, joints[:, 1]) if mechanism is WAREHOUSE else (zero, zero, zero)
    return np.column_stack(slides)


def attitudes(mechanism: Mechanism, poses: FloatArray) -> list[FloatArray]:
    """Return Rz(phi), or Rz(psi) Rx(180), made by the toolbox."""
    tool = sm.SE3.Rx(HALF_TURN if mechanism.tool_down else 0.0)
    return [(sm.SE3.Rz(np.deg2rad(attitude_deg)) * tool).R for attitude_deg in poses[:, 3]]


@each_model
def test_forward(mechanism: Mechanism, build: Callable[[], Any]) -> None:
    joints = mechanism.random_joints(200, seed=11)
    poses = mechanism.kinematics.forward(joints)
    transforms = build().fkine(model_variables(mechanism, joints)).A
    for transform, pose, slid, attitude in zip(
        transforms, poses, slid_mm(mechanism, joints), attitudes(mechanism, poses), strict=True
    ):
        assert np.abs(transform[:3, 3] + slid - pose[:3]).max() < 1e-9
        assert np.abs(transform[:3, :3] - attitude).max() < 1e-9


@each_model
def test_its_numerical_inverse_lands_on_one_of_our_branches(mechanism: Mechanism, build: Callable[[], Any]) -> None:
    """Levenberg-Marquardt with little damping: lengths are in mm."""
    joints = mechanism.random_joints(40, seed=12)
    joints = joints[singularity_measure(mechanism.kinematics, joints) > 0.1][:20]
    poses = mechanism.kinematics.forward(joints)
    branches = mechanism.kinematics.inverse(poses, joints)
    ours = [model_variables(mechanism, branch.joints) for branch in branches]
    goals = zip(poses[:, :3] - slid_mm(mechanism, joints), attitudes(mechanism, poses), strict=True)
    for i, (position_mm, attitude) in enumerate(goals):
        found = build().ikine_LM(
            sm.SE3.Rt(attitude, position_mm), mask=[1, 1, 1, 0, 0, 1], method="wampler", k=1e-4, tol=1e-16, seed=1
        )
        assert found.success
        assert min(variables_apart(mechanism, found.q, variables[i]) for variables in ours) < 1e-6


def variables_apart(mechanism: Mechanism, found: FloatArray, expected: FloatArray) -> float:
    """Return the largest difference, in mm and radians, without full turns."""
    apart = found - expected
    rotary = list(ROTARY[mechanism.name])
    apart[rotary] = (apart[rotary] + np.pi) % (2 * np.pi) - np.pi
    return float(np.abs(apart).max())
