"""The warehouse robot's paper, figure by figure.

A. Jiang, L. Guo, X. Tan, "Development of Prototype of a New Intelligent Warehouse Robot", 2019,
DOI 10.3969/j.issn.1009-9492.2019.05.018.
"""

from dataclasses import dataclass
from functools import cached_property
from math import cos, hypot, nan, radians, sin
from typing import Final

import numpy as np

from steptwin.host.common.arrays import FloatArray
from steptwin.host.planning.jobs import make_job
from steptwin.host.planning.laws import Trapezoid
from steptwin.host.robots.kinematics import make_kinematics
from steptwin.host.studies.papers.drawing import COLUMNS, matrix_rows
from steptwin.host.studies.papers.paper import (
    DERIVED,
    READ_OFF,
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

L2_MM: Final = 200.0
L3_MM: Final = 150.0
L4_MM: Final = 40.0
START_DEG: Final = (0.0, 60.0, 30.0)
TRAVEL_MM: Final = 180.0
DURATION_S: Final = 10.0
RAMP_S: Final = 2.0
"""t1: assumed, the paper has none."""
COMPARTMENT_MM: Final = 60.0
"""Length of a compartment: a third of the drawer."""
_SAMPLES: Final = 1001
_READ_MM: Final = 0.5
_READ_DEG: Final = 0.5
"""How exactly whole millimetres and degrees can be read off an axis."""

X_MM: Final = L2_MM * cos(radians(0)) + L3_MM * cos(radians(60)) + L4_MM * cos(radians(90))
Y_MM: Final = L2_MM * sin(radians(0)) + L3_MM * sin(radians(60)) + L4_MM * sin(radians(90))
"""The tool at the start."""


@dataclass(frozen=True)
class WarehouseStudy(Study):
    """What the items share: the robot, the drawer pull at the paper's samples, and the runs."""

    robot_name = "warehouse-scara"

    @cached_property
    def t_s(self) -> FloatArray:
        """The paper's samples: 1000 intervals in 10 s."""
        return np.linspace(0.0, DURATION_S, _SAMPLES)

    @cached_property
    def joints(self) -> FloatArray:
        """Joints at the samples, of shape (1001, 6)."""
        return make_job(self.robot, "drawer-pull").positions(self.t_s)

    @cached_property
    def poses(self) -> FloatArray:
        """The tool's poses at the samples, of shape (1001, 4)."""
        return make_kinematics(self.robot).forward(self.joints)

    @cached_property
    def law(self) -> Trapezoid:
        """The law of the job: trapezoidal speed."""
        return Trapezoid(TRAVEL_MM, DURATION_S, RAMP_S)

    @cached_property
    def printed_joints(self) -> FloatArray:
        """Joints at the samples by the paper's inverse, its second x replaced by y: it still loses the sign of y."""
        wrist_y_mm = self.poses[:, 1] - L4_MM
        alpha_deg = np.rad2deg(np.arctan2(wrist_y_mm, X_MM))
        joints = self.joints.copy()
        joints[:, 3] += np.abs(alpha_deg) - alpha_deg
        joints[:, 5] = 90.0 - joints[:, 3] - joints[:, 4]
        return joints

    def position_mm(self, t_s: float) -> float:
        """Return how far the drawer is out at an instant."""
        return float(self.law.position(np.array([t_s]))[0])


def printed_position_mm(t_s: float) -> float:
    """Return S_x(t) as printed: twice the first branch, and the second one again for the third."""
    speed_mm_s = TRAVEL_MM / (DURATION_S - RAMP_S)
    if t_s <= RAMP_S:
        return speed_mm_s * t_s**2 / RAMP_S
    return speed_mm_s * (t_s - RAMP_S / 2)


def corrected_position_mm(t_s: float) -> float:
    """Return S_x(t) as corrected."""
    speed_mm_s = TRAVEL_MM / (DURATION_S - RAMP_S)
    if t_s <= RAMP_S:
        return speed_mm_s * t_s**2 / (2 * RAMP_S)
    if t_s <= DURATION_S - RAMP_S:
        return speed_mm_s * (t_s - RAMP_S / 2)
    return TRAVEL_MM - speed_mm_s * (DURATION_S - t_s) ** 2 / (2 * RAMP_S)


def _cos_beta(second_mm: float) -> float:
    """Return cos beta at the start, with x or y in the second bracket."""
    square = (X_MM - L4_MM * cos(radians(90))) ** 2 + (second_mm - L4_MM * sin(radians(90))) ** 2
    return float((square + L2_MM**2 - L3_MM**2) / (2 * L2_MM * square**0.5))


def _cos_between_link_and_wrist(study: WarehouseStudy) -> float:
    """Return the cosine of the angle at the shoulder between the first link and the line to the wrist, from FK."""
    x_mm, y_mm = study.poses[0, :2].tolist()
    wrist = (x_mm, y_mm - L4_MM)
    th1 = radians(float(study.joints[0, 3]))
    return float(cos(th1) * wrist[0] + sin(th1) * wrist[1]) / hypot(*wrist)


def _arc_cosine_deg(cosine: float) -> float:
    return float(np.rad2deg(np.arccos(cosine))) if abs(cosine) <= 1 else nan


def _off_line_mm(study: WarehouseStudy) -> float:
    """Return how far the last pose is from where the law puts it."""
    x_mm, y_mm = study.poses[-1, :2].tolist()
    return hypot(x_mm - X_MM, y_mm - (Y_MM - TRAVEL_MM))


def _time_out_s(study: WarehouseStudy, compartments: int) -> float:
    """Return when so many compartments are out, by the tool's own way, linear between the samples."""
    out_mm = study.poses[0, 1] - study.poses[:, 1]
    return float(np.interp(COMPARTMENT_MM * compartments, out_mm, study.t_s))


def _peak(study: WarehouseStudy, axis: int) -> float:
    return float(np.abs(np.diff(study.joints[:, axis])).max() / (DURATION_S / (_SAMPLES - 1)))


def _joint_rows(study: WarehouseStudy) -> list[list[str]]:
    return [
        [f"{study.t_s[k]:g}", f"{study.poses[k, 1]:z.3f}", *(f"{angle:z.6f}" for angle in study.joints[k, 3:])]
        for k in range(0, _SAMPLES, 100)
    ]


def _pose_panels(study: WarehouseStudy) -> tuple[Panel, ...]:
    names = ("x [mm]", "y [mm]", "z [mm]", "phi [deg]")
    printed = make_kinematics(study.robot).forward(study.printed_joints)
    columns = [
        (name, [("corrected", study.poses[:, i], "broad"), ("alpha by arc cosine", printed[:, i], "broken")])
        for i, name in enumerate(names)
    ]
    return panels_over(study.t_s, "time [s]", columns)


def _law_panels(study: WarehouseStudy) -> tuple[Panel, ...]:
    printed, corrected = (
        np.array([law(float(t_s)) for t_s in study.t_s]) for law in (printed_position_mm, corrected_position_mm)
    )
    return (
        Panel("the drawer's way S(t)", "time [s]", "S [mm]",
              (Curve("corrected", study.t_s, corrected, "broad"), Curve("as printed", study.t_s, printed, "broken"))),
        Panel("its speed", "time [s]", "dS/dt [mm/s]",
              (Curve("corrected", study.t_s, study.law.velocity(study.t_s)),)),
    )  # fmt: skip


def _joint_panels(study: WarehouseStudy) -> tuple[Panel, ...]:
    left = make_job(study.robot, "drawer-pull", {"elbow": "left"}).positions(study.t_s)
    columns = [
        (f"{name} [deg]", [("elbow right", study.joints[:, axis], "line"), ("elbow left", left[:, axis], "broken"),
                           ("alpha by arc cosine", study.printed_joints[:, axis], "broken")])
        for axis, name in ((3, "th1"), (4, "th2"), (5, "th3"))
    ]  # fmt: skip
    return panels_over(study.t_s, "time [s]", columns)


def _arm_panels(study: WarehouseStudy) -> tuple[Panel, ...]:
    """Return the arm from above as the drawer is shut and after each of its compartments."""
    k = [0, *(round(_time_out_s(study, n) * 100) for n in (1, 2, 3))]
    joints_rad = np.deg2rad(study.joints[k][:, 3:].cumsum(axis=1))
    ends = (L2_MM, L3_MM, L4_MM) * np.exp(1j * joints_rad)
    points = np.column_stack([np.zeros(len(k)), ends.cumsum(axis=1)])
    curves = tuple(
        Curve("shut" if n == 0 else f"{COMPARTMENT_MM * n:g} mm out", arm.real, arm.imag)
        for n, arm in enumerate(points)
    )
    return (Panel("the arm from above, joints to the tool's tip", "x [mm]", "y [mm]", curves, true_to_scale=True),)


def _switch_rows(study: WarehouseStudy) -> list[list[str]]:
    return [
        [job, output.name, "on" if output.on else "off", f"{output.changed_s:.3f}"]
        for job in ("store", "fetch")
        for output in study.run_of(job).report.outputs
    ]


def _dimension(key: str, what: str, paper: float) -> Value[WarehouseStudy]:
    return Value(what, "mm", paper, lambda study: float(study.robot.geometry[key]))


MECHANISM: Final[Item[WarehouseStudy]] = Item(
    "Mechanism",
    "lengths and the lift's range",
    values=(
        _dimension("L2_mm", "L2", L2_MM),
        _dimension("L3_mm", "L3", L3_MM),
        _dimension("L4_mm", "L4", L4_MM),
        Value("L1, least", "mm", 50.0, lambda study: study.robot.joint("L1").lower),
        Value("L1, greatest", "mm", 200.0, lambda study: study.robot.joint("L1").upper),
        Value("joints of the arm, with its lift", "", 4, lambda study: len(study.robot.joints) - 2),
    ),
    not_comparable="the slides' strokes and speeds, the rotary joints' ranges and the motors are not given; ours are"
    " assumed and marked [A] in the robot's file.",
)

FORWARD: Final[Item[WarehouseStudy]] = Item(
    "Forward kinematics",
    "DH parameters and the tool's transform",
    "At the start of the experiment, th1 = 0, th2 = 60, th3 = 30 deg, with the lift at 100 mm and the slides at 0:",
    listings=(
        Listing("The tool's transform", COLUMNS,
                lambda study: matrix_rows(["tool"], [transforms(study.robot, study.joints[:1])[0]])),
    ),
    errata=(
        Erratum(
            "forward kinematics",
            "L5, never defined",
            "L5 = L4 = 40",
            "the motion starts at y = 129.904 + L5, and the figure shows 170 there and -10 at the end",
            (
                Formula("y at the start, without L5 and with it", "mm", lambda _: Y_MM - L4_MM, lambda _: Y_MM,
                        lambda _: 170.0, "the figure's 170, read off to 0.5 mm", 3, _READ_MM),
            ),
        ),
    ),
)  # fmt: skip

INVERSE: Final[Item[WarehouseStudy]] = Item(
    "Inverse kinematics",
    "the joints of a pose",
    "The inverse as printed has no value at the start. With y in place of its second x it is right until the wrist"
    " crosses y = 0; from there the arc cosine takes it to the wrong side.",
    values=(
        Value("th1 of the start", "deg", START_DEG[0], lambda study: float(study.joints[0, 3]), 1e-9, 9),
        Value("th2 of the start", "deg", START_DEG[1], lambda study: float(study.joints[0, 4]), 1e-9, 9),
        Value("th3 of the start", "deg", START_DEG[2], lambda study: float(study.joints[0, 5]), 1e-9, 9),
        Value("time at which the wrist crosses y = 0", "s", None,
              lambda study: float(np.interp(0.0, L4_MM - study.poses[:, 1], study.t_s)), decimals=3),
    ),
    errata=(
        Erratum(
            "inverse, cos alpha and cos beta, three places",
            "(x - l3 cos phi)^2 + (x - l3 sin phi)^2",
            "y in the second bracket",
            "as printed cos beta = 1.025 at the start pose",
            (
                Formula("cos beta at the start", "", lambda _: _cos_beta(X_MM), lambda _: _cos_beta(Y_MM),
                        _cos_between_link_and_wrist, "the angle between link and wrist in the forward kinematics", 6),
                Formula("beta at the start", "deg", lambda _: _arc_cosine_deg(_cos_beta(X_MM)),
                        lambda _: _arc_cosine_deg(_cos_beta(Y_MM)),
                        lambda study: _arc_cosine_deg(_cos_between_link_and_wrist(study)), "the same", 6),
            ),
        ),
        Erratum(
            "inverse, alpha = acos(...)",
            "loses the sign of y",
            "alpha = atan2(yw, xw)",
            "the wrist crosses y = 0 at 6.78 s of the pull; from there the error grows to 100.19 mm",
            (
                Formula("tool off the drawer's line at the end", "mm",
                        lambda study: float(tool_off_mm(study.robot, study.printed_joints, study.joints)[-1]),
                        _off_line_mm, lambda _: 0.0, "the prescribed line", 6),
            ),
        ),
        Erratum(
            "inverse, beta and theta2 by acos",
            "one elbow",
            "the branch s = -1 as well",
            "geometry",
        ),
    ),
)  # fmt: skip


LAW: Final[Item[WarehouseStudy]] = Item(
    "Trajectory law",
    "trapezoidal speed, S_x(t)",
    f"S = {TRAVEL_MM:g} mm in T = {DURATION_S:g} s; the ramps of t1 = {RAMP_S:g} s are assumed. With v = S / (T - t1)"
    " the corrected law is v t^2 / (2 t1) up to t1, v (t - t1 / 2) up to T - t1, and S - v (T - t)^2 / (2 t1) then.",
    values=(
        Value("T", "s", 10.0, lambda study: study.run_of("drawer-pull").report.run.duration_s, 1e-9, 3),
        Value("way of the drawer", "mm", TRAVEL_MM, lambda study: study.position_mm(DURATION_S), 1e-9, 6),
        Value("speed between the ramps", "mm/s", None, lambda study: study.law.speed, decimals=3),
    ),
    errata=(
        Erratum(
            "S_x(t), first branch",
            "S t^2 / ((T - t1) t1)",
            "half of it",
            "as printed the position jumps from 45 to 22.5 mm at t1",
            (
                Formula("S at t1, the end of the first branch", "mm", lambda _: printed_position_mm(RAMP_S),
                        lambda _: corrected_position_mm(RAMP_S), lambda _: _swept_mm(RAMP_S),
                        "the area under the trapezoid of the speed"),
            ),
        ),
        Erratum(
            "S_x(t), third branch",
            "the second one again",
            "S - v (T - t)^2 / (2 t1)",
            "as printed the drawer ends at 202.5 mm, in the figure at 180",
            (
                Formula("S at T", "mm", lambda _: printed_position_mm(DURATION_S),
                        lambda _: corrected_position_mm(DURATION_S), lambda _: _swept_mm(DURATION_S),
                        "the area under the trapezoid of the speed"),
                Formula("S at T - t1 / 2", "mm", lambda _: printed_position_mm(DURATION_S - RAMP_S / 2),
                        lambda _: corrected_position_mm(DURATION_S - RAMP_S / 2),
                        lambda _: _swept_mm(DURATION_S - RAMP_S / 2), "the same"),
            ),
        ),
        Erratum("S_x(t), conditions", "on x", "on t", "the text"),
        Erratum(
            "1000 points",
            "T = 10 with a step of 0.001",
            "a step of 0.01",
            "T / step is 10 000; 1000 steps of 0.001 s make 1 s",
            (
                Formula("time of 1000 steps", "s", lambda _: 1000 * 0.001, lambda _: 1000 * 0.01, lambda _: DURATION_S,
                        "the stated T"),
            ),
        ),
    ),
    pictures=(Plot("law", "The law of the way as printed and as corrected", _law_panels),),
)  # fmt: skip


def _swept_mm(until_s: float) -> float:
    """Return the area under the trapezoid of the speed, whose own area is the drawer's way, up to an instant."""
    corners_s = (0.0, RAMP_S, DURATION_S - RAMP_S, DURATION_S)
    t_s = np.union1d([t for t in corners_s if t < until_s], [until_s])
    shape = np.interp(t_s, corners_s, (0.0, 1.0, 1.0, 0.0))
    return TRAVEL_MM * float(np.trapezoid(shape, t_s)) / (DURATION_S - RAMP_S)


TOOL: Final[Item[WarehouseStudy]] = Item(
    "Fig. 6",
    "the tool over time: straight along -y at constant attitude",
    "The picture also shows where the tool goes with the arc cosine of the printed inverse.",
    values=(
        Value("y at the start", "mm", 170.0, lambda study: float(study.poses[0, 1]), _READ_MM, 3, READ_OFF),
        Value("y at the end", "mm", -10.0, lambda study: float(study.poses[-1, 1]), _READ_MM, 3, READ_OFF),
        Value("x, largest change", "mm", 0.0, lambda study: float(np.ptp(study.poses[:, 0])), _READ_MM, 9, READ_OFF),
        Value("phi, largest change", "deg", 0.0, lambda study: float(np.ptp(study.poses[:, 3])), _READ_DEG, 9,
              READ_OFF),
        Value("phi at the start", "deg", sum(START_DEG), lambda study: float(study.poses[0, 3]), 1e-9, 3, DERIVED),
        Value("x at the start", "mm", X_MM, lambda study: float(study.poses[0, 0]), 1e-9, 3, DERIVED),
    ),
    errata=(
        Erratum(
            "S_y",
            "180",
            "-180",
            "the figure goes from 170 to -10",
            (
                Formula("y at the end", "mm", lambda _: Y_MM + TRAVEL_MM, lambda _: Y_MM - TRAVEL_MM, lambda _: -10.0,
                        "the figure's -10, read off to 0.5 mm", 3, _READ_MM),
            ),
        ),
        Erratum(
            "attitude n phi / 1000",
            "grows from 0",
            "phi0 + n (phi1 - phi0) / 1000, here constant 90",
            "the figure shows a constant attitude",
            (
                Formula("attitude at n = 500", "deg", lambda _: 500 * 90.0 / 1000,
                        lambda _: 90.0 + 500 * (90.0 - 90.0) / 1000, lambda study: float(study.poses[500, 3]),
                        "the tool's pose at t = 5 s"),
            ),
        ),
    ),
    pictures=(
        Plot("fig-6-tool", "The tool's pose during the pull", _pose_panels),
        RunPicture("drawer-pull", "tool-pose", "The tool's pose and direction cosines by the plan of the run"),
    ),
)  # fmt: skip

JOINTS: Final[Item[WarehouseStudy]] = Item(
    "Joint trajectory",
    "th1, th2 and th3 during the pull",
    "The joints at the paper's 1000 intervals, and what they ask of stepper motors.",
    values=(
        Value("samples", "", 1001, lambda study: len(study.joints), source=DERIVED),
        Value("peak speed of th1", "deg/s", None, lambda study: _peak(study, 3), decimals=6),
        Value("peak speed of th2", "deg/s", None, lambda study: _peak(study, 4), decimals=6),
        Value("peak speed of th3", "deg/s", None, lambda study: _peak(study, 5), decimals=6),
        Value("pulses of th1 in the samples", "", None, lambda study: pulses(study.robot, study.joints)[3]),
        Value("pulses of th2 in the samples", "", None, lambda study: pulses(study.robot, study.joints)[4]),
        Value("pulses of th3 in the samples", "", None, lambda study: pulses(study.robot, study.joints)[5]),
        Value(
            "tool off with joints in whole steps, max", "mm", None,
            lambda study: float(
                tool_off_mm(study.robot, in_whole_steps(study.robot, study.joints), study.joints).max()
            ),
            decimals=6,
        ),
        *tool_values(lambda study: study.run_of("drawer-pull")),
    ),
    listings=(
        Listing("The joints every second, elbow on the right",
                ("t s", "y mm", "th1 deg", "th2 deg", "th3 deg"), _joint_rows),
        run_listing("drawer-pull", lambda study: study.run_of("drawer-pull")),
    ),
    pictures=(
        Plot("joints", "The joints during the pull", _joint_panels, columns=3),
        RunPicture("drawer-pull", "tool-path", "The drawer's line by the counted steps"),
    ),
    not_comparable="no numbers are known of the joint curves.",
)  # fmt: skip

DRAWER: Final[Item[WarehouseStudy]] = Item(
    "Fig. 7",
    "the drawer and its three compartments",
    f"The drawer's compartments come out one after another; each is taken as a third of the drawer, {COMPARTMENT_MM:g}"
    " mm.",
    values=(
        Value("drawer out at the end", "mm", TRAVEL_MM, lambda study: float(np.ptp(study.poses[:, 1])), 1e-9, 6),
        Value("compartments out at the end", "", 3,
              lambda study: float(np.floor(np.ptp(study.poses[:, 1]) / COMPARTMENT_MM + 1e-9))),
        Value("first compartment out", "s", None, lambda study: _time_out_s(study, 1), decimals=3),
        Value("second compartment out", "s", None, lambda study: _time_out_s(study, 2), decimals=3),
        Value("third compartment out", "s", None, lambda study: _time_out_s(study, 3), decimals=3),
    ),
    pictures=(Plot("fig-7-drawer", "The arm as the compartments come out", _arm_panels, columns=1),),
    not_comparable="no times are known of the figure, and the compartments' lengths are assumed.",
)  # fmt: skip

PROCEDURE: Final[Item[WarehouseStudy]] = Item(
    "Section 3",
    "storing and fetching with magnet and lock",
    "The paper describes the procedure; places and speeds are assumed. Both jobs run on the emulated board, and every"
    " pulse and every switched output is verified.",
    values=(
        Value("duration of `store`", "s", None, lambda study: study.run_of("store").report.run.duration_s, decimals=3),
        Value("duration of `fetch`", "s", None, lambda study: study.run_of("fetch").report.run.duration_s, decimals=3),
        Value("checks of `store` that failed", "", None, lambda study: len(study.run_of("store").report.reasons)),
        Value("checks of `fetch` that failed", "", None, lambda study: len(study.run_of("fetch").report.reasons)),
    ),
    listings=(Listing("Switched outputs", ("job", "output", "to", "at s"), _switch_rows, text_columns=3),),
    pictures=(
        RunPicture("store", "tool-path", "The tool's path when a box is stored"),
        RunPicture("fetch", "tool-path", "The tool's path when a box is fetched"),
    ),
    not_comparable="the paper gives no times, places or currents.",
)

PAPER: Final = Paper(
    "warehouse-scara",
    'Jiang Aimin, Guo Liang, Tan Xiangquan, "Development of Prototype of a New Intelligent Warehouse Robot", 2019,'
    " DOI 10.3969/j.issn.1009-9492.2019.05.018.",
    WarehouseStudy,
    (MECHANISM, FORWARD, INVERSE, LAW, TOOL, JOINTS, DRAWER, PROCEDURE),
)
