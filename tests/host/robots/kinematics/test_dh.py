"""DH tables: both conventions as textbooks print them."""

import numpy as np
import pytest

from steptwin.host.common.arrays import FloatArray
from steptwin.host.robots.kinematics.dh import Convention, DhParameter, DhRow, DhTable


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
