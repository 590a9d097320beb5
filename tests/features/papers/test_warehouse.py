"""The warehouse robot's paper: A. Jiang and others, 2019."""

from functools import cache
from math import acos, cos, degrees, hypot, nan, radians, sin, sqrt
from typing import Any

import numpy as np
import pytest

from docs.generate.runs import Runs
from steptwin.controller.motion.backend import Kernel
from steptwin.host.common.arrays import FloatArray
from steptwin.host.planning.jobs import make_job
from steptwin.host.planning.laws import Trapezoid
from tests.features.papers.numbers import Arm, Misprint, Number, check_misprint, check_number, numbers_of_page

ARM = Arm("warehouse-scara")
JOB = make_job(ARM.robot, "pull-line", {})
T_S = np.linspace(0.0, 10.0, 1001)
LAW = Trapezoid(180.0, 10.0, 2.0)
SPEED_MM_S = 180.0 / 8.0
X_MM, Y_MM = 275.0, 150.0 * sin(radians(60)) + 40.0
"""The tool at the start, by eq. 1."""


@cache
def joints() -> FloatArray:
    return JOB.positions(T_S)


@cache
def poses() -> FloatArray:
    return ARM.kinematics.forward(joints())


def peak_deg_s(name: str) -> float:
    axis = ARM.robot.joint_names.index(name)
    return float(np.abs(np.diff(joints()[:, axis])).max() / 0.01)


def out_s(mm: float) -> float:
    return float(np.interp(mm, poses()[0, 1] - poses()[:, 1], T_S))


def change(column: int) -> float:
    return float(np.ptp(poses()[:, column]))


def swept_mm(until_s: float) -> float:
    """Return the area under the trapezoid of the speed up to an instant."""
    t_s = np.linspace(0.0, until_s, 200_001)
    return SPEED_MM_S * float(np.trapezoid(np.interp(t_s, (0.0, 2.0, 8.0, 10.0), (0.0, 1.0, 1.0, 0.0)), t_s))


def printed_inverse_off_mm() -> float:
    """Return how far eq. 2, whose arc cosine loses the sign of y, puts the tool off at the end."""
    alpha_deg = degrees(np.arctan2(poses()[-1, 1] - 40.0, X_MM))
    wrong = joints()[-1].copy()
    wrong[3] += abs(alpha_deg) - alpha_deg
    wrong[5] = 90.0 - wrong[3] - wrong[4]
    return float(np.linalg.norm((ARM.pose(wrong) - poses()[-1])[:3]))


def cos_beta(second_mm: float) -> float:
    square = X_MM**2 + (second_mm - 40.0) ** 2
    return (square + 200.0**2 - 150.0**2) / (2 * 200.0 * sqrt(square))


def true_cos_beta() -> float:
    """Return the cosine of the angle between the first link and the wrist."""
    (x_mm, y_mm), th1 = poses()[0, :2].tolist(), radians(joints()[0, 3])
    return float(cos(th1) * x_mm + sin(th1) * (y_mm - 40.0)) / hypot(x_mm, y_mm - 40.0)


NUMBERS = [
    Number("joints of the arm, with its lift", 4, lambda: len(ARM.robot.joints) - 2),
    Number("L2", 200.0, lambda: ARM.mm("L2_mm")),
    Number("L3", 150.0, lambda: ARM.mm("L3_mm")),
    Number("L4", 40.0, lambda: ARM.mm("L4_mm")),
    Number("L1, least", 50.0, lambda: ARM.joint["L1"].lower),
    Number("L1, greatest", 200.0, lambda: ARM.joint["L1"].upper),
    Number("P_x of eq. 1", X_MM, lambda: poses()[0, 0], 1e-9),
    Number("P_y of eq. 1", 169.9038105676658, lambda: poses()[0, 1], 1e-9),
    Number("P_z = L1 - L4", 60.0, lambda: poses()[0, 2], 1e-9),
    Number("time at which the wrist crosses y = 0", 6.7735026919,
           lambda: float(np.interp(0.0, 40.0 - poses()[:, 1], T_S))),
    Number("T", 10.0, lambda: JOB.duration_s),
    Number("way of the drawer", 180.0, lambda: change(1)),
    Number("points", 1000, lambda: len(joints()) - 1),
    Number("way after T by the law", 180.0, lambda: float(LAW.position(np.array([10.0]))[0])),
    Number("speed between the ramps", 22.5, lambda: float(LAW.velocity(np.array([5.0]))[0])),
    Number("th1 at the start", 0.0, lambda: joints()[0, 3], 1e-9),
    Number("th2 at the start", 60.0, lambda: joints()[0, 4], 1e-9),
    Number("th3 at the start", 30.0, lambda: joints()[0, 5], 1e-9),
    Number("peak speed of th1", 6.08899313245, lambda: peak_deg_s("th1")),
    Number("peak speed of th2", 5.05641870078, lambda: peak_deg_s("th2")),
    Number("peak speed of th3", 5.38752282797, lambda: peak_deg_s("th3")),
    Number("pulses of th1 in the samples", 1846, lambda: ARM.pulses(joints(), "th1")),
    Number("pulses of th2 in the samples", 880, lambda: ARM.pulses(joints(), "th2")),
    Number("pulses of th3 in the samples", 710, lambda: ARM.pulses(joints(), "th3")),
    Number("tool off with joints in whole steps, max", 0.0896218556474, lambda: ARM.stepped_off_mm(joints())),
    Number("y at the start", 170.0, lambda: poses()[0, 1], 0.5),
    Number("y at the end", -10.0, lambda: poses()[-1, 1], 0.5),
    Number("way along y", 180.0, lambda: change(1), 1e-9),
    Number("x, largest change", 0.0, lambda: change(0), 1e-9),
    Number("phi, largest change", 0.0, lambda: change(3), 1e-9),
    Number("first cell out", 3.66666666667, lambda: out_s(60.0)),
    Number("second cell out", 6.33333333333, lambda: out_s(120.0)),
    Number("third cell out", 10.0, lambda: out_s(180.0)),
]  # fmt: skip

OF_THE_RUN = {"drawer out at the end, by the emulated shelf", "cells out at the end, by the emulated shelf"}

MISPRINTS = [
    Misprint("eq. 2, cos alpha and cos beta, three places", cos_beta(X_MM), cos_beta(Y_MM), true_cos_beta),
    Misprint("eq. 2, cos alpha and cos beta, three places", nan, degrees(acos(cos_beta(Y_MM))),
             lambda: degrees(acos(true_cos_beta()))),
    Misprint("eq. 2, alpha by its cosine", printed_inverse_off_mm(),
             hypot(poses()[-1, 0] - X_MM, poses()[-1, 1] - (Y_MM - 180.0)), lambda: 0.0),
    Misprint("eq. 3, first branch", SPEED_MM_S * 2.0, SPEED_MM_S, lambda: swept_mm(2.0)),
    Misprint("eq. 3, third branch", SPEED_MM_S * 9.0, 180.0, lambda: swept_mm(10.0)),
    Misprint("eq. 3, third branch", SPEED_MM_S * 8.0, 180.0 - SPEED_MM_S / 4, lambda: swept_mm(9.0)),
    Misprint("sect. 2.4, 1 000 points", 1000 * 0.001, 1000 * 0.01, lambda: JOB.duration_s),
    Misprint("sect. 2.4, S_x = 0 and S_y = 180", Y_MM + 180.0, Y_MM - 180.0, lambda: -10.0, 0.5),
    Misprint("sect. 2.4, attitude n phi / 1000", 500 * 90.0 / 1000, 90.0, lambda: poses()[500, 3]),
]  # fmt: skip


@pytest.mark.parametrize("number", NUMBERS, ids=lambda number: number.item)
def test_number(number: Number) -> None:
    check_number(ARM.name, number)


@pytest.mark.parametrize("misprint", MISPRINTS, ids=lambda misprint: misprint.place)
def test_misprint(misprint: Misprint) -> None:
    check_misprint(ARM.name, misprint)


@pytest.mark.slow
def test_the_drawer_and_its_cells(fast_kernel: Kernel) -> None:
    shelf: Any = Runs(fast_kernel).outcome(ARM.name, "drawer-pull").comparison.evidence.features["shelf"]
    drawer, cells = sorted(OF_THE_RUN, reverse=True)
    check_number(ARM.name, Number(drawer, 180.0, lambda: sum(shelf.open_mm.values()), 0.1))
    check_number(ARM.name, Number(cells, 3, lambda: sum(shelf.cells_out.values())))


def test_every_number_of_the_page_is_here() -> None:
    assert numbers_of_page(ARM.name) <= {number.item for number in NUMBERS} | OF_THE_RUN
