"""The calibration robot's paper, item by item.

"Kinematic modeling and verification for a SCARA robot", ICMEMTC 2016, Atlantis Press, from p. 918.
"""

from dataclasses import dataclass, replace
from functools import cached_property
from math import cos, hypot, radians, sin
from typing import TYPE_CHECKING, Final

import numpy as np

from steptwin.host.common.arrays import FloatArray
from steptwin.host.robots.kinematics import Kinematics, make_kinematics
from steptwin.host.robots.kinematics.chain import Chain
from steptwin.host.robots.kinematics.dh import Convention
from steptwin.host.robots.link_errors import QUANTITIES, LinkErrors
from steptwin.host.studies.calibration.identification import Identification, identify_errors, rms_mm
from steptwin.host.studies.calibration.measurements import simulate_measurements
from steptwin.host.studies.papers.drawing import COLUMNS, dh_listing, link_rows
from steptwin.host.studies.papers.paper import (
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
    alone,
    dimension,
    run_listing,
    self_check,
    tool_values,
)
from steptwin.host.studies.papers.study import Study, arm_picture, frames_picture, transforms
from steptwin.host.twin.embedded.outcome import Outcome

if TYPE_CHECKING:
    from matplotlib.figure import Figure

SHOWN: Final = (20.0, 50.0, 60.0, 30.0)
"""Joints at which frames can be told apart in a picture."""
L1_MM: Final = 250.0
L2_MM: Final = 350.0
D1_MM: Final = 300.0
AT: Final = (30.0, 45.0, 50.0, 20.0)
"""th1, th2, d3, th4 where matrices are shown and formulas computed."""
POSITIONS: Final = (
    (0.0, 0.0, 0.0, 0.0),
    AT,
    (90.0, -90.0, 120.0, 0.0),
    (-45.0, 60.0, 10.0, -90.0),
    (60.0, 120.0, 200.0, 180.0),
    (-120.0, -145.0, 75.5, 33.3),
)
_RANDOM: Final = 1000

MEASURED: Final = 50
NOISE_MM: Final = 0.02
DISTURBED: Final = {
    "link2": LinkErrors(a_mm=0.4, theta_deg=0.1),
    "link1": LinkErrors(alpha_deg=0.1),
}
"""Errors of the simulated arm by the rows of table 1."""


@dataclass(frozen=True)
class CalibrationStudy(Study):
    """What the items share: the robot with its kinematics, random joint positions, and the run of the demo."""

    robot_name = "calibration-scara"

    @cached_property
    def kinematics(self) -> Kinematics:
        """Its kinematics."""
        return make_kinematics(self.robot)

    @cached_property
    def random_joints(self) -> FloatArray:
        """Joint positions within the limits, of shape (1000, 4), from a fixed seed."""
        lower, upper = ([getattr(joint, end) for joint in self.robot.joints] for end in ("lower", "upper"))
        return np.random.default_rng(1).uniform(lower, upper, (_RANDOM, len(self.robot.joints)))

    @cached_property
    def identified(self) -> Identification:
        """The parameters identified from simulated measurements of an arm with errors."""
        measured = simulate_measurements(replace(self.robot, dh_errors=DISTURBED), MEASURED, NOISE_MM, seed=1)
        return identify_errors(Chain.of(self.robot), measured)

    @property
    def outcome(self) -> Outcome:
        """The run of the demo."""
        return self.run_of("demo")

    def tip_mm(self, joints: FloatArray, convention: Convention = Convention.STANDARD) -> FloatArray:
        """Return the tip, of shape (n, 3), by the table read in a convention."""
        table = replace(self.kinematics.dh, convention=convention)
        return table.transforms(self.kinematics.dh_variables(joints))[:, :3, 3]

    def drawn_tip_mm(self, joints: FloatArray) -> FloatArray:
        """Return the tip, of shape (n, 3), of the arm as pictures and panel draw it."""
        return self.kinematics.links(joints)[-1].points_mm[:, -1]


def _distance_mm(study: CalibrationStudy, convention: Convention, th2_deg: float) -> float:
    """Return the tip's distance from the shoulder."""
    x_mm, y_mm, _ = study.tip_mm(np.array([[0.0, th2_deg, 0.0, 0.0]]), convention)[0].tolist()
    return hypot(x_mm, y_mm)


def _pose_rows(study: CalibrationStudy) -> list[list[str]]:
    rows = []
    for joints in POSITIONS:
        pose = study.kinematics.forward(np.array([joints]))
        other = study.kinematics.solve(pose, "left" if joints[1] >= 0 else "right")
        words = " ".join(f"{joint:g}" for joint in joints)
        reached = "yes" if other.reachable[0] else "no"
        numbers = (*pose[0].tolist(), *other.joints[0, [0, 1, 3]].tolist())
        rows.append([words, reached, *(f"{number:z.6f}" for number in numbers)])
    return rows


def _arm_panels(study: CalibrationStudy) -> tuple[Panel, ...]:
    joints = np.array(POSITIONS[1:5])
    parts = study.kinematics.links(joints)
    drawn = [part.points_mm for part in parts if part.role in {"link", "tool"} and part.name != "hand"]
    gap = np.full((len(joints), 1, 3), np.nan)
    lines_mm = np.concatenate([piece for points_mm in drawn for piece in (points_mm, gap)], axis=1)
    tips_mm = study.tip_mm(joints)
    names = [" ".join(f"{angle:g}" for angle in row) for row in joints.tolist()]
    panels = []
    for title, across, up in (("from above", 0, 1), ("from the side", 0, 2)):
        arms = [Curve(name, line[:, across], line[:, up]) for name, line in zip(names, lines_mm, strict=True)]
        computed = Curve("tip by the matrices", tips_mm[:, across], tips_mm[:, up], "points")
        axes = (f"{'xyz'[across]} [mm]", f"{'xyz'[up]} [mm]")
        panels.append(Panel(f"{title}: drawn arms and computed tips", *axes, (computed, *arms), true_to_scale=True))
    return tuple(panels)


def _shown_arm(study: CalibrationStudy) -> "Figure":
    from steptwin.host.record.plots.in_space import draw_arm_in_space

    return draw_arm_in_space(study.robot, AT)


def _side_mm(th2_deg: float) -> float:
    """Return the distance from shoulder to wrist by the law of cosines."""
    return float((L1_MM**2 + L2_MM**2 + 2 * L1_MM * L2_MM * cos(radians(th2_deg))) ** 0.5)


def _distance(th2_deg: float) -> Formula[CalibrationStudy]:
    """Return the tip's distance from the column with table 1 read in either convention."""
    return Formula(
        f"distance of the tip from the column at th2 = {th2_deg:g} deg",
        "mm",
        lambda study: _distance_mm(study, Convention.MODIFIED, th2_deg),
        lambda study: _distance_mm(study, Convention.STANDARD, th2_deg),
        lambda _: _side_mm(th2_deg),
        "the law of cosines",
        6,
    )


TABLE: Final[Item[CalibrationStudy]] = Item(
    "Figs. 1, 2, table 1",
    "structure, frames, DH parameters",
    "Rows of (theta, d, a, alpha) in the standard convention.",
    parts=(
        Part("fig. 1", "structure of the robot", "picture below: the mechanism in space, without the bodies' shapes"),
        Part("fig. 2", "frames, and four rules for them", "picture below, from table 1"),
        Part("table 1", "DH parameters", "dimensions and table below"),
    ),
    values=(
        dimension("table 1", "L1", "mm", 250.0, lambda study: float(study.robot.geometry["L1_mm"])),
        dimension("table 1", "L2", "mm", 350.0, lambda study: float(study.robot.geometry["L2_mm"])),
        dimension("table 1", "d1", "mm", 300.0, lambda study: float(study.robot.geometry["d1_mm"])),
        dimension("table 1", "alpha of row 3", "deg", 180.0,
                  lambda study: float(study.robot.geometry["alpha3_deg"])),
        dimension("table 1", "links", "", 4, lambda study: len(study.kinematics.dh.rows)),
    ),
    listings=(dh_listing("calibration-scara", "Table 1: DH parameters"),),
    errata=(
        Erratum(
            "parameter text and table 1",
            "a_i-1, alpha_i-1 along x_i-1, the words of modified DH",
            "standard DH, a_i, alpha_i",
            "eq. 1 and the rules for the frames are standard; read as modified DH the tip stays 350 mm from (250, 0)"
            " whatever th2 does",
            (
                Formula(f"x of the tip at ({', '.join(f'{joint:g}' for joint in AT)})", "mm",
                        lambda study: float(study.tip_mm(np.array([AT]), Convention.MODIFIED)[0, 0]),
                        lambda study: float(study.tip_mm(np.array([AT]))[0, 0]),
                        lambda _: L1_MM * cos(radians(AT[0])) + L2_MM * cos(radians(AT[0] + AT[1])),
                        "two links in a plane", 6),
                *(_distance(th2_deg) for th2_deg in (45.0, 145.0)),
            ),
        ),
        Erratum("table 1, names", 'd_i "linkage length", a_i "joint length"', "link offset, link length",
                "how they are used"),
        Erratum("text on fig. 2, rule for z_i", 'along "joint z_i+1"', "along joint i+1", "the standard rule"),
    ),
    left_open=(
        Gap("fig. 1", "ranges, speeds and motors", "assumed, marked [A] in the robot's file"),
    ),
    lost=(
        Gap("table 1, figs. 1, 2", "the table's cells and the figures",
            "the numbers from notes of the whole paper; our copy ends in the introduction"),
    ),
    pictures=(
        Sketch("fig. 1", "fig-1-arm", "the arm at home", arm_picture),
        Sketch("fig. 2", "fig-2-frames", "link frames of table 1", frames_picture(SHOWN)),
    ),
)  # fmt: skip


MATRICES: Final[Item[CalibrationStudy]] = Item(
    "Eqs. 1 to 3",
    "the links' transforms and their product",
    f"At th1 = {AT[0]:g}, th2 = {AT[1]:g} deg, d3 = {AT[2]:g} mm, th4 = {AT[3]:g} deg. x = 250 cos th1 + 350"
    " cos(th1 + th2), z = 300 - d3, psi = th1 + th2 - th4 follow from eq. 1 with table 1."
    " `steptwin fk calibration-scara 30 45 50 20 --matrices` prints the matrices too.",
    parts=(
        Part("eq. 1", "transform of a link, standard convention", "T1 to T4 below"),
        Part("eqs. 2, 3", "the links' transforms and their product", "T1 to T4 and 0T4 below; self-checks"),
    ),
    values=(
        self_check("x", "mm", L1_MM * cos(radians(30)) + L2_MM * cos(radians(75)),
                   lambda study: float(study.tip_mm(np.array([AT]))[0, 0]), 1e-9, 9),
        self_check("y", "mm", L1_MM * sin(radians(30)) + L2_MM * sin(radians(75)),
                   lambda study: float(study.tip_mm(np.array([AT]))[0, 1]), 1e-9, 9),
        self_check("z", "mm", D1_MM - AT[2], lambda study: float(study.tip_mm(np.array([AT]))[0, 2]), 1e-9, 9),
        self_check("psi", "deg", AT[0] + AT[1] - AT[3],
                   lambda study: float(study.kinematics.forward(np.array([AT]))[0, 3]), 1e-9, 9),
        self_check("a_z: the tool points down", "", -1.0,
                   lambda study: float(transforms(study.robot, np.array([AT]))[0, 2, 2]), 1e-9, 9),
    ),
    listings=(Listing("Eqs. 1 to 3: the matrices", COLUMNS, lambda study: link_rows(study.robot, AT)),),
    lost=(Gap("eqs. 2, 3", "the matrices and the closed form", "the product of table 1's rows by eq. 1"),),
)  # fmt: skip

VERIFICATION: Final[Item[CalibrationStudy]] = Item(
    "Abstract: verification",
    "the graphic model beside the computed one",
    "The paper draws the arm in Matlab and compares its tip with the computed one. Here the arm is the one that"
    " pictures and panel draw: its last point beside the tip of the product of the matrices.",
    parts=(Part("abstract", "graphic against computed model", "self-checks and pictures below"),),
    values=(
        self_check(f"drawn and computed tip apart, largest of {_RANDOM} random positions", "mm", 0.0,
                   lambda study: float(np.linalg.norm(
                       study.drawn_tip_mm(study.random_joints) - study.tip_mm(study.random_joints), axis=1).max()),
                   1e-9, 9),
        self_check(f"closed form and matrices apart, largest of {_RANDOM} random positions", "mm", 0.0,
                   lambda study: float(np.linalg.norm(
                       study.kinematics.forward(study.random_joints)[:, :3] - study.tip_mm(study.random_joints),
                       axis=1).max()), 1e-9, 9),
    ),
    listings=(
        Listing("Poses, and the joints of the other elbow",
                ("th1 th2 d3 th4", "other elbow within limits", "x mm", "y mm", "z mm", "psi deg", "th1' deg",
                 "th2' deg", "th4' deg"), _pose_rows, 2),
    ),
    lost=(Gap("verification", "the positions that the paper compares", "six of ours, and 1 000 random ones"),),
    pictures=(
        Sketch("verification", "verification-arm", "the drawn arm with its column at the second position", _shown_arm),
        Plot("verification", "verification", "the drawn arm and the computed tip in four positions", _arm_panels),
    ),
)  # fmt: skip

DEMO: Final[Item[CalibrationStudy]] = Item(
    "No place in the paper",
    "a move on the emulated board",
    "The paper moves nothing. So that the robot's pulses can be verified all the same, all joints go from 0 to"
    " (60, -45, 100, 90) in 2 s by a cubic.",
    values=tool_values(lambda study: study.outcome),
    listings=(run_listing("demo", lambda study: study.outcome),),
    left_open=(Gap("the whole paper", "a motion", "job `demo`"),),
    pictures=(RunPicture("no place in the paper", "demo", "joints", "the move's joints"),),
)


def _sensitivity_rows(study: CalibrationStudy) -> list[list[str]]:
    chain = Chain.of(study.robot)
    moves = chain.sensitivities(np.array([AT]))[0].T
    return [
        [name, *(f"{move:z.6f}" for move in row)] for name, row in zip(chain.parameters, moves.tolist(), strict=True)
    ]


def _largest_sigma(study: CalibrationStudy) -> float:
    """Return how far the identified parameter that is worst is from the true one, in standard deviations."""
    true = {f"{link}.{q}": getattr(errors, q) for link, errors in DISTURBED.items() for q in QUANTITIES}
    distances: list[float] = [
        abs(one.found - true.get(one.name, 0.0)) / one.deviation
        for one in study.identified.parameters
        if one.deviation is not None
    ]
    return max(distances)


def _synthesis_rows(study: CalibrationStudy) -> list[list[str]]:
    """Return rows of the tool's move: each error's linear part, their sum, the exact move, and what the sum lacks."""
    chain = Chain.of(replace(study.robot, dh_errors=DISTURBED))
    together = chain.synthesis(np.array([AT]))
    wrong = np.flatnonzero(chain.errors.ravel())
    moves = {chain.parameters[i]: together.parts[0, :, i] for i in wrong}
    moves |= {"sum": together.linear[0], "exact": together.exact[0], "lacking": (together.exact - together.linear)[0]}
    return [[name, *(f"{value:z.6f}" for value in move.tolist())] for name, move in moves.items()]


CALIBRATION: Final[Item[CalibrationStudy]] = Item(
    "Introduction",
    "error transfer coefficients, their synthetic relationship, the basis of a calibration",
    "The paper's model is meant for calibration, but the paper makes none. The derivatives of the tool by every"
    " parameter at the position above, in mm or degrees per mm or degree of the parameter's error; turns are about the"
    " world's axes; `steptwin sensitivity` prints them, and for a file with errors their parts, their sum and the exact"
    f" value. Then {MEASURED} simulated measurements with a noise of {NOISE_MM:g} mm of an arm whose forearm is 0.4 mm"
    " longer, whose elbow is zeroed 0.1 deg off and whose upper arm is twisted by 0.1 deg:",
    parts=(
        Part("introduction", "transfer coefficient of each parameter's error", "table below; `steptwin sensitivity`"),
        Part("introduction", "synthetic relationship between the errors", "table below; `steptwin sensitivity FILE`"),
        Part("introduction", "basis of calibration", "`steptwin measure` and `calibrate`; numbers below"),
    ),
    values=(
        self_check("parameters of the model", "", 16, lambda study: len(study.identified.parameters)),
        alone("parameters that measured positions tell apart", "", lambda study: study.identified.rank),
        alone("tool off the nominal model, rms", "mm", lambda study: rms_mm(study.identified.before_mm), 4),
        alone("tool off the identified model, rms", "mm", lambda study: rms_mm(study.identified.after_mm), 4),
        alone("an identified parameter off the true one, most", "sigma", _largest_sigma, 2),
    ),
    listings=(
        Listing("Transfer coefficients", ("parameter", "x", "y", "z", "rx", "ry", "rz"), _sensitivity_rows),
        Listing("Synthetic relationship: what the three errors do together", ("error", "x mm", "y mm", "z mm", "rx deg",
                "ry deg", "rz deg"), _synthesis_rows),
    ),
    left_open=(Gap("introduction", "an error model, measurements, identified parameters", "simulated measurements"),),
)  # fmt: skip

PAPER: Final = Paper(
    "calibration-scara",
    '"Kinematic modeling and verification for a SCARA robot", ICMEMTC 2016, Atlantis Press, from p. 918; the authors'
    " are not in the copy used.",
    CalibrationStudy,
    (TABLE, MATRICES, VERIFICATION, CALIBRATION, DEMO),
)
