"""DH tables: both conventions as textbooks print them, the papers' rows, and their product beside the closed form."""

import numpy as np
import pytest

from steptwin.host.common.arrays import FloatArray
from steptwin.host.robots.kinematics.dh import Convention, DhParameter, DhRow, DhTable
from tests.host.robots.kinematics.mechanisms import BY_NAME, Mechanism, each_mechanism


def printed_link(convention: Convention, alpha_deg: float, a_mm: float, d_mm: float, theta_deg: float) -> FloatArray:
    """Return a link's matrix as textbooks print it, multiplied out."""
    c, s = np.cos(np.deg2rad(theta_deg)), np.sin(np.deg2rad(theta_deg))
    ca, sa = np.cos(np.deg2rad(alpha_deg)), np.sin(np.deg2rad(alpha_deg))
    standard = [[c, -s * ca, s * sa, a_mm * c], [s, c * ca, -c * sa, a_mm * s], [0, sa, ca, d_mm], [0, 0, 0, 1]]
    modified = [[c, -s, 0, a_mm], [s * ca, c * ca, -sa, -sa * d_mm], [s * sa, c * sa, ca, ca * d_mm], [0, 0, 0, 1]]
    return np.array(standard if convention is Convention.STANDARD else modified)


@pytest.mark.parametrize("convention", Convention)
@pytest.mark.parametrize(
    ("alpha_deg", "a_mm", "d_mm", "theta_deg"), [(30, 200, 50, 70), (-90, 0, -40, 160), (180, 350, 0, -20)]
)
def test_two_links(convention: Convention, alpha_deg: float, a_mm: float, d_mm: float, theta_deg: float) -> None:
    first = DhRow(alpha_deg, a_mm, DhParameter(d_mm), DhParameter(variable="th1"))
    second = DhRow(10.0, 20.0, DhParameter(40.0, "d2", sign=-1), DhParameter(30.0))
    found = DhTable(convention, (first, second)).transforms({"th1": np.array([theta_deg]), "d2": np.array([7.0])})
    links = (alpha_deg, a_mm, d_mm, theta_deg), (10.0, 20.0, 33.0, 30.0)
    expected = np.linalg.multi_dot([printed_link(convention, *link) for link in links])
    assert found == pytest.approx(expected[np.newaxis], abs=1e-12)


def test_a_table_without_variables_has_one_transform() -> None:
    table = DhTable(Convention.STANDARD, (DhRow(0.0, 0.0, DhParameter(300.0), DhParameter()),))
    assert table.transforms({})[:, 2, 3].tolist() == [300.0]


@pytest.mark.parametrize(
    ("parameter", "text"),
    [
        (DhParameter(), "0"),
        (DhParameter(90.0), "90"),
        (DhParameter(variable="th2"), "th2"),
        (DhParameter(variable="d3", sign=-1), "-d3"),
        (DhParameter(90.0, "th1"), "th1 + 90"),
        (DhParameter(-90.0, "th1"), "th1 - 90"),
        (DhParameter(40.0, "d2", sign=-1), "-d2 + 40"),
    ],
)
def test_how_a_parameter_is_printed(parameter: DhParameter, text: str) -> None:
    assert str(parameter) == text


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
