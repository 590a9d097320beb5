"""The hybrid arm's paper: H. Zhou; h 150, L 350, l1 400, l2 100, l3 300, l4 120 mm are assumed."""

from functools import cache
from math import hypot, sqrt

import numpy as np
import pytest

from steptwin.features.papers.hybrid_arm import HybridArm
from steptwin.features.papers.hybrid_jobs import OPERATING_MODE, HelixOptions, five_poses, helix_poses
from steptwin.host.common.arrays import FloatArray
from steptwin.host.planning.jobs import make_job
from steptwin.host.planning.motion import Motion
from steptwin.host.robots.workspace import monte_carlo
from tests.features.papers.loop_closure import LoopClosure
from tests.features.papers.numbers import Arm, Number, check_number, numbers_of_page

ARM = Arm("hybrid-arm")
HYBRID = HybridArm.of(ARM.robot)
LOOP = LoopClosure.of(ARM.robot)
POINTS = five_poses(ARM.robot)
T_S = np.linspace(0.0, 80.0, 241)


def helix_at(t_s: FloatArray) -> FloatArray:
    return helix_poses(t_s / 80.0, HelixOptions())


@cache
def joints() -> FloatArray:
    """Return the joints at the samples of the helix."""
    return HYBRID.solve(helix_at(T_S), OPERATING_MODE).joints


@cache
def point_joints() -> FloatArray:
    return HYBRID.solve(POINTS, OPERATING_MODE).joints


@cache
def every() -> tuple[FloatArray, FloatArray]:
    """Return poses and joints of the helix and the points."""
    return np.vstack([helix_at(T_S), POINTS]), np.vstack([joints(), point_joints()])


@cache
def helix() -> Motion:
    return make_job(ARM.robot, "helix", {})


def fragment_mm(side: int) -> float:
    """Return a slider at the second point by the fragment that our copy has: Z0 - l1 + l4 - sqrt(L^2 - (z2 +- h)^2)."""
    x_mm, y_mm, z_mm, _ = POINTS[1].tolist()
    z2_mm = hypot(x_mm, y_mm) - 100.0 - 300.0
    return float(z_mm - 400.0 + 120.0 - sqrt(350.0**2 - (z2_mm + side * 150.0) ** 2))


def links_off_mm() -> float:
    _, at = every()
    variables = HYBRID.dh_variables(at)
    left = np.hypot(variables["z2"] + 150.0, variables["z3"] - at[:, 1])
    right = np.hypot(variables["z2"] - 150.0, variables["z3"] - at[:, 2])
    return float(np.abs(np.column_stack([left, right]) - 350.0).max())


def most_mm(offsets: FloatArray) -> float:
    return float(np.linalg.norm(offsets[:, :3], axis=1).max())


def beyond_reach() -> int:
    radius_mm = np.hypot(*monte_carlo(ARM.robot, 20_000, 1).cloud_mm[:, :2].T)
    return int(np.count_nonzero(np.abs(radius_mm - 400.0) > ARM.mm("z2_max_mm") + 1e-9))


def off_helix_mm(*, akima: bool) -> float:
    """Return the tool's largest distance from the helix between the samples, not within 2 s of the ends."""
    t_s = np.linspace(2.0, 78.0, 24_001)
    straight = np.column_stack([np.interp(t_s, T_S, column) for column in joints().T])
    return most_mm(HYBRID.forward(helix().positions(t_s) if akima else straight) - helix_at(t_s))


NUMBERS = [
    Number("driven joints", 4, lambda: len(ARM.robot.joints)),
    Number("Z5 by the fragment, completed by the root", -56.1779477747, lambda: fragment_mm(1)),
    Number("Z5 of our inverse minus the fragment's", 0.0, lambda: point_joints()[1, 1] - fragment_mm(1), 1e-9),
    Number("Z6 by the fragment, completed by the root", -39.0121599615, lambda: fragment_mm(-1)),
    Number("Z6 of our inverse minus the fragment's", 0.0, lambda: point_joints()[1, 2] - fragment_mm(-1), 1e-9),
    Number("links' lengths, largest difference from L", 0.0, links_off_mm, 1e-9),
    Number("inverse minus the loop's equations by Newton's method", 0.0,
           lambda: float(np.abs(LOOP.driven_at_the_tool(every()[0]).joints - every()[1]).max()), 1e-9),
    Number("tool by the loop's equations minus ours", 0.0,
           lambda: most_mm(LOOP.driven_at_the_joints(every()[1]).poses - HYBRID.forward(every()[1])), 1e-9),
    Number("random positions outside what l2, l3 and z2's range allow", 0, beyond_reach),
    Number("points", 5, lambda: len(POINTS)),
    Number("pose and forward of inverse apart", 0.0, lambda: most_mm(HYBRID.forward(point_joints()) - POINTS), 1e-9),
    Number("duration", 80.0, lambda: helix().duration_s),
    Number("steps", 240, lambda: len(joints()) - 1),
    Number("tool off the helix, joints on Akima's splines, max", 0.0113784845171, lambda: off_helix_mm(akima=True)),
    Number("tool off the helix, straight lines in the joints, max", 0.138704968476, lambda: off_helix_mm(akima=False)),
    Number("pulses of th1 in the 241 samples", 8624, lambda: ARM.pulses(joints(), "th1")),
    Number("pulses of Z5 in the 241 samples", 90328, lambda: ARM.pulses(joints(), "Z5")),
    Number("pulses of Z6 in the 241 samples", 122392, lambda: ARM.pulses(joints(), "Z6")),
    Number("pulses of th4 in the 241 samples", 1728, lambda: ARM.pulses(joints(), "th4")),
    Number("tool off with joints in whole steps, max", 0.0850949306509, lambda: ARM.stepped_off_mm(joints())),
]  # fmt: skip


@pytest.mark.parametrize("number", NUMBERS, ids=lambda number: number.item)
def test_number(number: Number) -> None:
    check_number(ARM.name, number)


def test_every_number_of_the_page_is_here() -> None:
    assert numbers_of_page(ARM.name) <= {number.item for number in NUMBERS}
