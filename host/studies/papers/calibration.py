"""The calibration robot's paper, figure by figure.

"Kinematic modeling and verification for a SCARA robot", ICMEMTC 2016, Atlantis Press, from p. 918.
"""

from dataclasses import dataclass, replace
from functools import cached_property
from math import cos, hypot, radians, sin
from typing import Final

import numpy as np

from steptwin.host.common.arrays import FloatArray
from steptwin.host.robots.kinematics import Kinematics, make_kinematics
from steptwin.host.robots.kinematics.chain import Chain
from steptwin.host.robots.kinematics.dh import Convention
from steptwin.host.robots.link_errors import QUANTITIES, LinkErrors
from steptwin.host.studies.calibration.identification import Identification, identify_errors, rms_mm
from steptwin.host.studies.calibration.measurements import simulate_measurements
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
    run_listing,
    tool_values,
)
from steptwin.host.studies.papers.study import Study, transforms
from steptwin.host.twin.embedded.outcome import Outcome

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
    "Table 1",
    "the DH parameters",
    "Rows of (theta, d, a, alpha): (th1, 300, 250, 0), (th2, 0, 350, 0), (0, -d3, 0, 180), (th4, 0, 0, 0), in the"
    " standard convention.",
    values=(
        Value("L1", "mm", L1_MM, lambda study: float(study.robot.geometry["L1_mm"])),
        Value("L2", "mm", L2_MM, lambda study: float(study.robot.geometry["L2_mm"])),
        Value("d1", "mm", D1_MM, lambda study: float(study.robot.geometry["d1_mm"])),
        Value("alpha of row 3", "deg", 180.0, lambda study: float(study.robot.geometry["alpha3_deg"])),
        Value("links", "", 4, lambda study: len(study.kinematics.dh.rows)),
    ),
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
        Erratum("names", 'd_i "linkage length", a_i "joint length"', "link offset, link length", "how they are used"),
        Erratum("rule for z_i", 'along "joint z_i+1"', "along joint i+1", "the standard rule"),
    ),
    not_comparable="ranges, speeds and motors are not given; ours are assumed and marked [A] in the robot's file.",
)  # fmt: skip


MATRICES: Final[Item[CalibrationStudy]] = Item(
    "Eqs. 1 to 3",
    "the links' transforms and their product",
    f"At th1 = {AT[0]:g}, th2 = {AT[1]:g} deg, d3 = {AT[2]:g} mm, th4 = {AT[3]:g} deg. The paper's closed form is"
    " illegible in the copy used; x = 250 cos th1 + 350 cos(th1 + th2), z = 300 - d3, psi = th1 + th2 - th4 follow from"
    " eq. 1 with table 1.",
    values=(
        Value("x", "mm", L1_MM * cos(radians(30)) + L2_MM * cos(radians(75)),
              lambda study: float(study.tip_mm(np.array([AT]))[0, 0]), 1e-9, 9, DERIVED),
        Value("y", "mm", L1_MM * sin(radians(30)) + L2_MM * sin(radians(75)),
              lambda study: float(study.tip_mm(np.array([AT]))[0, 1]), 1e-9, 9, DERIVED),
        Value("z", "mm", D1_MM - AT[2], lambda study: float(study.tip_mm(np.array([AT]))[0, 2]), 1e-9, 9, DERIVED),
        Value("psi", "deg", AT[0] + AT[1] - AT[3],
              lambda study: float(study.kinematics.forward(np.array([AT]))[0, 3]), 1e-9, 9, DERIVED),
        Value("a_z: the tool points down", "", -1.0,
              lambda study: float(transforms(study.robot, np.array([AT]))[0, 2, 2]), 1e-9, 9, DERIVED),
    ),
    listings=(Listing("The matrices", COLUMNS, lambda study: link_rows(study.robot, AT)),),
    errata=(
        Erratum("eqs. 2 and 3", "illegible in the copy used", "the product of the rows above", "eq. 1 with table 1"),
    ),
)  # fmt: skip

VERIFICATION: Final[Item[CalibrationStudy]] = Item(
    "Verification",
    "the graphic model beside the computed one",
    "The paper draws the arm in Matlab and compares its tip with the computed one. Here the arm is the one that"
    " pictures and panel draw: its last point beside the tip of the product of the matrices.",
    values=(
        Value(f"drawn and computed tip apart, largest of {_RANDOM} random positions", "mm", 0.0,
              lambda study: float(np.linalg.norm(
                  study.drawn_tip_mm(study.random_joints) - study.tip_mm(study.random_joints), axis=1).max()),
              1e-9, 9, DERIVED),
        Value(f"closed form and matrices apart, largest of {_RANDOM} random positions", "mm", 0.0,
              lambda study: float(np.linalg.norm(
                  study.kinematics.forward(study.random_joints)[:, :3] - study.tip_mm(study.random_joints),
                  axis=1).max()), 1e-9, 9, DERIVED),
    ),
    listings=(
        Listing("Poses, and the joints of the other elbow",
                ("th1 th2 d3 th4", "other elbow within limits", "x mm", "y mm", "z mm", "psi deg", "th1' deg",
                 "th2' deg", "th4' deg"), _pose_rows, 2),
    ),
    pictures=(Plot("verification", "The drawn arm and the computed tip in four positions", _arm_panels),),
    not_comparable="the positions that the paper compares are not known.",
)  # fmt: skip

DEMO: Final[Item[CalibrationStudy]] = Item(
    "No experiment",
    "a move on the emulated board",
    "The paper moves nothing. So that the robot's pulses can be verified all the same, all joints go from 0 to"
    " (60, -45, 100, 90) in 2 s by a cubic.",
    values=tool_values(lambda study: study.outcome),
    listings=(run_listing("demo", lambda study: study.outcome),),
    pictures=(RunPicture("demo", "joints", "The move's joints"),),
    not_comparable="the paper has neither a trajectory nor results in numbers.",
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


CALIBRATION: Final[Item[CalibrationStudy]] = Item(
    "Purpose",
    "the model as the basis of a calibration",
    "The paper's model is meant for calibration, but the paper makes none. The derivatives of the tool by every"
    " parameter at the position above, in mm or degrees per mm or degree of the parameter's error; turns are about the"
    f" world's axes. Then {MEASURED} simulated measurements with a noise of {NOISE_MM:g} mm of an arm whose forearm is"
    " 0.4 mm longer, whose elbow is zeroed 0.1 deg off and whose upper arm is twisted by 0.1 deg:",
    values=(
        Value("parameters of the model", "", 16, lambda study: len(study.identified.parameters), source=DERIVED),
        Value("parameters that measured positions tell apart", "", None, lambda study: study.identified.rank),
        Value("tool off the nominal model, rms", "mm", None, lambda study: rms_mm(study.identified.before_mm),
              decimals=4),
        Value("tool off the identified model, rms", "mm", None, lambda study: rms_mm(study.identified.after_mm),
              decimals=4),
        Value("an identified parameter off the true one, most", "sigma", None, _largest_sigma, decimals=2),
    ),
    listings=(Listing("Sensitivities", ("parameter", "x", "y", "z", "rx", "ry", "rz"), _sensitivity_rows),),
    not_comparable="the paper has no error model, no measurements and no identified parameters.",
)  # fmt: skip

PAPER: Final = Paper(
    "calibration-scara",
    '"Kinematic modeling and verification for a SCARA robot", ICMEMTC 2016, Atlantis Press, from p. 918; the authors'
    " are not in the copy used.",
    CalibrationStudy,
    (TABLE, MATRICES, VERIFICATION, CALIBRATION, DEMO),
)
