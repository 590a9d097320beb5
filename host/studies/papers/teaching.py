"""The classroom robot's paper, figure by figure.

X. Yao, Y. Pan, Y. Gao, "Research and Implementation of SCARA Manipulator Control Algorithm in Experimental Teaching",
2017, DOI 10.3969/j.issn.1000-386x.2017.06.019.
"""

from dataclasses import dataclass
from functools import cached_property
from math import acos, cos, degrees, radians, sin
from typing import Final

import numpy as np

from steptwin.host.common.arrays import FloatArray
from steptwin.host.planning.jobs.carry import GOAL_RAD, START_RAD
from steptwin.host.planning.laws import Cubic, Quintic
from steptwin.host.planning.motions.joint_move import JointMove
from steptwin.host.robots.kinematics import make_kinematics
from steptwin.host.studies.papers.drawing import COLUMNS, matrix_rows
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
    run_listing,
    tool_values,
)
from steptwin.host.studies.papers.study import Study, in_whole_steps, panels_over, pulses, tool_off_mm, transforms
from steptwin.host.twin.embedded.outcome import Outcome

L1_MM: Final = 95.0
L2_MM: Final = 100.0
D4_MM: Final = -40.0
DURATION_S: Final = 1.0
STEP_S: Final = 0.015
AT: Final = (30.0, 60.0, 20.0, 15.0)
"""th1, th2, d3, th4 where formulas are computed."""
_QA: Final = tuple(degrees(angle) for angle in START_RAD)
_QB: Final = tuple(degrees(angle) for angle in GOAL_RAD)
_TURNING: Final = ((0, "th1"), (1, "th2"), (3, "th4"))
"""Columns and names of the joints that move."""


@dataclass(frozen=True)
class TeachingStudy(Study):
    """What the items share: the robot, the two points, the laws between them, and the run."""

    robot_name = "teaching-scara"

    @cached_property
    def cubic(self) -> JointMove:
        """The motion by the text's law."""
        return JointMove(self.robot.joint_names, _QA, _QB, Cubic(1.0, DURATION_S))

    @cached_property
    def quintic(self) -> JointMove:
        """The motion by the toolbox's law."""
        return JointMove(self.robot.joint_names, _QA, _QB, Quintic(1.0, DURATION_S))

    @cached_property
    def printed_t_s(self) -> FloatArray:
        """The instants of 0:0.015:1, which end before 1."""
        return STEP_S * np.arange(np.floor(DURATION_S / STEP_S + 1e-9) + 1)

    @cached_property
    def samples_s(self) -> FloatArray:
        """The same instants and the end of the motion."""
        return np.append(self.printed_t_s, DURATION_S)

    @cached_property
    def joints(self) -> FloatArray:
        """The joints of the cubic at the samples, of shape (68, 4)."""
        return self.cubic.positions(self.samples_s)

    @cached_property
    def dense_s(self) -> FloatArray:
        """Instants for curves."""
        return np.linspace(0.0, DURATION_S, 501)

    @property
    def outcome(self) -> Outcome:
        """The run of the carry."""
        return self.run_of("carry")

    @cached_property
    def pose(self) -> list[float]:
        """The tool's pose at AT."""
        pose: list[float] = make_kinematics(self.robot).forward(np.array([AT]))[0].tolist()
        return pose

    def inverse(self, pose: FloatArray, elbow: str) -> list[float]:
        """Return the joints of a pose, of shape (4,), for one elbow."""
        joints: list[float] = make_kinematics(self.robot).solve(pose[np.newaxis], elbow).joints[0].tolist()
        return joints


def _sine_of_rest(sign: int) -> float:
    """Return sin(phi - th1) by eq. 16 at AT, with the sign between its terms."""
    th2, th4 = radians(AT[1]), radians(AT[3])
    return sin(th2) * cos(th4) + sign * cos(th2) * sin(th4)


def _along_first_link_mm(study: TeachingStudy, sign: int) -> float:
    """Return the first coordinate of the tool after a turn by th1 (sign +, multiplied by 0T1) or back by it (-)."""
    x_mm, y_mm = study.pose[:2]
    th1 = radians(AT[0])
    return cos(th1) * x_mm - sign * sin(th1) * y_mm


def _peak_speed(motion: JointMove, axis: int) -> float:
    return float(np.abs(motion.velocities(np.linspace(0.0, DURATION_S, 1001))[:, axis]).max())


def _end_acceleration(motion: JointMove) -> float:
    """Return the largest acceleration of a joint at the start and the end."""
    return float(np.abs(motion.accelerations(np.array([0.0, DURATION_S]))).max())


def _pulses(axis: int, name: str) -> Value[TeachingStudy]:
    return Value(f"pulses of {name} in the samples", "", None, lambda study: pulses(study.robot, study.joints)[axis])


def _numbers(values: FloatArray, decimals: int = 6) -> list[str]:
    return [f"{value:z.{decimals}f}" for value in values.tolist()]


def _sample_rows(study: TeachingStudy) -> list[list[str]]:
    poses = make_kinematics(study.robot).forward(study.joints)
    return [
        [str(k), f"{study.samples_s[k]:g}", *_numbers(study.joints[k, [0, 1, 3]]), *_numbers(poses[k, :2], 3)]
        for k in (0, 10, 20, 33, 50, 60, 66, 67)
    ]


def _elbow_rows(study: TeachingStudy) -> list[list[str]]:
    kinematics = make_kinematics(study.robot)
    rows = []
    for name, joints in (("qa", _QA), ("qb", _QB)):
        pose = kinematics.forward(np.array([joints]))
        for elbow in ("left", "right"):
            branch = kinematics.solve(pose, elbow)
            reached = "yes" if branch.reachable[0] else "no"
            rows.append([name, elbow, reached, *_numbers(np.deg2rad(branch.joints[0, [0, 1, 3]]), 9)])
    return rows


def _motion_panels(study: TeachingStudy) -> tuple[Panel, ...]:
    columns = [
        (
            f"{name} [deg{per}]",
            [
                ("cubic", getattr(study.cubic, derivative)(study.dense_s)[:, axis], "broad"),
                ("quintic", getattr(study.quintic, derivative)(study.dense_s)[:, axis], "broken"),
            ],
        )
        for derivative, per in (("positions", ""), ("velocities", "/s"), ("accelerations", "/s^2"))
        for axis, name in _TURNING
    ]
    return panels_over(study.dense_s, "time [s]", columns)


def _tool_panels(study: TeachingStudy) -> tuple[Panel, ...]:
    kinematics = make_kinematics(study.robot)
    cubic, quintic = (kinematics.forward(motion.positions(study.dense_s)) for motion in (study.cubic, study.quintic))
    over_time = panels_over(
        study.dense_s,
        "time [s]",
        [
            (label, [("cubic", cubic[:, i], "broad"), ("quintic", quintic[:, i], "broken")])
            for i, label in enumerate(("x [mm]", "y [mm]", "z [mm]", "phi [deg]"))
        ],
    )
    fitting = np.array([[250.0, 150.0], [L1_MM, L2_MM]])
    paths = tuple(
        Curve(f"links {l1:g} and {l2:g} mm", *_path(study.cubic.positions(study.dense_s), l1, l2), style)
        for (l1, l2), style in zip(fitting.tolist(), ("broken", "line"), strict=True)
    )
    return (*over_time, Panel("path from above", "x [mm]", "y [mm]", paths))


def _path(joints: FloatArray, l1_mm: float, l2_mm: float) -> tuple[FloatArray, FloatArray]:
    th1, th12 = np.deg2rad(joints[:, 0]), np.deg2rad(joints[:, 0] + joints[:, 1])
    return l1_mm * np.cos(th1) + l2_mm * np.cos(th12), l1_mm * np.sin(th1) + l2_mm * np.sin(th12)


def _link_ratio() -> float:
    """Return l2 / l1 of the arm whose tool is at y = 0 in qb: l1 sin th1 + l2 sin(th1 + th2) = 0."""
    th1, th2, _, _ = GOAL_RAD
    return -sin(th1) / sin(th1 + th2)


def _goal_part() -> float:
    """Return x at qb as a part of the stretched arm's reach, with the links' ratio of those points."""
    th1, th2, _, _ = GOAL_RAD
    ratio = _link_ratio()
    return (cos(th1) + ratio * cos(th1 + th2)) / (1 + ratio)


MECHANISM: Final[Item[TeachingStudy]] = Item(
    "Toolbox rows",
    "lengths, DH parameters and the tool's transform",
    "All rows have alpha = 0, and joint 3 is prismatic. The code has d = +d3, eq. 14 d3 = -p_z; here d3 >= 0 pushes"
    f" down, which is the same at d3 = 0. At th1 = {AT[0]:g}, th2 = {AT[1]:g} deg, d3 = {AT[2]:g} mm, th4 = {AT[3]:g}"
    " deg:",
    values=(
        Value("l1", "mm", L1_MM, lambda study: float(study.robot.geometry["l1_mm"])),
        Value("l2", "mm", L2_MM, lambda study: float(study.robot.geometry["l2_mm"])),
        Value("d4", "mm", D4_MM, lambda study: float(study.robot.geometry["d4_mm"])),
        Value("p_z at d3 = 0", "mm", D4_MM, lambda study: float(transforms(study.robot, np.zeros((1, 4)))[0, 2, 3]),
              1e-9, 3, DERIVED),
    ),
    listings=(
        Listing("The tool's transform", COLUMNS,
                lambda study: matrix_rows(["0T4"], [transforms(study.robot, np.array([AT]))[0]])),
    ),
    not_comparable="the joints' ranges, speeds and motors are not given; ours are assumed and marked [A] in the robot's"
    " file.",
)  # fmt: skip

INVERSE: Final[Item[TeachingStudy]] = Item(
    "Eqs. 10 to 16",
    "the inverse by separation of the variables",
    "px cos th1 + py sin th1 = l1 + l2 cos th2 is the law of cosines in other words. The pseudo-code returns a left"
    " and a right arm, each with a flag that says whether it is within the workspace.",
    values=(
        Value("th1 of the inverse of the forward kinematics", "deg", AT[0],
              lambda study: study.inverse(np.array(study.pose), "right")[0], 1e-9, 9, DERIVED),
        Value("th2", "deg", AT[1], lambda study: study.inverse(np.array(study.pose), "right")[1], 1e-9, 9, DERIVED),
        Value("d3", "mm", AT[2], lambda study: study.inverse(np.array(study.pose), "right")[2], 1e-9, 9, DERIVED),
        Value("th4", "deg", AT[3], lambda study: study.inverse(np.array(study.pose), "right")[3], 1e-9, 9, DERIVED),
    ),
    listings=(
        Listing("Both arms at the experiment's points, in rad as the paper has them",
                ("point", "arm", "within workspace", "th1", "th2", "th4"), _elbow_rows, 3),
    ),
    errata=(
        Erratum("text before eq. 10", "multiply by 0T1", "by its inverse", "eq. 10 does so", (
            Formula("px cos th1 + py sin th1", "mm", lambda study: _along_first_link_mm(study, 1),
                    lambda study: _along_first_link_mm(study, -1),
                    lambda _: L1_MM + L2_MM * cos(radians(AT[1])), "l1 + l2 cos th2"),
        )),
        Erratum("eq. 14", "d3 = -p_z", "d3 = -p_z + d4, downwards", "the code has a tool of d4 = -40", (
            Formula("d3", "mm", lambda study: -study.pose[2], lambda study: -study.pose[2] + D4_MM, lambda _: AT[2],
                    "the joints that made the pose"),
        )),
        Erratum(
            "eq. 16",
            "sin th2 cos th4 - cos th2 sin th4",
            "+ between the terms",
            "eq. 15, and both points of the experiment have th1 + th2 + th4 = 0 within 1e-6 rad",
            (
                Formula("sin(phi - th1)", "", lambda _: _sine_of_rest(-1), lambda _: _sine_of_rest(1),
                        lambda study: sin(radians(study.pose[3] - AT[0])), "the tool's attitude", 6),
            ),
        ),
        Erratum("pseudo-code", 'both results "left arm"; `bool` before calls', "the second is the right arm",
                "the variables' names"),
    ),
)  # fmt: skip

POINTS: Final[Item[TeachingStudy]] = Item(
    "Experiment, points",
    "qa and qb",
    "The program's points are preset. Both have th1 + th2 + th4 = 0: the tool keeps its attitude. With y = 0 at both,"
    " qb needs links of 5 : 3, whose tool goes from 8 to 6 in x; with 95 and 100 mm the goal lies elsewhere. The"
    " joints are used as printed.",
    values=(
        Value("th1 + th2 + th4 at qa", "rad", 0.0, lambda _: sum(START_RAD), 1.5e-6, 6, DERIVED),
        Value("th1 + th2 + th4 at qb", "rad", 0.0, lambda _: sum(GOAL_RAD), 1.5e-6, 6, DERIVED),
        Value("l2 / l1 that puts qb at y = 0", "", 0.6, lambda _: _link_ratio(), 1e-5, 6, DERIVED),
        Value("x at qb, in parts of the stretched arm", "", 6 / 8, lambda _: _goal_part(), 1e-5, 6, DERIVED),
        Value("th1 at qb", "rad", GOAL_RAD[0], lambda _: -acos(13 / 15), 1e-6, 6),
        Value("th2 at qb", "rad", GOAL_RAD[1], lambda _: acos(1 / 15), 1e-6, 6),
        Value("th4 at qb", "rad", GOAL_RAD[3], lambda _: -acos(5 / 9), 1e-6, 6),
        Value("x at qb with 95 and 100 mm", "mm", None, lambda study: _tool_at_goal(study)[0], decimals=6),
        Value("y at qb with 95 and 100 mm", "mm", None, lambda study: _tool_at_goal(study)[1], decimals=6),
        Value("det J at qa", "mm^2", None, lambda _: L1_MM * L2_MM * sin(START_RAD[1]), decimals=3),
    ),
    not_comparable="the lengths of the arm that has the points on a straight line are not given, only their ratio"
    " follows.",
)


def _tool_at_goal(study: TeachingStudy) -> list[float]:
    pose: list[float] = make_kinematics(study.robot).forward(np.array([_QB]))[0].tolist()
    return pose


MOTION: Final[Item[TeachingStudy]] = Item(
    "Fig. 6 and the motion's curves",
    "joints and tool from qa to qb",
    "The text has the cubic a0 + a2 t^2 + a3 t^3 in 1 s. The toolbox that it names interpolates with the quintic"
    " (`jtraj`); both are drawn.",
    values=(
        Value("samples of 0:0.015:1", "", 67, lambda study: len(study.printed_t_s), source=DERIVED),
        Value("a2 of th1", "rad/s^2", None, lambda _: 3 * (GOAL_RAD[0] - START_RAD[0]), decimals=6),
        Value("a3 of th1", "rad/s^3", None, lambda _: -2 * (GOAL_RAD[0] - START_RAD[0]), decimals=6),
        Value("a2 of th2", "rad/s^2", None, lambda _: 3 * (GOAL_RAD[1] - START_RAD[1]), decimals=6),
        Value("a3 of th2", "rad/s^3", None, lambda _: -2 * (GOAL_RAD[1] - START_RAD[1]), decimals=6),
        Value("speed at both ends, cubic", "deg/s", 0.0,
              lambda study: float(np.abs(study.cubic.velocities(np.array([0.0, DURATION_S]))).max()), 1e-9, 6),
        Value("peak speed of th2, cubic", "deg/s", None, lambda study: _peak_speed(study.cubic, 1),
              decimals=6),
        Value("peak speed of th2, quintic", "deg/s", None, lambda study: _peak_speed(study.quintic, 1),
              decimals=6),
        Value("peak speed of th2, `jtraj` in the 0.99 s of its samples", "deg/s", None,
              lambda study: _peak_speed(study.quintic, 1) / float(study.printed_t_s[-1]), decimals=6),
        Value("acceleration at both ends, quintic", "deg/s^2", 0.0, lambda study: _end_acceleration(study.quintic),
              1e-9, 6),
        *(_pulses(axis, name) for axis, name in _TURNING),
        Value("tool off with joints in whole steps, max", "mm", None,
              lambda study: float(tool_off_mm(study.robot, in_whole_steps(study.robot, study.joints),
                                              study.joints).max()), decimals=6),
        *tool_values(lambda study: study.outcome),
    ),
    listings=(
        Listing("Samples of the cubic", ("k", "t s", "th1 deg", "th2 deg", "th4 deg", "x mm", "y mm"), _sample_rows),
        run_listing("carry", lambda study: study.outcome),
    ),
    errata=(
        Erratum(
            "accelerations 0 at both ends",
            "with a cubic",
            "needs the quintic",
            "a cubic has 6 dq / T^2 there, 517 deg/s^2 for th2",
            (
                Formula("largest acceleration at an end, by the cubic and by the quintic", "deg/s^2",
                        lambda study: _end_acceleration(study.cubic),
                        lambda study: _end_acceleration(study.quintic), lambda _: 0.0, "the paper's own demand"),
            ),
        ),
        Erratum(
            "sampling 0:0.015:1",
            '"1 s"',
            "ends at 0.99 s, where th2 still lacks 0.026 degrees",
            "1 / 0.015 is not a whole number; `jtraj` rescales time instead",
            (
                Formula("th2 at the last sample, of 0:0.015:1 and with t = 1 added", "deg",
                        lambda study: float(study.joints[-2, 1]), lambda study: float(study.joints[-1, 1]),
                        lambda _: degrees(GOAL_RAD[1]), "qb", 6),
            ),
        ),
        Erratum("time law", "a cubic in the text", "the figures probably show a quintic",
                "the toolbox that is named makes quintics (`jtraj`)"),
    ),
    pictures=(
        Plot("fig-6-joints", "Position, speed and acceleration of the joints", _motion_panels, columns=3),
        Plot("tool", "The tool's pose, and its path with the links that fit the points", _tool_panels, columns=3),
        RunPicture("carry", "tool-pose", "The tool's pose and direction cosines by the plan of the run"),
        RunPicture("carry", "tool-path", "The tool's path by the counted steps"),
    ),
    not_comparable="no numbers are known of the figures' axes.",
)  # fmt: skip

PAPER: Final = Paper(
    "teaching-scara",
    'Yao Xiaotong, Pan Yingli, Gao Yu, "Research and Implementation of SCARA Manipulator Control Algorithm in'
    ' Experimental Teaching", 2017, DOI 10.3969/j.issn.1000-386x.2017.06.019.',
    TeachingStudy,
    (MECHANISM, INVERSE, POINTS, MOTION),
)
