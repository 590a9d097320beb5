"""The warehouse robot's paper, item by item.

A. Jiang, L. Guo, X. Tan, "Development of Prototype of a New Intelligent Warehouse Robot", 2019,
DOI 10.3969/j.issn.1009-9492.2019.05.018.
"""

from dataclasses import dataclass
from functools import cached_property
from math import cos, hypot, nan, radians, sin
from typing import TYPE_CHECKING, Final

import numpy as np

from steptwin.host.common.arrays import FloatArray
from steptwin.host.planning.jobs import make_job
from steptwin.host.planning.laws import Trapezoid
from steptwin.host.robots.kinematics import make_kinematics
from steptwin.host.studies.papers.drawing import COLUMNS, dh_listing, matrix_rows
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
    transforms,
)
from steptwin.host.verify.evidence import ShelfEvidence
from steptwin.protocol.timer import COUNTS_PER_SECOND

if TYPE_CHECKING:
    from matplotlib.figure import Figure

L2_MM: Final = 200.0
L3_MM: Final = 150.0
L4_MM: Final = 40.0
START_DEG: Final = (0.0, 60.0, 30.0)
TRAVEL_MM: Final = 180.0
DURATION_S: Final = 10.0
RAMP_S: Final = 2.0
"""t1: assumed, the paper has none."""
CELL_MM: Final = 60.0
"""Length of a cell: a third of the drawer."""
_SAMPLES: Final = 1001
_ROUND_MM: Final = 0.5
"""The error of a number that is stated in whole millimetres."""
PULL: Final = "pull-line"
SHOWN: Final = (0.0, 0.0, 100.0, 0.0, 60.0, -20.0)
"""Joints at which frames can be told apart in a picture."""
EXPERIMENT: Final = "drawer-pull"
"""The job that moves along the line alone, and the job that is the experiment of sect. 3."""

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
        return make_job(self.robot, PULL).positions(self.t_s)

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


def _time_out_s(study: WarehouseStudy, cells: int) -> float:
    """Return when so many cells are out, by the tool's own way, linear between the samples."""
    out_mm = study.poses[0, 1] - study.poses[:, 1]
    return float(np.interp(CELL_MM * cells, out_mm, study.t_s))


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
    columns = [(f"{name} [deg]", [(name, study.joints[:, axis], "line")])
               for axis, name in ((3, "th1"), (4, "th2"), (5, "th3"))]  # fmt: skip
    return panels_over(study.t_s, "time [s]", columns)


def draw_planar_arm(_: WarehouseStudy) -> "Figure":
    """Draw fig. 4: the planar arm at a position that shows all angles of eq. 2."""
    from steptwin.host.studies.papers.warehouse_figures import planar_arm

    return planar_arm((L2_MM, L3_MM, L4_MM), (20.0, 50.0, -25.0))


def draw_drawer(study: WarehouseStudy) -> "Figure":
    """Draw fig. 7: the arm from above as the drawer is connected, and with one, two and three cells out."""
    from steptwin.host.studies.papers.warehouse_figures import OpenDrawer, open_drawers

    k = [0, *(round(_time_out_s(study, n) * 100) for n in (1, 2, 3))]
    joints_rad = np.deg2rad(study.joints[k][:, 3:].cumsum(axis=1))
    ends = ((L2_MM, L3_MM, L4_MM) * np.exp(1j * joints_rad)).cumsum(axis=1)
    arms_mm = [np.column_stack([[0.0, *arm.real], [0.0, *arm.imag]]) for arm in ends]
    names = ("(a) connected", "(b) one cell out", "(c) two cells out", "three cells out")
    return open_drawers(
        [OpenDrawer(name, arm, CELL_MM * n) for n, (name, arm) in enumerate(zip(names, arms_mm, strict=True))]
    )


def _shelf(study: WarehouseStudy) -> ShelfEvidence:
    """Return what the emulated shelf tells of the experiment."""
    shelf = study.run_of(EXPERIMENT).comparison.evidence.shelf
    assert shelf is not None
    return shelf


def _shelf_rows(study: WarehouseStudy) -> list[list[str]]:
    start_counts = study.run_of(EXPERIMENT).comparison.evidence.start_counts
    return [
        [event.what, event.where, f"{(event.counts - start_counts) / COUNTS_PER_SECOND:.3f}"]
        for event in _shelf(study).events
    ]


def _switch_rows(study: WarehouseStudy) -> list[list[str]]:
    return [
        [job, output.name, "on" if output.on else "off", f"{output.changed_s:.3f}"]
        for job in ("store", "fetch")
        for output in study.run_of(job).report.outputs
    ]


def _length(key: str, paper: float) -> Value[WarehouseStudy]:
    name = key.removesuffix("_mm")
    return dimension("sect. 2.1", name, "mm", paper, lambda study: float(study.robot.geometry[key]))


MECHANISM: Final[Item[WarehouseStudy]] = Item(
    "Sects. 1.1, 1.2: figs. 1, 2",
    "two slides, a SCARA with its lift at the base, a hand with magnet and lock",
    parts=(
        Part("sect. 1.1", "slides X and Z, arm, hand, control", "robot `warehouse-scara` with six axes"),
        Part("fig. 1", "the whole robot", "picture below: the mechanism in space, without the bodies' shapes"),
        Part("sect. 1.2", "electromagnet and electric lock", "outputs `magnet` and `lock`; the emulated shelf"),
        Part("fig. 2", "the hand, and its working state: box at the magnet and drawer docked",
             "the state occurs in `store`, see sect. 1.1 below", Coverage.PARTLY,
             "no drawing: the twin knows the hand only as a point with two outputs"),
    ),
    values=(
        dimension("sect. 1.1", "joints of the arm, with its lift", "", 4, lambda study: len(study.robot.joints) - 2),
    ),
    left_open=(
        Gap("sect. 1.1", "the slides' strokes and speeds, motors, ratios", "assumed, marked [A] in the robot's file"),
    ),
    pictures=(Sketch("fig. 1", "fig-1-robot", "the arm on its slides at home", arm_picture),),
)  # fmt: skip

FORWARD: Final[Item[WarehouseStudy]] = Item(
    "Sects. 2.1, 2.2: fig. 3, table 1, eq. 1",
    "frames, DH parameters and the tool's transform",
    "At the start of the experiment, th1 = 0, th2 = 60, th3 = 30 deg, with the lift at 100 mm and the slides at 0; the"
    " slides are the first two rows. `steptwin fk warehouse-scara 0 0 100 0 60 30 --matrices` prints each matrix.",
    parts=(
        Part("sect. 2.1", "lengths L1 to L4", "dimensions below"),
        Part("fig. 3", "link frames", "picture below, from table 1, with the slides before it"),
        Part("table 1", "DH parameters", "table below"),
        Part("eq. 1", "the tool's transform", "matrix and self-checks below"),
    ),
    values=(
        _length("L2_mm", 200.0),
        _length("L3_mm", 150.0),
        _length("L4_mm", 40.0),
        dimension("sect. 2.1", "L1, least", "mm", 50.0, lambda study: study.robot.joint("L1").lower),
        dimension("sect. 2.1", "L1, greatest", "mm", 200.0, lambda study: study.robot.joint("L1").upper),
        self_check("P_x of eq. 1 with L5 = 40", "mm", X_MM, lambda study: float(study.poses[0, 0]), 1e-9, 6),
        self_check("P_y of eq. 1 with L5 = 40", "mm", Y_MM, lambda study: float(study.poses[0, 1]), 1e-9, 6),
        self_check("P_z = L1 - L4", "mm", 60.0, lambda study: float(study.poses[0, 2]), 1e-9, 6),
    ),
    listings=(
        dh_listing("warehouse-scara", "Table 1, with the slides as its first two rows: DH parameters"),
        Listing("Eq. 1: the tool's transform", COLUMNS,
                lambda study: matrix_rows(["tool"], [transforms(study.robot, study.joints[:1])[0]])),
    ),
    errata=(
        Erratum(
            "table 1, row 4, and eq. 1",
            "the length L4 in table 1, L5 in P_x and P_y of eq. 1; the offset -L4 in both",
            "L5 is table 1's length L4 = 40 mm",
            "one symbol is both length and offset in table 1; with 40 mm the pull starts at y = 169.904, and sect. 2.4"
            " says 170",
        ),
    ),
    pictures=(
        Sketch("fig. 3", "fig-3-frames", "link frames of table 1, after the slides' two", frames_picture(SHOWN)),
    ),
)  # fmt: skip

INVERSE: Final[Item[WarehouseStudy]] = Item(
    "Sect. 2.3: fig. 4, eq. 2",
    "the joints of a pose",
    "The inverse as printed has no value at the start. With y in place of its second x it is right until the wrist"
    " crosses y = 0; from there the arc cosine takes it to the wrong side.",
    parts=(
        Part("fig. 4", "planar arm with l1, l2, l3, alpha, beta", "picture below"),
        Part("eq. 2", "closed form of the inverse", "self-checks below; misprints computed"),
    ),
    values=(
        self_check("th1 of the start", "deg", START_DEG[0], lambda study: float(study.joints[0, 3]), 1e-9, 9),
        self_check("th2 of the start", "deg", START_DEG[1], lambda study: float(study.joints[0, 4]), 1e-9, 9),
        self_check("th3 of the start", "deg", START_DEG[2], lambda study: float(study.joints[0, 5]), 1e-9, 9),
        alone("time at which the wrist crosses y = 0", "s",
              lambda study: float(np.interp(0.0, L4_MM - study.poses[:, 1], study.t_s)), 4),
    ),
    errata=(
        Erratum(
            "eq. 2, cos alpha and cos beta, three places",
            "(x - l3 cos phi)^2 + (x - l3 sin phi)^2",
            "y in the second bracket, as in the sentence before eq. 2",
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
            "eq. 2, alpha by its cosine",
            "loses the sign of y",
            "alpha = atan2(yw, xw)",
            "the wrist crosses y = 0 at 6.7735 s of the pull; from there the error grows to 100.19 mm",
            (
                Formula("tool off the drawer's line at the end", "mm",
                        lambda study: float(tool_off_mm(study.robot, study.printed_joints, study.joints)[-1]),
                        _off_line_mm, lambda _: 0.0, "the prescribed line", 6),
            ),
        ),
    ),
    left_open=(
        Gap("eq. 2", "the other elbow: beta and theta2 by their cosines have one sign", "both branches: `steptwin ik`"),
    ),
    pictures=(Sketch("fig. 4", "fig-4-planar-arm", "the planar arm with the angles of eq. 2", draw_planar_arm),),
)  # fmt: skip


LAW: Final[Item[WarehouseStudy]] = Item(
    "Sect. 2.4: eq. 3",
    "trapezoidal speed",
    f"S = {TRAVEL_MM:g} mm in T = {DURATION_S:g} s; the ramps of t1 = {RAMP_S:g} s are assumed. With v = S / (T - t1)"
    " the corrected law is v t^2 / (2 t1) up to t1, v (t - t1 / 2) up to T - t1, and S - v (T - t)^2 / (2 t1) then.",
    parts=(
        Part("eq. 3", "the law of the way", "picture below; misprints computed"),
        Part("sect. 2.4", "T, step, 1 000 points, start and way of the pull", "results below; contradictions named"),
    ),
    values=(
        dimension("sect. 2.4", "T", "s", 10.0, lambda study: study.run_of(PULL).report.run.duration_s),
        dimension("sect. 2", "way of the drawer", "mm", 180.0, lambda _: TRAVEL_MM),
        dimension("sect. 2.4", "points", "", 1000, lambda study: len(study.joints) - 1),
        self_check("way after T by the job's law", "mm", TRAVEL_MM, lambda study: study.position_mm(DURATION_S),
                   1e-9, 6),
        alone("speed between the ramps", "mm/s", lambda study: study.law.speed, 3),
    ),
    errata=(
        Erratum(
            "eq. 3, first branch",
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
            "eq. 3, third branch",
            "the second one again",
            "S - v (T - t)^2 / (2 t1)",
            "as printed the drawer ends at 202.5 mm; sect. 2 has 180",
            (
                Formula("S at T", "mm", lambda _: printed_position_mm(DURATION_S),
                        lambda _: corrected_position_mm(DURATION_S), lambda _: _swept_mm(DURATION_S),
                        "the area under the trapezoid of the speed"),
                Formula("S at T - t1 / 2", "mm", lambda _: printed_position_mm(DURATION_S - RAMP_S / 2),
                        lambda _: corrected_position_mm(DURATION_S - RAMP_S / 2),
                        lambda _: _swept_mm(DURATION_S - RAMP_S / 2), "the same"),
            ),
        ),
        Erratum("eq. 3, conditions", "on x", "on t", "sect. 2.4: T is the time"),
        Erratum(
            "sect. 2.4, 1 000 points",
            "T = 10 with a step of 0.001",
            "a step of 0.01",
            "1 000 steps of 0.001 make 1, not 10",
            (
                Formula("time of 1 000 steps", "s", lambda _: 1000 * 0.001, lambda _: 1000 * 0.01, lambda _: DURATION_S,
                        "the stated T"),
            ),
        ),
    ),
    left_open=(
        Gap("sect. 2.4", "t1, the time of the ramps", "2 s"),
        Gap("sect. 2.4", "whether the 1 000 points count both ends", "1 000 intervals, 1 001 instants, both ends among"
            " them"),
    ),
    pictures=(Plot("eq. 3", "eq-3-law", "the law of the way as printed and as corrected", _law_panels),),
)  # fmt: skip


def _swept_mm(until_s: float) -> float:
    """Return the area under the trapezoid of the speed, whose own area is the drawer's way, up to an instant."""
    corners_s = (0.0, RAMP_S, DURATION_S - RAMP_S, DURATION_S)
    t_s = np.union1d([t for t in corners_s if t < until_s], [until_s])
    shape = np.interp(t_s, corners_s, (0.0, 1.0, 1.0, 0.0))
    return TRAVEL_MM * float(np.trapezoid(shape, t_s)) / (DURATION_S - RAMP_S)


JOINTS: Final[Item[WarehouseStudy]] = Item(
    "Sect. 2.4: fig. 5",
    "th1, th2 and th3 during the pull",
    "The joints at the paper's 1 000 intervals, on the paper's branch, and what they ask of stepper motors.",
    parts=(Part("fig. 5", "(a) to (c): th1, th2, th3 over time", "picture and table below"),),
    values=(
        result("sect. 2.4", "th1 at the start", "deg", 0.0, lambda study: float(study.joints[0, 3]), 1e-9, 6),
        result("sect. 2.4", "th2 at the start", "deg", 60.0, lambda study: float(study.joints[0, 4]), 1e-9, 6),
        result("sect. 2.4", "th3 at the start", "deg", 30.0, lambda study: float(study.joints[0, 5]), 1e-9, 6),
        alone("peak speed of th1", "deg/s", lambda study: _peak(study, 3), 6),
        alone("peak speed of th2", "deg/s", lambda study: _peak(study, 4), 6),
        alone("peak speed of th3", "deg/s", lambda study: _peak(study, 5), 6),
        alone("pulses of th1 in the samples", "", lambda study: pulses(study.robot, study.joints)[3]),
        alone("pulses of th2 in the samples", "", lambda study: pulses(study.robot, study.joints)[4]),
        alone("pulses of th3 in the samples", "", lambda study: pulses(study.robot, study.joints)[5]),
        alone(
            "tool off with joints in whole steps, max", "mm",
            lambda study: float(
                tool_off_mm(study.robot, in_whole_steps(study.robot, study.joints), study.joints).max()
            ),
            6,
        ),
        *tool_values(lambda study: study.run_of(PULL)),
    ),
    listings=(
        Listing("Fig. 5 in numbers: the joints every second, elbow on the right",
                ("t s", "y mm", "th1 deg", "th2 deg", "th3 deg"), _joint_rows),
        run_listing(PULL, lambda study: study.run_of(PULL)),
    ),
    lost=(Gap("fig. 5", "the curves, and so their numbers", "only the start is known, from sect. 2.4"),),
    pictures=(
        Plot("fig. 5", "fig-5-joints", "the joints during the pull", _joint_panels, columns=3),
        RunPicture("sect. 2.4", PULL, "tool-path", "the line by the counted steps"),
    ),
)  # fmt: skip

TOOL: Final[Item[WarehouseStudy]] = Item(
    "Sect. 2.4: fig. 6",
    "the tool over time: straight along -y at constant attitude",
    "The picture also shows where the tool goes with the arc cosine of the printed inverse.",
    parts=(Part("fig. 6", "(a) to (c): x, y, phi over time", "picture and results below"),),
    values=(
        result("sect. 2.4", "y at the start", "mm", 170.0, lambda study: float(study.poses[0, 1]), _ROUND_MM, 3),
        result("sect. 2.4", "y at the end", "mm", -10.0, lambda study: float(study.poses[-1, 1]), _ROUND_MM, 3),
        result("sect. 2.4", "way along y", "mm", 180.0, lambda study: float(np.ptp(study.poses[:, 1])), 1e-9, 6),
        result("sect. 2.4", "x, largest change", "mm", 0.0, lambda study: float(np.ptp(study.poses[:, 0])), 1e-9, 9),
        result("sect. 2.4", "phi, largest change", "deg", 0.0, lambda study: float(np.ptp(study.poses[:, 3])), 1e-9,
               9),
    ),
    errata=(
        Erratum(
            "sect. 2.4, S_x = 0 and S_y = 180",
            "180",
            "-180",
            "fig. 6 and its text go from 170 to -10",
            (
                Formula("y at the end", "mm", lambda _: Y_MM + TRAVEL_MM, lambda _: Y_MM - TRAVEL_MM, lambda _: -10.0,
                        "the text's -10, a whole number", 3, _ROUND_MM),
            ),
        ),
        Erratum(
            "sect. 2.4, attitude n phi / 1000",
            "grows from 0",
            "phi0 + n (phi1 - phi0) / 1000, here constant 90",
            "the text on fig. 6 (c): no change",
            (
                Formula("attitude at n = 500", "deg", lambda _: 500 * 90.0 / 1000,
                        lambda _: 90.0 + 500 * (90.0 - 90.0) / 1000, lambda study: float(study.poses[500, 3]),
                        "the tool's pose at t = 5 s"),
            ),
        ),
    ),
    pictures=(
        Plot("fig. 6", "fig-6-tool", "the tool's pose during the pull", _pose_panels),
        RunPicture("fig. 6", PULL, "tool-pose", "the tool's pose and direction cosines by the plan of the run"),
    ),
)  # fmt: skip

DRAWER: Final[Item[WarehouseStudy]] = Item(
    "Sect. 3: fig. 7",
    "the drawer and its three cells",
    "As in the paper the slides move first, then the arm reaches out, the hand locks onto the drawer and pulls it along"
    " the line of sect. 2.4; the drawer stays out, in the hand. Its cells come out one after another; each is a"
    f" third of the drawer, it is assumed, {CELL_MM:g} mm. Times of the cells are from the beginning of the pull.",
    parts=(
        Part("sect. 3", "experiment: slides, dock, pull", "job `drawer-pull`: results below"),
        Part("fig. 7", "(a) connected, (b) one cell, (c) two cells; three come out", "picture below"),
        Part("sect. 3", "STM32 and TB6560", "the twin itself: `docs/firmware.md`, `docs/driver.md`"),
    ),
    values=(
        result("sect. 3", "drawer out at the end, by the emulated shelf", "mm", 180.0,
               lambda study: sum(_shelf(study).open_mm.values()), 0.1, 3),
        result("sect. 3", "cells out at the end, by the emulated shelf", "", 3,
               lambda study: sum(_shelf(study).cells_out.values())),
        *tool_values(lambda study: study.run_of(EXPERIMENT)),
        alone("first cell out", "s", lambda study: _time_out_s(study, 1), 3),
        alone("second cell out", "s", lambda study: _time_out_s(study, 2), 3),
        alone("third cell out", "s", lambda study: _time_out_s(study, 3), 3),
    ),
    listings=(
        Listing("What happened at the shelf", ("event", "drawer", "at s"), _shelf_rows, text_columns=2),
        run_listing(EXPERIMENT, lambda study: study.run_of(EXPERIMENT)),
    ),
    left_open=(Gap("sect. 3", "the cells' lengths", "a third of the drawer each"),),
    lost=(Gap("fig. 7", "the photographs", "drawn from the run"),),
    pictures=(
        Sketch("fig. 7", "fig-7-drawer", "the drawer and the hand from above", draw_drawer),
    ),
)  # fmt: skip

PROCEDURE: Final[Item[WarehouseStudy]] = Item(
    "Sect. 1.1",
    "storing and fetching with magnet and lock",
    "The paper describes the procedure; places and speeds are assumed. Both jobs run on the emulated board, and every"
    " pulse and every switched output is verified. An inventory allots the place when a component is stored and finds"
    " it when it is fetched: `steptwin run warehouse-scara store screws --inventory stock.toml`.",
    parts=(
        Part("sect. 1.1", "store: pick up, a place is allotted, open, put in, close",
             "job `store`, `--inventory`: [the warehouse](../warehouse.md)"),
        Part("sect. 1.1", "fetch: look up, open, take, deliver", "job `fetch`, `--inventory`"),
    ),
    values=(
        alone("duration of `store`", "s", lambda study: study.run_of("store").report.run.duration_s, 3),
        alone("duration of `fetch`", "s", lambda study: study.run_of("fetch").report.run.duration_s, 3),
        self_check("checks of `store` that failed", "", 0, lambda study: len(study.run_of("store").report.reasons)),
        self_check("checks of `fetch` that failed", "", 0, lambda study: len(study.run_of("fetch").report.reasons)),
    ),
    listings=(Listing("Switched outputs", ("job", "output", "to", "at s"), _switch_rows, text_columns=3),),
    left_open=(Gap("sect. 1.1", "times, places, currents", "assumed, [A] in the robot's file"),),
    pictures=(
        RunPicture("sect. 1.1", "store", "tool-path", "the tool's path when a component is stored"),
        RunPicture("sect. 1.1", "fetch", "tool-path", "the tool's path when a component is fetched"),
    ),
)  # fmt: skip

PAPER: Final = Paper(
    "warehouse-scara",
    'Jiang Aimin, Guo Liang, Tan Xiangquan, "Development of Prototype of a New Intelligent Warehouse Robot", 2019(05),'
    " from p. 62, 4 pages, DOI 10.3969/j.issn.1009-9492.2019.05.018.",
    WarehouseStudy,
    (MECHANISM, PROCEDURE, FORWARD, INVERSE, LAW, JOINTS, TOOL, DRAWER),
)
