"""The papers' DH tables: their rows, and their product beside the closed form."""

import numpy as np
import pytest

from steptwin.host.common.arrays import FloatArray
from steptwin.host.robots.kinematics.dh import Convention
from tests.features.papers.mechanisms import BY_NAME, Mechanism, each_mechanism

PAPERS = {
    "lab-scara": (
        Convention.MODIFIED,
        ["0, 0, d1, 90", "0, 0, 0, th2", "0, 400, 0, th3", "180, 400, 0, th4", "0, 0, 150, 0"],
    ),
    "warehouse-scara": (
        Convention.MODIFIED,
        ["0, 0, sz, 90", "90, 0, sx, 0", "-90, 0, L1, th1 - 90", "0, 200, 0, th2", "0, 150, 0, th3", "0, 40, -40, 0"],
    ),
    "teaching-scara": (
        Convention.MODIFIED,
        ["0, 0, 0, th1", "0, 95, 0, th2", "0, 100, -d3, 0", "0, 0, -40, th4"],
    ),
    "calibration-scara": (
        Convention.STANDARD,
        ["0, 250, 300, th1", "0, 350, 0, th2", "180, 0, -d3, 0", "0, 0, 0, th4"],
    ),
    "calibration-scara-up": (
        Convention.STANDARD,
        ["0, 250, 300, th1", "0, 350, 0, th2", "0, 0, -d3, 0", "0, 0, 0, th4"],
    ),
    "hybrid-arm": (
        Convention.MODIFIED,
        ["0, 0, 400, th1 + 90", "90, 0, z2 + 100, 0", "-90, 0, z3, -90", "0, 300, -120, th4"],
    ),
}
"""Rows of alpha, a, d, theta. No paper gives the warehouse robot's slides, whose rows come before the arm's."""


@pytest.mark.parametrize("name", PAPERS)
def test_the_tables_are_the_papers(name: str) -> None:
    convention, rows = PAPERS[name]
    table = BY_NAME[name].kinematics.dh
    assert table.convention is convention
    assert [f"{row.alpha_deg:g}, {row.a_mm:g}, {row.d_mm}, {row.theta_deg}" for row in table.rows] == rows


def attitude_matrices(attitude_deg: FloatArray, tool_down: bool) -> FloatArray:
    """Rz(phi), or Rz(psi) Rx(180)."""
    c, s = np.cos(np.deg2rad(attitude_deg)), np.sin(np.deg2rad(attitude_deg))
    zero, up = np.zeros_like(c), np.full_like(c, -1.0 if tool_down else 1.0)
    return np.moveaxis(np.array([[c, -s * up, zero], [s, c * up, zero], [zero, zero, up]]), 2, 0)


@each_mechanism
def test_the_product_is_the_closed_form(mechanism: Mechanism) -> None:
    joints = mechanism.random_joints(2000, seed=3)
    poses = mechanism.kinematics.forward(joints)
    transforms = mechanism.kinematics.dh.transforms(mechanism.kinematics.dh_variables(joints))
    assert np.abs(transforms[:, :3, 3] - poses[:, :3]).max() < 1e-9
    assert np.abs(transforms[:, :3, :3] - attitude_matrices(poses[:, 3], mechanism.tool_down)).max() < 1e-9
    assert transforms[:, 3].tolist() == [[0.0, 0.0, 0.0, 1.0]] * 2000
