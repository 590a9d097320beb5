"""The classroom robot's paper, item by item.

X. Yao, Y. Pan, Y. Gao, "Research and Implementation of SCARA Manipulator Control Algorithm in Experimental Teaching",
2017, DOI 10.3969/j.issn.1000-386x.2017.06.019.
"""

from dataclasses import dataclass
from functools import cached_property
from math import cos, degrees, radians, sin
from typing import Final

import numpy as np

from steptwin.host.common.arrays import FloatArray
from steptwin.host.planning.jobs.carry import GOAL_RAD, START_RAD
from steptwin.host.planning.laws import Cubic, Quintic
from steptwin.host.planning.motions.joint_move import JointMove
from steptwin.host.robots.kinematics import make_kinematics
from steptwin.host.studies.papers.drawing import COLUMNS, dh_listing, link_rows
from steptwin.host.studies.papers.paper import (
    Coverage,
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
    alone,
    dimension,
    result,
    run_listing,
    self_check,
    tool_values,
)
from steptwin.host.studies.papers.study import (
    Study,
    arm_picture,
    frames_picture,
    in_whole_steps,
    panels_over,
    pulses,
    tool_off_mm,
)
from steptwin.host.twin.embedded.outcome import Outcome

L1_MM: Final = 95.0
L2_MM: Final = 100.0
D4_MM: Final = -40.0
DURATION_S: Final = 1.0
STEP_S: Final = 0.015
AT: Final = (30.0, 60.0, 20.0, 15.0)
"""th1, th2, d3, th4 where formulas are computed."""
SHOWN: Final = (20.0, 50.0, 20.0, 30.0)
"""Joints at which frames can be told apart in a picture."""
GRIPPED: Final = "the gripper switches where the object would be; no object is emulated"
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


def _peak_speed(motion: JointMove, axis: int) -> float:
    return float(np.abs(motion.velocities(np.linspace(0.0, DURATION_S, 1001))[:, axis]).max())


def _end_acceleration(motion: JointMove) -> float:
    """Return the largest acceleration of a joint at the start and the end."""
    return float(np.abs(motion.accelerations(np.array([0.0, DURATION_S]))).max())


def _pulses(axis: int, name: str) -> Value[TeachingStudy]:
    return alone(f"pulses of {name} in the samples", "", lambda study: pulses(study.robot, study.joints)[axis])


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
            for i, label in enumerate(("x [mm]", "y [mm]"))
        ],
    )
    path = Curve("path", *_path(study.cubic.positions(study.dense_s)))
    return (*over_time, Panel("", "x [mm]", "y [mm]", (path,), true_to_scale=True))


def _path(joints: FloatArray) -> tuple[FloatArray, FloatArray]:
    th1, th12 = np.deg2rad(joints[:, 0]), np.deg2rad(joints[:, 0] + joints[:, 1])
    return L1_MM * np.cos(th1) + L2_MM * np.cos(th12), L1_MM * np.sin(th1) + L2_MM * np.sin(th12)


def _link_ratio() -> float:
    """Return l2 / l1 of the arm whose tool is at y = 0 in qb: l1 sin th1 + l2 sin(th1 + th2) = 0."""
    th1, th2, _, _ = GOAL_RAD
    return -sin(th1) / sin(th1 + th2)


def _goal_part() -> float:
    """Return x at qb as a part of the stretched arm's reach, with the links' ratio of those points."""
    th1, th2, _, _ = GOAL_RAD
    ratio = _link_ratio()
    return (cos(th1) + ratio * cos(th1 + th2)) / (1 + ratio)


def _coefficient_rows(_: TeachingStudy) -> list[list[str]]:
    """Return a row for each joint that turns: eqs. 25 to 28 with T = 1 s."""
    rows = []
    for axis, name in _TURNING:
        way = GOAL_RAD[axis] - START_RAD[axis]
        rows.append([name, *(f"{value:z.6f}" for value in (START_RAD[axis], 0.0, 3 * way, -2 * way))])
    return rows


def _at_goal(axis: int, name: str, paper: float) -> Value[TeachingStudy]:
    return result(
        "sect. 3, qb",
        f"{name} at the end of the motion",
        "rad",
        paper,
        lambda study: radians(float(study.cubic.positions(np.array([DURATION_S]))[0, axis])),
        1e-9,
        6,
    )


def _tool_at_goal(study: TeachingStudy) -> list[float]:
    pose: list[float] = make_kinematics(study.robot).forward(np.array([_QB]))[0].tolist()
    return pose


MECHANISM: Final[Item[TeachingStudy]] = Item(
    "Figs. 1, 2, table 1, sect. 3 code",
    "structure, frames and DH parameters",
    "All rows have alpha = 0, and joint 3 is prismatic. The code has d = +d3, eq. 14 d3 = -p_z; here d3 >= 0 pushes"
    " down, which is the same at d3 = 0.",
    parts=(
        Part("fig. 1", "structure of the arm", "picture below: the mechanism in space, without the bodies' shapes"),
        Part("fig. 2", "link frames", "picture below, from the code's rows"),
        Part("table 1", "DH parameters, as the code's `link` rows", "dimensions and table below"),
        Part("fig. 3", "toolbox model and its sliders, `drivebot`", "picture below; the panel's Jog and Move",
             Coverage.PARTLY, "the toolbox itself is not driven"),
    ),
    values=(
        dimension("sect. 3, code", "l1", "mm", 95.0, lambda study: float(study.robot.geometry["l1_mm"])),
        dimension("sect. 3, code", "l2", "mm", 100.0, lambda study: float(study.robot.geometry["l2_mm"])),
        dimension("sect. 3, code", "d4", "mm", -40.0, lambda study: float(study.robot.geometry["d4_mm"])),
    ),
    listings=(dh_listing("teaching-scara", "Table 1, from the code's rows: DH parameters"),),
    left_open=(
        Gap("fig. 1", "the joints' ranges, speeds and motors", "assumed, marked [A] in the robot's file"),
    ),
    lost=(Gap("table 1", "the table's cells", "the code's `link` rows have the same numbers"),),
    pictures=(
        Sketch("fig. 1", "fig-1-arm", "the arm at home", arm_picture),
        Sketch("figs. 2, 3", "fig-2-frames", "link frames of table 1", frames_picture(SHOWN)),
    ),
)  # fmt: skip

FORWARD: Final[Item[TeachingStudy]] = Item(
    "Sect. 2.1: eqs. 1 to 8",
    "forward kinematics",
    f"At th1 = {AT[0]:g}, th2 = {AT[1]:g} deg, d3 = {AT[2]:g} mm, th4 = {AT[3]:g} deg, as `steptwin fk teaching-scara"
    " 30 60 20 15 --matrices` prints them too:",
    parts=(
        Part("eqs. 1 to 4", "the links' transforms and their product", "T1 to T4 and 0T4 below"),
        Part("eqs. 5 to 8", "the tool's position", "self-checks below"),
    ),
    values=(
        self_check("p_x = l1 cos th1 + l2 cos(th1 + th2)", "mm", 82.272413, lambda study: study.pose[0], 1e-6, 6),
        self_check("p_y = l1 sin th1 + l2 sin(th1 + th2)", "mm", 147.5, lambda study: study.pose[1], 1e-6, 6),
        self_check("p_z = d4 - d3", "mm", -60.0, lambda study: study.pose[2], 1e-9, 6),
    ),
    listings=(
        Listing("Eqs. 1 to 4: the links' transforms and their product", COLUMNS,
                lambda study: link_rows(study.robot, AT)),
    ),
    lost=(Gap("eqs. 1 to 8", "the formulas", "the product of the code's rows"),),
)  # fmt: skip

INVERSE: Final[Item[TeachingStudy]] = Item(
    "Sects. 2.2, 4.2: eqs. 9 to 17, algorithm",
    "the inverse by separation of the variables, and the host's two functions",
    "px cos th1 + py sin th1 = l1 + l2 cos th2 is the law of cosines in other words. The algorithm at the end of the"
    " paper returns a left and a right arm, each with a flag that says whether it is within the workspace.",
    parts=(
        Part("eqs. 9 to 13", "th1, th2", "self-checks below"),
        Part("eq. 14", "d3", "self-check below; misprint computed"),
        Part("eqs. 15 to 17", "th4", "self-check below; misprint computed"),
        Part("sect. 4.2, algorithm", "`robot_forward`, `robot_inverse` with flags",
             "`forward` and `inverse` in `host/robots/host_functions.py`; table below"),
    ),
    values=(
        self_check("th1 of the inverse of the forward kinematics", "deg", AT[0],
                   lambda study: study.inverse(np.array(study.pose), "right")[0], 1e-9, 9),
        self_check("th2", "deg", AT[1], lambda study: study.inverse(np.array(study.pose), "right")[1], 1e-9, 9),
        self_check("d3", "mm", AT[2], lambda study: study.inverse(np.array(study.pose), "right")[2], 1e-9, 9),
        self_check("th4", "deg", AT[3], lambda study: study.inverse(np.array(study.pose), "right")[3], 1e-9, 9),
    ),
    listings=(
        Listing("Both arms at the experiment's points, in rad as the paper has them",
                ("point", "arm", "within workspace", "th1", "th2", "th4"), _elbow_rows, 3),
    ),
    errata=(
        Erratum("sect. 2.2, sentence before eq. 10", "multiply both sides by 0T1", "by its inverse",
                "eq. 10, and the sentence after eq. 9"),
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
        Erratum("sect. 4.2, algorithm", 'both results "left arm"; `bool` before calls', "the second is the right arm",
                "the variables' names"),
    ),
    lost=(Gap("eqs. 9, 13, 17", "the formulas", "solved from eqs. 10 to 16"),),
)  # fmt: skip

CUBIC: Final[Item[TeachingStudy]] = Item(
    "Sect. 2.3: eqs. 18 to 28",
    "the cubic",
    "a0 + a1 t + a2 t^2 + a3 t^3 with speed 0 at both ends; with T = 1 s from qa to qb:",
    parts=(Part("eqs. 18 to 28", "the cubic and its coefficients", "table below"),),
    values=(
        result("eqs. 22, 24", "speed at both ends, cubic", "deg/s", 0.0,
               lambda study: float(np.abs(study.cubic.velocities(np.array([0.0, DURATION_S]))).max()), 1e-9, 6),
    ),
    listings=(Listing("Eqs. 25 to 28", ("joint", "a0 rad", "a1 rad/s", "a2 rad/s^2", "a3 rad/s^3"),
                      _coefficient_rows),),
    lost=(Gap("eqs. 19, 20, 22, 24, 27, 28", "the formulas", "the cubic that eqs. 18, 21, 23, 25, 26 determine"),),
)  # fmt: skip

MOTION: Final[Item[TeachingStudy]] = Item(
    "Sect. 3: figs. 4 to 6",
    "joints and tool from qa to qb",
    "Both points have th1 + th2 + th4 = 0: the tool keeps its attitude. The joints are used as printed. The toolbox"
    " that the paper names also has a quintic (`jtraj`), which is drawn beside the cubic. d3 stays 0 and is not drawn.",
    parts=(
        Part("sect. 3", "qa, qb, t = 0:0.015:1", "results below; job `carry`"),
        Part("fig. 4", "angles over time", "first row of the picture below"),
        Part("fig. 5", "speeds over time", "second row of the picture below"),
        Part("fig. 6", "accelerations over time", "third row of the picture below"),
        Part("sect. 3", "smooth from start to end", "the run of `carry`: no check failed"),
    ),
    values=(
        _at_goal(0, "th1", -0.522315),
        _at_goal(1, "th2", 1.504080),
        _at_goal(3, "th4", -0.981765),
        self_check("samples of 0:0.015:1", "", 67, lambda study: len(study.printed_t_s)),
        self_check("th1 + th2 + th4 at qa", "rad", 0.0, lambda _: sum(START_RAD), 1.5e-6, 6),
        self_check("th1 + th2 + th4 at qb", "rad", 0.0, lambda _: sum(GOAL_RAD), 1.5e-6, 6),
        alone("l2 / l1 of an arm that has qb at y = 0", "", lambda _: _link_ratio(), 6),
        alone("x at qb of that arm, in parts of the stretched arm", "", lambda _: _goal_part(), 6),
        alone("x at qb with 95 and 100 mm", "mm", lambda study: _tool_at_goal(study)[0], 6),
        alone("y at qb with 95 and 100 mm", "mm", lambda study: _tool_at_goal(study)[1], 6),
        alone("det J at qa", "mm^2", lambda _: L1_MM * L2_MM * sin(START_RAD[1]), 3),
        alone("peak speed of th2, cubic", "deg/s", lambda study: _peak_speed(study.cubic, 1), 6),
        alone("peak speed of th2, quintic", "deg/s", lambda study: _peak_speed(study.quintic, 1), 6),
        alone("peak speed of th2, `jtraj` in the 0.99 s of its samples", "deg/s",
              lambda study: _peak_speed(study.quintic, 1) / float(study.printed_t_s[-1]), 6),
        alone("largest acceleration at an end, cubic", "deg/s^2", lambda study: _end_acceleration(study.cubic), 6),
        *(_pulses(axis, name) for axis, name in _TURNING),
        alone("tool off with joints in whole steps, max", "mm",
              lambda study: float(tool_off_mm(study.robot, in_whole_steps(study.robot, study.joints),
                                              study.joints).max()), 6),
        *tool_values(lambda study: study.outcome),
    ),
    listings=(
        Listing("Samples of the cubic", ("k", "t s", "th1 deg", "th2 deg", "th4 deg", "x mm", "y mm"), _sample_rows),
        run_listing("carry", lambda study: study.outcome),
    ),
    errata=(
        Erratum(
            "sect. 3, t = [0:0.015:1]",
            "samples up to 1",
            "the last one is at 0.99, where th2 still lacks 0.026 degrees",
            "1 / 0.015 is not a whole number",
            (
                Formula("th2 at the last sample, of 0:0.015:1 and with t = 1 added", "deg",
                        lambda study: float(study.joints[-2, 1]), lambda study: float(study.joints[-1, 1]),
                        lambda _: degrees(GOAL_RAD[1]), "qb", 6),
            ),
        ),
    ),
    left_open=(
        Gap("sect. 3", "the lengths of the arm in qa and qb: with 95 and 100 mm the goal lies off y = 0",
            "95 and 100 mm of the code; an arm with links of 5 : 3 would have both points on a line"),
        Gap("figs. 4 to 6", "whether the curves are the text's cubic or the toolbox' quintic", "both are drawn"),
    ),
    lost=(Gap("figs. 4 to 6", "the figures, and so their axes", "the shapes follow from eqs. 18 to 28"),),
    pictures=(
        Plot("figs. 4, 5, 6", "fig-4-5-6-joints", "angle, speed and acceleration of the joints", _motion_panels,
             columns=3),
        Plot("sect. 3", "tool", "the tool's position over time, and its path from above", _tool_panels, columns=3),
        RunPicture("sect. 3", "carry", "tool-pose", "the tool's pose and direction cosines by the plan of the run"),
        RunPicture("sect. 3", "carry", "tool-path", "the tool's path by the counted steps"),
    ),
)  # fmt: skip

HARDWARE: Final[Item[TeachingStudy]] = Item(
    "Sects. 4.1, 4.2: figs. 7 to 10",
    "control system, host program, test of the real arm",
    "The panel of a served board, `steptwin serve teaching-scara --panel`, is what fig. 9 shows. In the paper's test of"
    " the real arm speed and acceleration are zero at both ends by default: that belongs to the test, not to the cubic"
    " of the simulation; `-o law=quintic` moves so.",
    parts=(
        Part("sect. 4.1, figs. 7, 8", "PC, control card with an FPGA for several steppers", "board on CAN, every pulse"
             " verified", Coverage.PARTLY, "an STM32 board on CAN instead of a card on USB with a DLL"),
        Part("sect. 4.2", "parameters: the arm's lengths", "the robot's file; limits, speeds, currents in the panel's"
             " Settings", Coverage.PARTLY, "lengths are in the robot's file only"),
        Part("sect. 4.2", "forward module", "`steptwin fk`; the panel's Move, Joints shows where the arm will stand",
             Coverage.PARTLY, "the panel draws the pose, and does not write it beside the fields"),
        Part("sect. 4.2", "inverse module", "the panel's Move, Tool pose: right and left arm; `steptwin ik`"),
        Part("sect. 4.2", "motion control, result, path shown", "the panel's Run, Preview and Result"),
        Part("fig. 9", "open the device, start", "the panel's Switch on, Home all"),
        Part("fig. 9", "pick up, put down", "the panel's Outputs: gripper on and off"),
        Part("fig. 9", "emergency stop", "the panel's E-STOP; `docs/live.md`"),
        Part("fig. 9", "number of runs, pause, start", "the panel's Run: cycles, pause, resume"),
        Part("fig. 9", "each axis by itself, with its direction", "the panel's Jog"),
        Part("sect. 4.2, fig. 10", "test: points reached, object carried", "job `carry` with grips, `-o depth_mm=20`",
             Coverage.PARTLY, GRIPPED),
        Part("sect. 4.2", "in the test speed and acceleration 0 at both ends", "`carry -o law=quintic`; result below"),
        Part("conclusion", "information in real time, remote control", "the panel's plots; `--connect`"),
    ),
    values=(
        result("sect. 4.2", "largest acceleration at an end in the test, law quintic", "deg/s^2", 0.0,
               lambda study: _end_acceleration(study.quintic), 1e-9, 6),
        result("sect. 4.2", "largest speed at an end in the test, law quintic", "deg/s", 0.0,
               lambda study: float(np.abs(study.quintic.velocities(np.array([0.0, DURATION_S]))).max()), 1e-9, 6),
    ),
    lost=(Gap("figs. 7 to 10", "the photographs", "the panel's pictures in docs/panel.md"),),
)  # fmt: skip

PAPER: Final = Paper(
    "teaching-scara",
    'Yao Xiaotong, Pan Yingli, Gao Yu, "Research and Implementation of SCARA Manipulator Control Algorithm in'
    ' Experimental Teaching", 2017, DOI 10.3969/j.issn.1000-386x.2017.06.019.',
    TeachingStudy,
    (MECHANISM, FORWARD, INVERSE, CUBIC, MOTION, HARDWARE),
)
