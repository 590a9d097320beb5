"""The laboratory SCARA's paper, figure by figure.

H. Wang, B. Yin, R. Luo, X. Wang, "Mechanism design and kinematics analysis of 4-dof SCARA robot system", J. Mechanical
& Electrical Engineering 36(12), 2019, 1320-1324. The numbers of its figures are known as far as they stand here.
"""

from dataclasses import dataclass
from functools import cached_property
from math import atan2, cos, degrees, floor, hypot, pi, radians, sin, sqrt
from typing import Final

import numpy as np

from steptwin.host.common.arrays import FloatArray
from steptwin.host.planning.jobs.spiral import STEP_RAD, SpiralOptions, ZLaw, spiral_poses
from steptwin.host.robots.kinematics import make_kinematics
from steptwin.host.studies.papers.drawing import COLUMNS, link_rows
from steptwin.host.studies.papers.paper import (
    DERIVED,
    Curve,
    Erratum,
    Formula,
    Item,
    Listing,
    Panel,
    Paper,
    Plot,
    RunPicture,
    Value,
    WorkspacePicture,
    run_listing,
    tool_values,
)
from steptwin.host.studies.papers.study import Study
from steptwin.host.twin.embedded.outcome import Outcome

A2_MM: Final = 400.0
A3_MM: Final = 400.0
D5_MM: Final = 150.0
TURNS: Final = 3
POINT_S: Final = 0.05
"""Time from point to point: assumed, the paper has none."""

AT: Final = (150.0, 30.0, 45.0, 60.0)
"""d1, th2, th3, th4 where formulas are computed."""


def _sines(*angles_deg: float) -> tuple[float, ...]:
    """Return cosine and sine of the first angle, of the second ..."""
    return tuple(f(radians(angle)) for angle in angles_deg for f in (cos, sin))


@dataclass(frozen=True)
class LabStudy(Study):
    """What the items share: the robot, the spiral at the paper's 377 points, and its run."""

    robot_name = "lab-scara"

    @cached_property
    def poses(self) -> FloatArray:
        """Poses of the spiral's points by law A, of shape (377, 4)."""
        return spiral_poses(SpiralOptions())

    @cached_property
    def joints(self) -> FloatArray:
        """Joints at the points, of shape (377, 4), by inverse kinematics with the elbow on the right."""
        solved = make_kinematics(self.robot).solve(self.poses, "right", np.array(self.robot.home))
        return np.asarray(np.unwrap(solved.joints, period=360.0, axis=0))

    @cached_property
    def stepped(self) -> FloatArray:
        """The joints with each rounded to its nearest whole step."""
        return self.robot.from_steps(np.floor(self.robot.to_steps(self.joints) + 0.5))

    @property
    def outcome(self) -> Outcome:
        """The run of the spiral."""
        return self.run_of("spiral")

    def transforms(self, joints: FloatArray) -> FloatArray:
        """Return the tool's transforms, of shape (n, 4, 4), as the product of the DH table's."""
        kinematics = make_kinematics(self.robot)
        return kinematics.dh.transforms(kinematics.dh_variables(joints))

    @cached_property
    def product(self) -> FloatArray:
        """The tool's transform at AT."""
        return np.asarray(self.transforms(np.array([AT]))[0])

    def round_trip_mm(self, joints: FloatArray) -> FloatArray:
        """Return the distances, of shape (377,), of the joints' tool positions from the spiral's points."""
        offsets_mm = self.transforms(joints)[:, :3, 3] - self.poses[:, :3]
        return np.asarray(np.linalg.norm(offsets_mm, axis=1))

    def round_trip_cosines(self, joints: FloatArray) -> FloatArray:
        """Return, of shape (377,), the largest error of a direction cosine of o, the tool's y axis."""
        psi_rad = np.deg2rad(self.poses[:, 3])
        wanted = np.column_stack([np.sin(psi_rad), -np.cos(psi_rad), np.zeros(len(psi_rad))])
        return np.asarray(np.abs(self.transforms(joints)[:, :3, 1] - wanted).max(axis=1))


def _column_o(study: LabStudy) -> tuple[float, ...]:
    return tuple(study.product[:3, 1].tolist())


def _printed_o_x(_: LabStudy) -> float:
    c4, s4, c23, s23 = _sines(AT[3], AT[1] + AT[2])
    return c4 * c23 - s4 * s23


def _corrected_o_x(_: LabStudy) -> float:
    c4, s4, c23, s23 = _sines(AT[3], AT[1] + AT[2])
    return c4 * c23 + s4 * s23


def _th2_deg(study: LabStudy, sign: int) -> float:
    """Return th2 from the tool's position, with the root's sign: + is the sign that eq. 7 takes for th3 = 45 deg."""
    x_mm, y_mm = study.product[:2, 3].tolist()
    r_mm = hypot(x_mm, y_mm)
    k = (r_mm**2 + A2_MM**2 - A3_MM**2) / (2 * A2_MM * r_mm)
    return degrees(atan2(-x_mm, y_mm) + sign * atan2(sqrt(1 - k**2), k))


def _th4_deg(study: LabStudy, sign: int) -> float:
    o_x, o_y, _ = _column_o(study)
    return AT[1] + AT[2] - degrees(atan2(o_y, sign * o_x))


def _radius_mm(study: LabStudy, th3_deg: float) -> float:
    """Return the tool's distance from the screw."""
    return hypot(*study.transforms(np.array([[0.0, 0.0, th3_deg, 0.0]]))[0, :2, 3].tolist())


def _stated(joint: str, attribute: str, unit: str, paper: float, what: str) -> Value[LabStudy]:
    return Value(what, unit, paper, lambda study: float(getattr(study.robot.joint(joint), attribute)))


def _fastest_s(study: LabStudy) -> float:
    """Return the shortest time from point to point that the stated speeds allow."""
    ways = np.abs(np.diff(study.joints, axis=0)).max(axis=0)
    return float((ways / [joint.speed_max for joint in study.robot.joints]).max())


def _joint_rows(study: LabStudy) -> list[list[str]]:
    chosen = range(0, len(study.poses), 47)
    return [
        [str(k), *(f"{value:z.3f}" for value in study.poses[k, :3]), *(f"{value:z.6f}" for value in study.joints[k])]
        for k in chosen
    ]


def _joint_panels(study: LabStudy) -> tuple[Panel, ...]:
    u = STEP_RAD * np.arange(float(len(study.joints)))
    return tuple(
        Panel(joint.name, "u [rad]", f"{joint.name} [{joint.unit}]", (Curve(joint.name, u, study.joints[:, axis]),))
        for axis, joint in enumerate(study.robot.joints)
    )


def _path_panels(study: LabStudy) -> tuple[Panel, ...]:
    wanted, reached = study.poses, study.transforms(study.joints)[:, :3, 3]
    law_b = spiral_poses(SpiralOptions(z_law=ZLaw.B))
    above = (
        Curve("prescribed", wanted[:, 0], wanted[:, 1], "broad"),
        Curve("forward of inverse", reached[:, 0], reached[:, 1]),
    )
    u = STEP_RAD * np.arange(float(len(wanted)))
    rise = (
        Curve("law A: pi mm a turn", u, wanted[:, 2]),
        Curve("law B: pi mm a radian", u, law_b[:, 2], "broken"),
    )
    return Panel("from above", "x [mm]", "y [mm]", above, true_to_scale=True), Panel("rise", "u [rad]", "z [mm]", rise)


def _error_panels(study: LabStudy) -> tuple[Panel, ...]:
    points = np.arange(float(len(study.poses)))
    return (
        Panel("position, exact joints", "point", "error [1e-12 mm]",
              (Curve("exact", points, 1e12 * study.round_trip_mm(study.joints)),)),
        Panel("position, joints in whole steps", "point", "error [mm]",
              (Curve("whole steps", points, study.round_trip_mm(study.stepped)),)),
        Panel("direction cosines of o, exact joints", "point", "error [1e-15]",
              (Curve("exact", points, 1e15 * study.round_trip_cosines(study.joints)),)),
        Panel("direction cosines of o, joints in whole steps", "point", "error",
              (Curve("whole steps", points, study.round_trip_cosines(study.stepped)),)),
    )  # fmt: skip


MECHANISM: Final[Item[LabStudy]] = Item(
    "Mechanism",
    "ranges, speeds and lengths",
    "The file of the robot has them; all that plans or checks a motion reads them from there.",
    values=(
        _stated("d1", "upper", "mm", 250.0, "stroke of the lift d1"),
        _stated("th2", "upper", "deg", 150.0, "range of th2 to either side"),
        _stated("th3", "upper", "deg", 130.0, "range of th3 to either side"),
        _stated("th4", "upper", "deg", 360.0, "range of th4 to either side"),
        _stated("d1", "speed_max", "mm/s", 140.0, "speed of d1"),
        _stated("th2", "speed_max", "deg/s", 130.0, "speed of th2"),
        _stated("th3", "speed_max", "deg/s", 130.0, "speed of th3"),
        _stated("th4", "speed_max", "deg/s", 130.0, "speed of th4"),
        Value("a2", "mm", A2_MM, lambda study: float(study.robot.geometry["a2_mm"])),
        Value("a3", "mm", A3_MM, lambda study: float(study.robot.geometry["a3_mm"])),
        Value("d5", "mm", D5_MM, lambda study: float(study.robot.geometry["d5_mm"])),
    ),
    not_comparable="motors, controller, the screw's lead, the belts' ratios, microsteps, accuracy and payload are not"
    " given; ours are assumed and marked [A] in the robot's file.",
)

FORWARD: Final[Item[LabStudy]] = Item(
    "Table 2, eqs. 1 to 6",
    "DH parameters, the links' transforms and their product",
    f"The modified DH parameters are those of the paper, with the first angle fixed at 90 deg. At d1 = {AT[0]:g} mm,"
    f" th2 = {AT[1]:g}, th3 = {AT[2]:g}, th4 = {AT[3]:g} deg:",
    listings=(
        Listing("The links' transforms and their product", COLUMNS, lambda study: link_rows(study.robot, AT)),
    ),
    errata=(
        Erratum(
            "eq. 5, o_x",
            "c4 c23 - s4 s23",
            "c4 c23 + s4 s23",
            "the product of eqs. 1 to 4; as printed the column is not orthonormal",
            (
                Formula("o_x", "", _printed_o_x, _corrected_o_x,
                        lambda study: float(study.product[0, 1]), "the product of the links' transforms", 6),
                Formula("length of column o", "",
                        lambda study: hypot(_printed_o_x(study), *_column_o(study)[1:]),
                        lambda study: hypot(_corrected_o_x(study), *_column_o(study)[1:]),
                        lambda _: 1.0, "a direction's length", 6),
            ),
        ),
        Erratum(
            "eq. 5, element (3,3)",
            "1",
            "-1",
            "eq. 4 has -1, and d1 = p_z + d5 in eq. 8 needs it",
            (
                Formula("p_z = d1 + a_z d5", "mm", lambda _: AT[0] + D5_MM, lambda _: AT[0] - D5_MM,
                        lambda study: float(study.product[2, 3]), "the product of the links' transforms"),
            ),
        ),
        Erratum("table 2, third column", '"link length"', "link offset d_i", "its symbols"),
        Erratum("abbreviations", "c12, c13, c34, s12, s34", "c23, s23", "only these occur in the equations"),
    ),
)  # fmt: skip

INVERSE: Final[Item[LabStudy]] = Item(
    "Eqs. 7 to 10",
    "the inverse",
    "The same joints as above, computed back from the tool's transform. Eq. 7 takes the root's + for th3 = 45 deg."
    " The root of eq. 9 is written here as that of the angle between the arm's first link and the line to the wrist.",
    values=(
        Value("th3 by eq. 7", "deg", AT[2], lambda study: _solved(study)[2], 1e-9, 9, DERIVED),
        Value("d1 by eq. 8", "mm", AT[0], lambda study: _solved(study)[0], 1e-9, 9, DERIVED),
        Value("th2 by eq. 9, corrected", "deg", AT[1], lambda study: _solved(study)[1], 1e-9, 9, DERIVED),
        Value("th4 by eq. 10, corrected", "deg", AT[3], lambda study: _solved(study)[3], 1e-9, 9, DERIVED),
    ),
    errata=(
        Erratum(
            "eq. 9",
            "a free +- before the root",
            "the sign opposite to that chosen in eq. 7",
            "atan2(A, B) = 90 - atan2(B, A) with B = -a3 sin th3; checked on 10 000 poses",
            (
                Formula("th2 with the sign of eq. 7, and with the opposite one", "deg",
                        lambda study: _th2_deg(study, 1), lambda study: _th2_deg(study, -1),
                        lambda _: AT[1], "the joints that made the transform", 6),
            ),
        ),
        Erratum(
            "eq. 10",
            "atan2(o_y, +-o_x)",
            "only +o_x",
            "the minus gave a wrong attitude in every pose tried",
            (
                Formula("th4 with -o_x, and with +o_x", "deg",
                        lambda study: _th4_deg(study, -1), lambda study: _th4_deg(study, 1),
                        lambda _: AT[3], "the joints that made the transform", 6),
            ),
        ),
    ),
)  # fmt: skip


def _solved(study: LabStudy) -> list[float]:
    """Return the joints of the robot's inverse for the transform at AT."""
    kinematics = make_kinematics(study.robot)
    joints: list[float] = kinematics.solve(kinematics.forward(np.array([AT])), "right").joints[0].tolist()
    return joints


WORKSPACE: Final[Item[LabStudy]] = Item(
    "Fig. 2",
    "the workspace as a cloud",
    "Random joints within their ranges, and the exact boundary of the sections.",
    values=(
        Value("greatest distance of the tool from the screw", "mm", A2_MM + A3_MM, lambda study: _radius_mm(study, 0.0),
              1e-6, 6, DERIVED),
        Value("least distance, at th3 = 130 deg", "mm", None, lambda study: _radius_mm(study, 130.0), decimals=6),
        Value("lowest tool, at d1 = 0", "mm", -D5_MM, lambda study: study.transforms(np.zeros((1, 4)))[0, 2, 3],
              1e-9, 3, DERIVED),
        Value("highest tool", "mm", 250.0 - D5_MM,
              lambda study: study.transforms(np.array([[250.0, 0.0, 0.0, 0.0]]))[0, 2, 3], 1e-9, 3, DERIVED),
    ),
    pictures=(
        WorkspacePicture("fig-2-cloud", "Workspace: tool positions at random joint positions", in_space=True),
        WorkspacePicture("fig-2-workspace", "Workspace: 100 000 random joint positions and the boundary"),
    ),
    not_comparable="the number of samples is not given, and no numbers are known of the figure's axes.",
)  # fmt: skip

SPIRAL: Final[Item[LabStudy]] = Item(
    "Experiment",
    "the Archimedean spiral: joints and path",
    "Three turns about the vertical axis x = -300, y = 400, 5 mm/rad, in steps of 0.05 rad, with the tool's direction"
    f" constant along +X. z0 = 0 and {POINT_S:g} s from point to point are assumed.",
    values=(
        Value("points in three turns", "", 377, lambda _: floor(TURNS * 2 * pi / STEP_RAD) + 1),
        Value("points of the job", "", 377, lambda study: len(study.poses)),
        Value("x of the axis", "mm", -300.0, lambda study: float(study.poses[0, 0]), 1e-9, 3),
        Value("y of the axis", "mm", 400.0, lambda study: float(study.poses[0, 1]), 1e-9, 3),
        Value(
            "growth from the first point to the last", "mm/rad", 5.0,
            lambda study: hypot(*(study.poses[-1, :2] - study.poses[0, :2])) / (STEP_RAD * 376), 1e-9, 6,
        ),
        Value("direction of the tool, largest change", "deg", 0.0,
              lambda study: float(np.ptp(study.poses[:, 3])), 1e-9, 3),
        Value("rise, law A: pi mm a turn", "mm", None, lambda study: float(np.ptp(study.poses[:, 2])), decimals=3),
        Value("rise, law B: pi mm a radian", "mm", None,
              lambda _: float(np.ptp(spiral_poses(SpiralOptions(z_law=ZLaw.B))[:, 2])), decimals=3),
        Value("shortest time from point to point at the stated speeds", "ms", None,
              lambda study: 1000 * _fastest_s(study), decimals=3),
        *tool_values(lambda study: study.outcome),
    ),
    listings=(
        Listing("Every 47th point, elbow on the right, law A, psi = 0",
                ("k", "x mm", "y mm", "z mm", "d1 mm", "th2 deg", "th3 deg", "th4 deg"), _joint_rows),
        run_listing("spiral", lambda study: study.outcome),
    ),
    errata=(
        Erratum(
            "spiral",
            'no z0, no time; the pitch without a unit; "two trajectories", one described',
            "options `z_mm`, `point_s`, `z_law`",
            "what the motion needs to be defined",
        ),
    ),
    pictures=(
        Plot("joints", "The joints at the 377 points", _joint_panels),
        Plot("path", "The prescribed path and the forward kinematics of its inverse", _path_panels),
        RunPicture("spiral", "tool-path", "The path by the counted steps"),
    ),
    not_comparable="no numbers are known of the figures of the joints and of the path; without z0, time and the"
    " pitch's unit only the shapes can be compared.",
)  # fmt: skip

ROUND_TRIP: Final[Item[LabStudy]] = Item(
    "Fig. 6",
    "errors of position and direction cosines at the 377 points",
    "The paper's check is kinematic: point, inverse, forward, and the difference. What remains is the rounding of"
    " floating-point numbers. A stepper adds the rounding to whole steps, shown beside it.",
    values=(
        Value("position, largest round-trip error", "mm", 0.0,
              lambda study: float(study.round_trip_mm(study.joints).max()), 1e-9, 9, DERIVED),
        Value("direction cosines of o, largest round-trip error", "", 0.0,
              lambda study: float(study.round_trip_cosines(study.joints).max()), 1e-9, 9, DERIVED),
        Value("position with joints in whole steps, largest error", "mm", None,
              lambda study: float(study.round_trip_mm(study.stepped).max()), decimals=6),
        Value("position with joints in whole steps, rms", "mm", None,
              lambda study: float(np.sqrt((study.round_trip_mm(study.stepped) ** 2).mean())), decimals=6),
        Value("direction cosines with joints in whole steps, largest error", "", None,
              lambda study: float(study.round_trip_cosines(study.stepped).max()), decimals=6),
    ),
    pictures=(Plot("fig-6-errors", "Round trip: errors of exact joints and of joints in whole steps", _error_panels),),
    not_comparable="no numbers are known of the figure's axes; that its errors are rounding errors follows from what it"
    " computes.",
)  # fmt: skip

PAPER: Final = Paper(
    "lab-scara",
    'Wang Haifeng, Yin Bin, Luo Ruijie, Wang Xingang, "Mechanism design and kinematics analysis of 4-dof SCARA robot'
    ' system", J. Mechanical & Electrical Engineering 36(12), 2019, 1320-1324.',
    LabStudy,
    (MECHANISM, FORWARD, INVERSE, WORKSPACE, SPIRAL, ROUND_TRIP),
)
