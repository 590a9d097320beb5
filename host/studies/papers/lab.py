"""The laboratory SCARA's paper, item by item.

H. Wang, B. Yin, R. Luo, X. Wang, "Mechanism design and kinematics analysis of 4-dof SCARA robot system", J. Mechanical
& Electrical Engineering 36(12), 2019, 1320-1324. The numbers of its figures are known as far as they stand here.
"""

from dataclasses import dataclass
from functools import cached_property
from math import atan2, cos, degrees, floor, hypot, pi, radians, sin, sqrt
from typing import TYPE_CHECKING, Final

import numpy as np

from steptwin.host.common.arrays import FloatArray
from steptwin.host.planning.jobs.spiral import STEP_RAD, SpiralOptions, ZLaw, spiral_poses
from steptwin.host.robots.kinematics import make_kinematics
from steptwin.host.studies.papers.drawing import COLUMNS, dh_listing, link_rows
from steptwin.host.studies.papers.paper import (
    FOLLOWS,
    Curve,
    Erratum,
    Formula,
    Gap,
    Item,
    Listing,
    Panel,
    Paper,
    Part,
    Plot,
    RunPicture,
    Sketch,
    Value,
    WorkspacePicture,
    alone,
    dimension,
    result,
    run_listing,
    self_check,
    tool_values,
)
from steptwin.host.studies.papers.study import Study, arm_picture, frames_picture
from steptwin.host.twin.embedded.outcome import Outcome

if TYPE_CHECKING:
    from matplotlib.figure import Figure

A2_MM: Final = 400.0
A3_MM: Final = 400.0
D5_MM: Final = 150.0
TURNS: Final = 3
POINT_S: Final = 0.05
"""Time from point to point: assumed, the paper has none."""

_TRANSMISSIONS: Final = (
    "stepper 1, ball screw, big arm",
    "stepper 2, toothed belt 1, forearm",
    "stepper 3, toothed belt 2, wrist",
    "stepper 4, end effector",
)
"""Chains of J1 to J4 by sect. 1."""
SHOWN: Final = (150.0, 20.0, 50.0, 0.0)
"""Joints at which frames can be told apart in a picture."""
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
        """Return, of shape (377, 2), the errors of both direction cosines of o, the tool's y axis, in the plane."""
        psi_rad = np.deg2rad(self.poses[:, 3])
        wanted = np.column_stack([np.sin(psi_rad), -np.cos(psi_rad)])
        return np.asarray(np.abs(self.transforms(joints)[:, :2, 1] - wanted))


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
    """Return the tool's distance from joint 2's axis, on which the paper's base frame stands."""
    return hypot(*study.transforms(np.array([[0.0, 0.0, th3_deg, 0.0]]))[0, :2, 3].tolist())


def _joint(joint: str, attribute: str, unit: str, paper: float, what: str) -> Value[LabStudy]:
    return dimension("table 1", what, unit, paper, lambda study: float(getattr(study.robot.joint(joint), attribute)))


def _length(place: str, key: str, paper: float) -> Value[LabStudy]:
    return dimension(place, key.removesuffix("_mm"), "mm", paper, lambda study: float(study.robot.geometry[key]))


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
    exact, stepped = (study.round_trip_cosines(joints) for joints in (study.joints, study.stepped))
    return (
        Panel("position, exact joints", "point", "delta [1e-12 mm]",
              (Curve("exact", points, 1e12 * study.round_trip_mm(study.joints)),)),
        Panel("position, joints in whole steps", "point", "delta [mm]",
              (Curve("whole steps", points, study.round_trip_mm(study.stepped)),)),
        Panel("direction cosines of o, exact joints", "point", "error [1e-15]",
              (Curve("delta_ax", points, 1e15 * exact[:, 0]), Curve("delta_ay", points, 1e15 * exact[:, 1], "broken"))),
        Panel("direction cosines of o, joints in whole steps", "point", "error",
              (Curve("delta_ax", points, stepped[:, 0]), Curve("delta_ay", points, stepped[:, 1], "broken"))),
    )  # fmt: skip


def _range_rows(study: LabStudy) -> list[list[str]]:
    """Return a row for each joint: what the spiral needs of it, and its range of table 1."""
    lowest, highest = study.joints.min(axis=0), study.joints.max(axis=0)
    return [
        [f"{joint.name} [{joint.unit}]", f"{low:.3f}", f"{high:.3f}", f"{joint.lower:g}", f"{joint.upper:g}"]
        for joint, low, high in zip(study.robot.joints, lowest.tolist(), highest.tolist(), strict=True)
    ]


def _joints_beyond(study: LabStudy) -> int:
    """Return how many joints leave their range of table 1 on the spiral."""
    lower, upper = ([getattr(joint, end) for joint in study.robot.joints] for end in ("lower", "upper"))
    return int(np.count_nonzero((study.joints < lower).any(axis=0) | (study.joints > upper).any(axis=0)))


def _transmission_rows(study: LabStudy) -> list[list[str]]:
    return [[joint.name, chain, f"{joint.transmission.steps_per_unit:g} steps/{joint.unit}"]
            for joint, chain in zip(study.robot.joints, _TRANSMISSIONS, strict=True)]  # fmt: skip


def _draw_spiral(study: LabStudy) -> "Figure":
    from steptwin.host.record.plots.in_space import draw_path_in_space

    reached_mm = study.transforms(study.joints)[:, :3, 3]
    return draw_path_in_space(study.robot, study.poses[:, :3], reached_mm, study.joints[-1])


MECHANISM: Final[Item[LabStudy]] = Item(
    "Sect. 1, table 1, fig. 1",
    "mechanism: ranges, speeds, transmissions",
    "The file of the robot has them; all that plans or checks a motion reads them from there.",
    parts=(
        Part("table 1", "ranges, speeds, reach", "dimensions below"),
        Part("sect. 1", "transmissions of J1 to J4: screw, belt 1, belt 2, direct", "table below"),
        Part("fig. 1", "three-dimensional model", "picture below: the mechanism in space, without the bodies' shapes"),
    ),
    values=(
        _joint("d1", "upper", "mm", 250.0, "stroke of the lift d1"),
        _joint("th2", "upper", "deg", 150.0, "range of th2 to either side"),
        _joint("th3", "upper", "deg", 130.0, "range of th3 to either side"),
        _joint("th4", "upper", "deg", 360.0, "range of th4 to either side"),
        _joint("d1", "speed_max", "mm/s", 140.0, "speed of d1"),
        _joint("th2", "speed_max", "deg/s", 130.0, "speed of th2"),
        _joint("th3", "speed_max", "deg/s", 130.0, "speed of th3"),
        _joint("th4", "speed_max", "deg/s", 130.0, "speed of th4"),
        _length("table 1, sect. 2.1", "a2_mm", 400.0),
        _length("table 1, sect. 2.1", "a3_mm", 400.0),
        _length("sect. 2.1", "d5_mm", 150.0),
    ),
    listings=(Listing("Transmissions", ("joint", "as in sect. 1", "in the robot's file"), _transmission_rows, 3),),
    left_open=(
        Gap("sect. 1", "motors, controller, the screw's lead, the belts' ratios, microsteps, accuracy, payload",
            "assumed, marked [A] in the robot's file"),
        Gap("table 1", "where the lift's stroke begins", "d1 from 0 to 250 mm: assumed, [A] in the robot's file"),
    ),
    pictures=(
        Sketch("fig. 1", "fig-1-arm", "the arm at home", arm_picture),
    ),
)  # fmt: skip

FORWARD: Final[Item[LabStudy]] = Item(
    "Sects. 2.1, 2.2: fig. 3, table 2, eqs. 1 to 6",
    "frames, DH parameters, the links' transforms and their product",
    f"The modified DH parameters are those of the paper, with the first angle fixed at 90 deg. At d1 = {AT[0]:g} mm,"
    f" th2 = {AT[1]:g}, th3 = {AT[2]:g}, th4 = {AT[3]:g} deg, as `steptwin fk lab-scara 150 30 45 60 --matrices` prints"
    " them too:",
    parts=(
        Part("fig. 3", "link frames", "picture below, from table 2"),
        Part("table 2", "DH parameters", "table below"),
        Part("eqs. 1 to 4", "the links' transforms", "T1 to T4 below"),
        Part("eq. 5", "their product", "0T4 below; misprints computed"),
        Part("eq. 6", "station and tool frames", "`[base]` in a robot's file is the paper's S_0T, `d5_mm` its 4_7T"),
    ),
    listings=(
        dh_listing("lab-scara", "Table 2: DH parameters"),
        Listing("Eqs. 1 to 5: the links' transforms and their product", COLUMNS,
                lambda study: link_rows(study.robot, AT)),
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
        Erratum("table 2, fourth column", "its heading repeats the second one's, link length", "link offset d_i",
                "the symbol below it"),
        Erratum("sect. 2.2, abbreviations", "c12, c13, c34, s12, s34", "c23, s23",
                "only c23 and s23 occur in eq. 5"),
        Erratum("table 2, eqs. 3, 5, 7, 9", "the letter alpha for lengths and for twists", "a2, a3 for the lengths",
                "table 2's first column"),
    ),
    pictures=(
        Sketch("fig. 3", "fig-3-frames", "link frames of table 2", frames_picture(SHOWN)),
    ),
)  # fmt: skip

INVERSE: Final[Item[LabStudy]] = Item(
    "Sect. 2.3: table 3, eqs. 7 to 10",
    "the inverse",
    "The same joints as above, computed back from the tool's transform. Sect. 2.3 ends with the remark that there are"
    " several solutions, to be chosen by what the robot can do: `steptwin ik lab-scara --x -300 --y 400 --z 0 --phi 0`"
    " lists them, right and left elbow, each with the limits that it keeps or breaks. Eq. 7 takes the root's + for"
    " th3 = 45 deg. The signs of eqs. 9 and 10 are printed as free, while they follow from eq. 7's: a wrong one gives"
    " another pose. On the paper's own spiral both signs of eq. 10 give the same th4, since the tool's o is (0, -1)"
    " there.",
    parts=(
        Part("table 3", "n, o, a, p of the tool's transform", "columns of the matrices; `trajectory.csv` of every run"),
        Part("eqs. 7, 8", "th3, d1", "self-checks below"),
        Part("eq. 9", "th2", "self-check below; both signs computed"),
        Part("eq. 10", "th4", "self-check below; both signs computed"),
        Part("sect. 2.3", "several solutions, chosen by what the robot can do", "`steptwin ik`: branches with reasons"),
    ),
    values=(
        self_check("th3 by eq. 7", "deg", AT[2], lambda study: _solved(study)[2], 1e-9, 9),
        self_check("d1 by eq. 8", "mm", AT[0], lambda study: _solved(study)[0], 1e-9, 9),
        self_check("th2 by eq. 9, sign chosen", "deg", AT[1], lambda study: _solved(study)[1], 1e-9, 9),
        self_check("th4 by eq. 10, sign chosen", "deg", AT[3], lambda study: _solved(study)[3], 1e-9, 9),
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
            "the minus gives another attitude wherever o_x is not 0; on the paper's spiral it is 0, and both agree",
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


def _height_mm(study: LabStudy, d1_mm: float) -> float:
    return float(study.transforms(np.array([[d1_mm, 0.0, 0.0, 0.0]]))[0, 2, 3])


def _lifted_mm(study: LabStudy) -> float:
    lift = study.robot.joint("d1")
    return _height_mm(study, lift.upper) - _height_mm(study, lift.lower)


WORKSPACE: Final[Item[LabStudy]] = Item(
    "Fig. 2",
    "the workspace as a cloud",
    "Random joints within their ranges, and the exact boundary of the sections. The paper's base frame stands on the"
    " axis of joint 2, so distances are from there, not from the lift's screw.",
    parts=(Part("fig. 2", "workspace by the Monte Carlo method", "pictures below; `steptwin workspace lab-scara`"),),
    values=(
        result("table 1", "greatest distance of the tool from joint 2's axis: the reach, 400 + 400", "mm", 800.0,
               lambda study: _radius_mm(study, 0.0), 1e-6, 6, FOLLOWS),
        result("table 1", "the tool's way from lowest to highest: the stroke", "mm", 250.0, _lifted_mm, 1e-9, 6,
               FOLLOWS),
        alone("least distance, at th3 = 130 deg", "mm", lambda study: _radius_mm(study, 130.0), 6),
        alone("lowest tool, at d1 = 0", "mm", lambda study: _height_mm(study, 0.0), 3),
        alone("highest tool, at d1 = 250 mm", "mm", lambda study: _height_mm(study, 250.0), 3),
    ),
    left_open=(Gap("fig. 2", "number of samples", "100 000"),),
    lost=(Gap("fig. 2", "the figure, and so its axes", "drawn from table 1"),),
    pictures=(
        WorkspacePicture("fig. 2", "fig-2-cloud", "tool positions at random joint positions", in_space=True),
        WorkspacePicture("fig. 2", "fig-2-workspace", "100 000 random joint positions and the boundary"),
    ),
)  # fmt: skip


SPIRAL: Final[Item[LabStudy]] = Item(
    "Sect. 3: figs. 4, 5",
    "the Archimedean spiral: joints and path",
    "Three turns about the vertical line x = -300, y = 400, 5 mm/rad, in steps of 0.05 rad, with the tool's direction"
    f" constant along +X. z0 = 0 and {POINT_S:g} s from point to point are assumed."
    " `steptwin run lab-scara spiral` runs it.",
    parts=(
        Part("sect. 3", "spiral: centre, growth, pitch, step, 377 points", "results below; job `spiral`"),
        Part("fig. 4", "the joints at the points", "picture and table below"),
        Part("fig. 5", "simulated and real path", "pictures below: in space, from above, by the counted steps"),
        Part("abstract", "the joints keep to the workspace's ranges", "table below: the spiral's joints and table 1"),
    ),
    values=(
        result("sect. 3", "points of the job", "", 377, lambda study: len(study.poses)),
        result("sect. 3", "x of the axis", "mm", -300.0, lambda study: float(study.poses[0, 0]), 1e-9, 3),
        result("sect. 3", "y of the axis", "mm", 400.0, lambda study: float(study.poses[0, 1]), 1e-9, 3),
        result(
            "sect. 3", "growth from the first point to the last", "mm/rad", 5.0,
            lambda study: hypot(*(study.poses[-1, :2] - study.poses[0, :2])) / (STEP_RAD * 376), 1e-9, 6,
        ),
        result("sect. 3", "direction of the tool, largest change", "deg", 0.0,
               lambda study: float(np.ptp(study.poses[:, 3])), 1e-9, 3),
        result("abstract", "joints of the spiral that leave table 1", "", 0, _joints_beyond),
        self_check("points in three turns of 0.05 rad", "", 377, lambda _: floor(TURNS * 2 * pi / STEP_RAD) + 1),
        alone("rise, law A: pi mm a turn", "mm", lambda study: float(np.ptp(study.poses[:, 2])), 3),
        alone("rise, law B: pi mm a radian", "mm",
              lambda _: float(np.ptp(spiral_poses(SpiralOptions(z_law=ZLaw.B))[:, 2])), 3),
        alone("shortest time from point to point at table 1's speeds", "ms",
              lambda study: 1000 * _fastest_s(study), 3),
        *tool_values(lambda study: study.outcome),
    ),
    listings=(
        Listing("Fig. 4 in numbers: every 47th point, elbow on the right, law A, psi = 0",
                ("k", "x mm", "y mm", "z mm", "d1 mm", "th2 deg", "th3 deg", "th4 deg"), _joint_rows),
        Listing("The spiral's joints and their ranges of table 1",
                ("joint", "least", "greatest", "lower limit", "upper limit"), _range_rows),
        run_listing("spiral", lambda study: study.outcome),
    ),
    errata=(
        Erratum("sect. 3, after fig. 6", "two trajectories", "one", "sect. 3 describes one"),
    ),
    left_open=(
        Gap("sect. 3", "z0 of the spiral", "option `z_mm`, 0 by default"),
        Gap("sect. 3", "time from point to point", "option `point_s`, 0.05 s by default"),
        Gap("sect. 3", "whether the pitch pi is per turn or per radian", "option `z_law`: A, per turn, by default; B"),
    ),
    lost=(Gap("figs. 4, 5", "the figures, and so their axes", "only the shapes follow from sect. 3"),),
    pictures=(
        Plot("fig. 4", "fig-4-joints", "the joints at the 377 points", _joint_panels),
        Sketch("fig. 5", "fig-5-space", "the prescribed path in space, and the arm at its end", _draw_spiral),
        Plot("fig. 5", "fig-5-path", "the prescribed path and the forward kinematics of its inverse", _path_panels),
        RunPicture("fig. 5", "spiral", "tool-path", "the path by the counted steps"),
    ),
)  # fmt: skip

ROUND_TRIP: Final[Item[LabStudy]] = Item(
    "Sect. 3: fig. 6",
    "errors of position and of both direction cosines at the 377 points",
    "The paper's check is kinematic: point, inverse, forward, and the difference. What remains is the rounding of"
    " floating-point numbers. A stepper adds the rounding to whole steps, shown beside it.",
    parts=(Part("fig. 6", "delta, delta_ax, delta_ay", "picture and self-checks below"),),
    values=(
        self_check("delta: position, largest round-trip error", "mm", 0.0,
                   lambda study: float(study.round_trip_mm(study.joints).max()), 1e-9, 9),
        self_check("delta_ax: o_x, largest round-trip error", "", 0.0,
                   lambda study: float(study.round_trip_cosines(study.joints)[:, 0].max()), 1e-9, 9),
        self_check("delta_ay: o_y, largest round-trip error", "", 0.0,
                   lambda study: float(study.round_trip_cosines(study.joints)[:, 1].max()), 1e-9, 9),
        alone("position with joints in whole steps, largest error", "mm",
              lambda study: float(study.round_trip_mm(study.stepped).max()), 6),
        alone("position with joints in whole steps, rms", "mm",
              lambda study: float(np.sqrt((study.round_trip_mm(study.stepped) ** 2).mean())), 6),
        alone("direction cosines with joints in whole steps, largest error", "",
              lambda study: float(study.round_trip_cosines(study.stepped).max()), 6),
    ),
    lost=(Gap("fig. 6", "the figure, and so its axes", "that its errors are rounding errors follows from sect. 3"),),
    pictures=(
        Plot("fig. 6", "fig-6-errors", "errors of exact joints and of joints in whole steps", _error_panels),
    ),
)  # fmt: skip

PAPER: Final = Paper(
    "lab-scara",
    'Wang Haifeng, Yin Bin, Luo Ruijie, Wang Xingang, "Mechanism design and kinematics analysis of 4-dof SCARA robot'
    ' system", J. Mechanical & Electrical Engineering 36(12), 2019, 1320-1324.',
    LabStudy,
    (MECHANISM, WORKSPACE, FORWARD, INVERSE, SPIRAL, ROUND_TRIP),
)
