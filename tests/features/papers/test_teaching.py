"""The classroom robot's paper: X. Yao and others, 2017."""

from functools import cache, partial
from math import asin, cos, degrees, radians, sin

import numpy as np
import pytest

from steptwin.controller.motion.backend import Kernel
from steptwin.features.papers.carry import GOAL_RAD, START_RAD
from steptwin.host.common.arrays import FloatArray
from steptwin.host.planning.jobs import job_extras, make_job
from steptwin.host.planning.laws import Cubic, Law, Quintic
from steptwin.host.planning.motions.joint_move import JointMove
from steptwin.host.planning.planner import plan
from steptwin.host.twin.embedded.execution import execute
from tests.features.papers.numbers import Arm, Misprint, Number, check_misprint, check_number, numbers_of_page

ARM = Arm("teaching-scara")
AT = (30.0, 60.0, 20.0, 15.0)
ENDS_S = np.array([0.0, 1.0])
QA_DEG, QB_DEG = (tuple(map(degrees, point)) for point in (START_RAD, GOAL_RAD))
TH1, TH2, _, _ = GOAL_RAD
RATIO = -sin(TH1) / sin(TH1 + TH2)
"""l2 / l1 of an arm whose tool is at y = 0 in qb."""


def motion(law: Law) -> JointMove:
    return JointMove(QA_DEG, QB_DEG, law)


CUBIC, QUINTIC = motion(Cubic(1.0, 1.0)), motion(Quintic(1.0, 1.0))


@cache
def joints() -> FloatArray:
    """Return the joints at 0:0.015:1, and at the end."""
    return CUBIC.positions(np.append(0.015 * np.arange(67), 1.0))


def peak(law: JointMove) -> float:
    return float(np.abs(law.velocities(np.linspace(0.0, 1.0, 1001))[:, 1]).max())


def at_the_ends(law: JointMove, derivative: str) -> float:
    return float(np.abs(getattr(law, derivative)(ENDS_S)).max())


def goal_rad(axis: int) -> float:
    return radians(CUBIC.positions(ENDS_S)[1, axis])


def inverse(axis: int) -> float:
    return float(ARM.kinematics.solve(ARM.pose(AT)[np.newaxis], "right").joints[0, axis])


NUMBERS = [
    Number("l1", 95.0, lambda: ARM.mm("l1_mm")),
    Number("l2", 100.0, lambda: ARM.mm("l2_mm")),
    Number("d4", -40.0, lambda: ARM.mm("d4_mm")),
    Number("p_x = l1 cos th1 + l2 cos(th1 + th2)", 82.272413, lambda: ARM.pose(AT)[0]),
    Number("p_y = l1 sin th1 + l2 sin(th1 + th2)", 147.5, lambda: ARM.pose(AT)[1]),
    Number("p_z = d4 - d3", -60.0, lambda: ARM.pose(AT)[2]),
    *(Number(f"{name} of the inverse of the forward kinematics", AT[axis], partial(inverse, axis), 1e-9)
      for axis, name in enumerate(("th1", "th2", "d3", "th4"))),
    Number("speed at both ends, cubic", 0.0, lambda: at_the_ends(CUBIC, "velocities"), 1e-9),
    Number("th1 at the end of the motion", -0.522315, lambda: goal_rad(0), 1e-9),
    Number("th2 at the end of the motion", 1.504080, lambda: goal_rad(1), 1e-9),
    Number("th4 at the end of the motion", -0.981765, lambda: goal_rad(3), 1e-9),
    Number("th1 + th2 + th4 at qa", 0.0, lambda: sum(START_RAD), 1.5e-6),
    Number("th1 + th2 + th4 at qb", 0.0, lambda: sum(GOAL_RAD), 1.5e-6),
    Number("l2 / l1 of an arm that has qb at y = 0", 0.600000328684, lambda: RATIO),
    Number("x at qb of that arm, in parts of the stretched arm", 0.750000015677,
           lambda: (cos(TH1) + RATIO * cos(TH1 + TH2)) / (1 + RATIO)),
    Number("x at qb with 95 and 100 mm", 137.888910092, lambda: ARM.pose(QB_DEG)[0]),
    Number("y at qb with 95 and 100 mm", 35.7535805479, lambda: ARM.pose(QB_DEG)[1]),
    Number("det J at qa", 1.69099999107, lambda: ARM.mm("l1_mm") * ARM.mm("l2_mm") * sin(START_RAD[1])),
    Number("peak speed of th2, cubic", 129.250856102, lambda: peak(CUBIC)),
    Number("peak speed of th2, quintic", 161.563570127, lambda: peak(QUINTIC)),
    Number("peak speed of th2, `jtraj` in the 0.99 s of its samples", 163.195525381, lambda: peak(QUINTIC) / 0.99),
    Number("largest acceleration at an end, cubic", 517.003424408, lambda: at_the_ends(CUBIC, "accelerations")),
    Number("pulses of th1 in the samples", 1064, lambda: ARM.pulses(joints(), "th1")),
    Number("pulses of th2 in the samples", 3064, lambda: ARM.pulses(joints(), "th2")),
    Number("pulses of th4 in the samples", 1000, lambda: ARM.pulses(joints(), "th4")),
    Number("tool off with joints in whole steps, max", 0.0516425713041, lambda: ARM.stepped_off_mm(joints())),
    Number("largest acceleration at an end in the test, law quintic", 0.0,
           lambda: at_the_ends(QUINTIC, "accelerations"), 1e-9),
    Number("largest speed at an end in the test, law quintic", 0.0, lambda: at_the_ends(QUINTIC, "velocities"), 1e-9),
]  # fmt: skip

FIRST, SECOND = sin(radians(60)) * cos(radians(15)), cos(radians(60)) * sin(radians(15))
MISPRINTS = [
    Misprint("eq. 14", 60.0, 60.0 - 40.0, lambda: inverse(2)),
    Misprint("eq. 16", FIRST - SECOND, FIRST + SECOND, lambda: sin(radians(ARM.pose(AT)[3] - AT[0]))),
    Misprint("sect. 3, t = [0:0.015:1]", joints()[66, 1], joints()[67, 1], lambda: QB_DEG[1]),
]


@pytest.mark.parametrize("number", NUMBERS, ids=lambda number: number.item)
def test_number(number: Number) -> None:
    check_number(ARM.name, number)


@pytest.mark.parametrize("misprint", MISPRINTS, ids=lambda misprint: misprint.place)
def test_misprint(misprint: Misprint) -> None:
    check_misprint(ARM.name, misprint)


def test_the_points_are_of_an_arm_of_5_and_3() -> None:
    assert asin(3 * sin(TH1 + TH2) / 5) == pytest.approx(-TH1, abs=1e-6)


@pytest.mark.slow
def test_the_test_of_the_real_arm(fast_kernel: Kernel) -> None:
    """Sect. 4.2: the quintic carries a part from qa to qb."""
    options = {"law": "quintic", "depth_mm": "20"}
    made = plan(ARM.robot, make_job(ARM.robot, "carry", options))
    outcome = execute(made, "carry", fast_kernel, extras=job_extras(ARM.robot, "carry", options))
    assert outcome.passed
    events = [(event.what, event.where) for event in outcome.comparison.evidence.features["shelf"].events]
    assert (events.count(("box taken", "qa")), events.count(("box put down", "qb"))) == (1, 1)
    check_number(ARM.name, Number("duration of the test", 5.3, lambda: outcome.report.run.duration_s))


def test_every_number_of_the_page_is_here() -> None:
    assert numbers_of_page(ARM.name) <= {number.item for number in NUMBERS}
