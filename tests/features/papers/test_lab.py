"""The laboratory robot's paper: H. Wang and others, 2019."""

from dataclasses import replace
from functools import cache, partial
from math import atan2, cos, degrees, hypot, nan, radians, sin, sqrt

import numpy as np
import pytest

from steptwin.features.papers.spiral import STEP_RAD, SpiralOptions, ZLaw, spiral_poses
from steptwin.host.common.arrays import FloatArray
from steptwin.host.robots.kinematics import make_kinematics
from steptwin.host.robots.kinematics.base import tool_frames
from steptwin.host.robots.poses.base_frame import BaseFrame
from tests.features.papers.numbers import Arm, Misprint, Number, check_misprint, check_number, numbers_of_page

ARM = Arm("lab-scara")
A_MM = 400.0
AT = (150.0, 30.0, 45.0, 60.0)
BASE = BaseFrame(x_mm=100.0, y_mm=200.0, z_mm=50.0, phi_deg=30.0)
C4, S4 = cos(radians(60)), sin(radians(60))
C23, S23 = cos(radians(75)), sin(radians(75))
TIP = ARM.frame(AT)
X_MM, Y_MM, Z_MM = TIP[:3, 3].tolist()


@cache
def points() -> FloatArray:
    return spiral_poses(SpiralOptions())


@cache
def joints() -> FloatArray:
    """Return the joints at the points, with the elbow on the right."""
    solved = ARM.kinematics.solve(points(), "right", np.array(ARM.robot.home)).joints
    return np.asarray(np.unwrap(solved, period=360.0, axis=0))


def radius_mm(*position: float) -> float:
    return hypot(*ARM.frame(position)[:2, 3])


def outside() -> int:
    """Return how many joints of the spiral leave their ranges."""
    lower, upper = ([getattr(joint, end) for joint in ARM.robot.joints] for end in ("lower", "upper"))
    return int(np.count_nonzero(((joints() < lower) | (joints() > upper)).any(axis=0)))


def fastest_ms() -> float:
    speeds = [joint.speed_max for joint in ARM.robot.joints]
    return 1000 * float((np.abs(np.diff(joints(), axis=0)).max(axis=0) / speeds).max())


def errors(at: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the errors at the points of the tool's position in mm, and of both direction cosines of o."""
    frames, psi = tool_frames(ARM.kinematics, at), np.deg2rad(points()[:, 3])
    off_mm = np.linalg.norm(frames[:, :3, 3] - points()[:, :3], axis=1)
    return np.asarray(off_mm), np.abs(frames[:, :2, 1] - np.column_stack([np.sin(psi), -np.cos(psi)]))


def station() -> float:
    """Return how far the tool of a robot with a base is from S_0T times the product, eq. 6."""
    based = make_kinematics(replace(ARM.robot, base=BASE))
    return float(np.abs(tool_frames(based, np.array([AT]))[0] - BASE.matrix @ TIP).max())


def inverse_off() -> float:
    return float(np.abs(ARM.kinematics.solve(ARM.pose(AT)[np.newaxis], "right").joints[0] - AT).max())


NUMBERS = [
    Number("stroke of the lift d1", 250.0, lambda: ARM.joint["d1"].upper),
    Number("range of th2 to either side", 150.0, lambda: ARM.joint["th2"].upper),
    Number("range of th3 to either side", 130.0, lambda: ARM.joint["th3"].upper),
    Number("range of th4 to either side", 360.0, lambda: ARM.joint["th4"].upper),
    Number("speed of d1", 140.0, lambda: ARM.joint["d1"].speed_max),
    Number("speed of th2", 130.0, lambda: ARM.joint["th2"].speed_max),
    Number("speed of th3", 130.0, lambda: ARM.joint["th3"].speed_max),
    Number("speed of th4", 130.0, lambda: ARM.joint["th4"].speed_max),
    Number("a2", 400.0, lambda: ARM.mm("a2_mm")),
    Number("a3", 400.0, lambda: ARM.mm("a3_mm")),
    Number("d5", 150.0, lambda: ARM.mm("d5_mm")),
    Number("greatest distance of the tool from joint 2's axis: the reach, 400 + 400", 800.0,
           lambda: radius_mm(0, 0, 0, 0)),
    Number("the tool's way from lowest to highest: the stroke", 250.0,
           lambda: ARM.frame((250, 0, 130, 0))[2, 3] - ARM.frame((0, 0, 0, 0))[2, 3]),
    Number("least distance, at th3 = 130 deg", 338.094609393, lambda: radius_mm(250, 0, 130, 0)),
    Number("lowest tool, at d1 = 0", -150.0, lambda: ARM.frame((0, 0, 0, 0))[2, 3]),
    Number("highest tool, at d1 = 250 mm", 100.0, lambda: ARM.frame((250, 0, 130, 0))[2, 3]),
    Number("eq. 6", 0.0, station, 1e-9),
    Number("inverse of the forward kinematics", 0.0, inverse_off, 1e-9),
    Number("points of the job", 377, lambda: len(points())),
    Number("x of the axis", -300.0, lambda: points()[0, 0]),
    Number("y of the axis", 400.0, lambda: points()[0, 1]),
    Number("growth from the first point to the last", 5.0,
           lambda: hypot(*(points()[-1, :2] - points()[0, :2])) / (STEP_RAD * 376)),
    Number("direction of the tool, largest change", 0.0, lambda: float(np.ptp(points()[:, 3]))),
    Number("joints of the spiral that leave table 1", 0, outside),
    Number("rise, law A: pi mm a turn", 9.4, lambda: float(np.ptp(points()[:, 2]))),
    Number("rise, law B: pi mm a radian", 59.0619418875,
           lambda: float(np.ptp(spiral_poses(SpiralOptions(z_law=ZLaw.B))[:, 2]))),
    Number("shortest time from point to point at table 1's speeds", 5.77826197827, fastest_ms),
    Number("delta, fig. 6", 0.0, lambda: float(errors(joints())[0].max()), 1e-9),
    Number("delta_ax and delta_ay, fig. 6", 0.0, lambda: float(errors(joints())[1].max()), 1e-9),
    Number("position with joints in whole steps, largest error", 0.15614183805,
           lambda: float(errors(ARM.stepped(joints()))[0].max())),
    Number("position with joints in whole steps, rms", 0.0768046976572,
           lambda: float(np.sqrt((errors(ARM.stepped(joints()))[0] ** 2).mean()))),
    Number("direction cosines with joints in whole steps, largest error", 0.00117809697258,
           lambda: float(errors(ARM.stepped(joints()))[1].max())),
]  # fmt: skip

R_MM = hypot(X_MM, Y_MM)
TOWARDS, ROOT = atan2(-X_MM, Y_MM), atan2(sqrt(1 - (R_MM / (2 * A_MM)) ** 2), R_MM / (2 * A_MM))
O_X, O_Y, _ = TIP[:3, 1].tolist()
MISPRINTS = [
    Misprint("eq. 5, o_x", C4 * C23 - S4 * S23, C4 * C23 + S4 * S23, lambda: TIP[0, 1]),
    Misprint("eq. 5, o_x", hypot(C4 * C23 - S4 * S23, O_Y), hypot(C4 * C23 + S4 * S23, O_Y), lambda: 1.0),
    Misprint("eq. 5, element (3,3)", 150.0 + 150.0, 150.0 - 150.0, lambda: Z_MM),
    Misprint("eq. 9", degrees(TOWARDS + ROOT), degrees(TOWARDS - ROOT), lambda: AT[1]),
    Misprint("eq. 10", 75.0 - degrees(atan2(O_Y, -O_X)), 75.0 - degrees(atan2(O_Y, O_X)), lambda: AT[3]),
]


@pytest.mark.parametrize("number", NUMBERS, ids=lambda number: number.item)
def test_number(number: Number) -> None:
    check_number(ARM.name, number)


@pytest.mark.parametrize("misprint", MISPRINTS, ids=lambda misprint: misprint.place)
def test_misprint(misprint: Misprint) -> None:
    check_misprint(ARM.name, misprint)


def test_equations_7_and_8() -> None:
    cosine = (X_MM**2 + Y_MM**2 - 2 * A_MM**2) / (2 * A_MM**2)
    assert degrees(atan2(sqrt(1 - cosine**2), cosine)) == pytest.approx(45.0, abs=1e-9)
    assert pytest.approx(150.0, abs=1e-9) == Z_MM + 150.0


def test_every_number_of_the_page_is_here() -> None:
    assert numbers_of_page(ARM.name) <= {number.item for number in NUMBERS}


def test_a_wrong_number_is_seen() -> None:
    for literal, ours in ((250.0, 250.1), (251.0, 251.0), (250.0, nan)):
        with pytest.raises(AssertionError):
            check_number(ARM.name, Number("stroke of the lift d1", literal, partial(float, ours)))
