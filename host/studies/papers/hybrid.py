"""The hybrid arm's paper, figure by figure.

H. Zhou, Shaanxi Institute of Technology, Xi'an: a four-DOF hybrid (serial-parallel) handling robot. Its equations,
tables and dimensions are lost in the copy used.
"""

from dataclasses import dataclass
from functools import cached_property
from math import hypot, sqrt
from typing import Final

import numpy as np

from steptwin.host.common.arrays import FloatArray
from steptwin.host.planning.jobs import make_job
from steptwin.host.planning.jobs.hybrid_jobs import OPERATING_MODE, HelixOptions, five_poses, helix_poses
from steptwin.host.robots.kinematics import AssemblyMode, HybridArm
from steptwin.host.robots.kinematics.loop_closure import LoopClosure
from steptwin.host.studies.papers.paper import (
    DERIVED,
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
from steptwin.host.studies.papers.study import Study, in_whole_steps, panels_over, pulses, tool_off_mm

DURATION_S: Final = 80.0
STEPS: Final = 240
_DENSE: Final = 24_001
_SHOWN_S: Final = (28.0, 33.0)
_OUTER_S: Final = 2.0
"""Time at both ends in which the job starts and stops, so that the tool is early or late there."""


@dataclass(frozen=True)
class HybridStudy(Study):
    """What the items share: the robot, its five points, the helix at the paper's steps, and the runs."""

    robot_name = "hybrid-arm"

    @cached_property
    def arm(self) -> HybridArm:
        """Its kinematics."""
        return HybridArm.of(self.robot)

    @cached_property
    def points(self) -> FloatArray:
        """The five poses, of shape (5, 4)."""
        return five_poses(self.robot)

    @cached_property
    def point_joints(self) -> FloatArray:
        """The joints at the five poses, of shape (5, 4)."""
        return self.joints_at(self.points)

    @cached_property
    def t_s(self) -> FloatArray:
        """The instants of the paper's 240 steps."""
        return DURATION_S * np.arange(STEPS + 1) / STEPS

    @cached_property
    def poses(self) -> FloatArray:
        """The helix at these instants, of shape (241, 4)."""
        return helix_poses(self.t_s / DURATION_S, HelixOptions())

    @cached_property
    def joints(self) -> FloatArray:
        """The joints at these instants, of shape (241, 4)."""
        return self.joints_at(self.poses)

    @cached_property
    def dense_s(self) -> FloatArray:
        """Instants between the steps."""
        return np.linspace(_OUTER_S, DURATION_S - _OUTER_S, _DENSE)

    def joints_at(self, poses: FloatArray) -> FloatArray:
        """Return the joints in the operating mode."""
        return self.arm.solve(poses, OPERATING_MODE).joints

    def off_helix_mm(self, joints: FloatArray) -> FloatArray:
        """Return the tool's distances from the helix at the dense instants."""
        wanted = helix_poses(self.dense_s / DURATION_S, HelixOptions())
        return np.asarray(np.linalg.norm(self.arm.forward(joints)[:, :3] - wanted[:, :3], axis=1))

    def dimension(self, key: str) -> float:
        """Return a dimension in mm."""
        return float(self.robot.geometry[key])


def _slider_mm(study: HybridStudy, side: int) -> float:
    """Return Z5 (side +1) or Z6 (-1) at the second point by the fragment: Z0 - l1 + l4 - sqrt(L^2 - (z2 +- h)^2)."""
    x_mm, y_mm, z0_mm, _ = study.points[1].tolist()
    z2_mm = hypot(x_mm, y_mm) - study.dimension("l2_mm") - study.dimension("l3_mm")
    root_mm = sqrt(study.dimension("L_mm") ** 2 - (z2_mm + side * study.dimension("h_mm")) ** 2)
    return float(z0_mm) - study.dimension("l1_mm") + study.dimension("l4_mm") - root_mm


def _links_mm(study: HybridStudy) -> FloatArray:
    """Return the lengths of both links at all helix samples and points, from the platform to each slider."""
    joints = np.vstack([study.joints, study.point_joints])
    variables = study.arm.dh_variables(joints)
    h_mm = study.dimension("h_mm")
    left = np.hypot(variables["z2"] + h_mm, variables["z3"] - joints[:, 1])
    right = np.hypot(variables["z2"] - h_mm, variables["z3"] - joints[:, 2])
    return np.column_stack([left, right])


def _loop_apart(study: HybridStudy) -> float:
    """Return the largest difference of a joint from the loop's numerical solution, driven at the tool as in ADAMS."""
    poses = np.vstack([study.poses, study.points])
    solved = LoopClosure.of(study.robot).driven_at_the_tool(poses)
    return float(np.abs(solved.joints - study.joints_at(poses)).max())


def _loop_tool_apart_mm(study: HybridStudy) -> float:
    """Return the largest distance of the tool from the loop's numerical solution, driven at the joints."""
    joints = np.vstack([study.joints, study.point_joints])
    solved = LoopClosure.of(study.robot).driven_at_the_joints(joints)
    return float(np.linalg.norm((solved.poses - study.arm.forward(joints))[:, :3], axis=1).max())


def _linear_joints(study: HybridStudy) -> FloatArray:
    return np.column_stack([np.interp(study.dense_s, study.t_s, column) for column in study.joints.T])


def _akima_joints(study: HybridStudy) -> FloatArray:
    return make_job(study.robot, "helix").positions(study.dense_s)


def _pulses(axis: int, name: str) -> Value[HybridStudy]:
    return Value(
        f"pulses of {name} in the 241 samples", "", None, lambda study: pulses(study.robot, study.joints)[axis]
    )


def _round_trip(study: HybridStudy) -> FloatArray:
    """Return the distances, of shape (5,), between the points and the forward kinematics of their inverse."""
    return np.asarray(np.linalg.norm((study.arm.forward(study.point_joints) - study.points)[:, :3], axis=1))


def _point_rows(study: HybridStudy) -> list[list[str]]:
    back = study.arm.forward(study.point_joints)
    other = study.arm.forward_as(study.point_joints, AssemblyMode.BELOW)
    return [
        [str(n), *(f"{value:z.6f}" for value in (*pose[:3], *joints, *again[:3])), f"{hypot(*mirrored[:2]):.3f}",
         f"{mirrored[2]:z.3f}"]
        for n, (pose, joints, again, mirrored) in enumerate(
            zip(study.points.tolist(), study.point_joints.tolist(), back.tolist(), other.tolist(), strict=True), 1)
    ]  # fmt: skip


def _helix_rows(study: HybridStudy) -> list[list[str]]:
    return [
        [f"{study.t_s[k]:g}", *(f"{value:z.3f}" for value in study.poses[k, :3]),
         *(f"{value:z.6f}" for value in study.joints[k])]
        for k in (0, 30, 60, 120, 180, 210, 240)
    ]  # fmt: skip


def _tool_panels(study: HybridStudy) -> tuple[Panel, ...]:
    t_s = np.linspace(0.0, DURATION_S, 2001)
    driven = study.arm.forward(make_job(study.robot, "helix").positions(t_s))
    wanted = helix_poses(t_s / DURATION_S, HelixOptions())
    columns = [
        (label, [("prescribed", wanted[:, i], "broad"), ("joints on Akima's splines", driven[:, i], "line")])
        for i, label in enumerate(("x [mm]", "y [mm]", "z [mm]", "phi [deg]"))
    ]
    return panels_over(t_s, "time [s]", columns)


def _joint_panels(study: HybridStudy) -> tuple[Panel, ...]:
    t_s = np.linspace(0.0, DURATION_S, 2001)
    positions = make_job(study.robot, "helix").positions(t_s)
    columns = [
        (f"{joint.name} [{joint.unit}]", [(joint.name, positions[:, axis], "line")])
        for axis, joint in enumerate(study.robot.joints)
    ]
    return panels_over(t_s, "time [s]", columns)


def _between_panels(study: HybridStudy) -> tuple[Panel, ...]:
    """Return the distances over a quarter of the second turn, where single steps can be seen."""
    shown = (study.dense_s >= _SHOWN_S[0]) & (study.dense_s <= _SHOWN_S[1])
    columns = [
        (
            "off the helix [mm]",
            [
                ("straight lines in the joints", study.off_helix_mm(_linear_joints(study))[shown], "line"),
                ("Akima's splines", study.off_helix_mm(_akima_joints(study))[shown], "line"),
            ],
        )
    ]
    return panels_over(study.dense_s[shown], "time [s]", columns)


EQUATIONS: Final[Item[HybridStudy]] = Item(
    "Eqs. 2 to 16",
    "the parallel mechanism and the arm",
    "What survives of the inverse is Z5 = Z0 - l1 + l4 - ..., and Z6 likewise; the minus means that both sliders are"
    " below the platform. The rest is derived: (z2 + h)^2 + (z3 - Z5)^2 = L^2, (z2 - h)^2 + (z3 - Z6)^2 = L^2. The"
    " numbers below are those of the second point.",
    values=(
        Value("Z5 by the fragment, completed by the root", "mm", None, lambda study: _slider_mm(study, 1), decimals=6),
        Value("Z5 of our inverse minus the fragment's", "mm", 0.0,
              lambda study: float(study.point_joints[1, 1]) - _slider_mm(study, 1), 1e-9, 9, DERIVED),
        Value("Z6 by the fragment, completed by the root", "mm", None, lambda study: _slider_mm(study, -1), decimals=6),
        Value("Z6 of our inverse minus the fragment's", "mm", 0.0,
              lambda study: float(study.point_joints[1, 2]) - _slider_mm(study, -1), 1e-9, 9, DERIVED),
        Value("links' lengths in all poses, largest difference from L", "mm", 0.0,
              lambda study: float(np.abs(_links_mm(study) - study.dimension("L_mm")).max()), 1e-9, 9, DERIVED),
        Value("our inverse minus the loop's equations solved by Newton's method, helix and points", "mm, deg", 0.0,
              _loop_apart, 1e-9, 9, DERIVED),
        Value("tool by the loop's equations minus ours, helix and points", "mm", 0.0, _loop_tool_apart_mm, 1e-9, 9,
              DERIVED),
        Value("actuated joints", "", 4, lambda study: len(study.robot.joints)),
    ),
    errata=(
        Erratum("results", "simulation only", "-", "there is no hardware in the paper"),
        Erratum("equations 2 to 16, tables 1 to 6, the helix' size", "lost in the copy used",
                "derived above; numbers assumed", "-"),
        Erratum("joint variables, in one place", "th1, z3, z4", "th1, Z5, Z6", "the mechanism's description"),
        Erratum("kind of robot, in one place", "a parallel robot", "a hybrid robot",
                "a serial waist and gripper around a parallel part"),
        Erratum("direction of z2, tool up, l2, l3", "not given", "our reading, keys of the robot's file",
                "only the fragment Z5 = Z0 - l1 + l4 - ... of the inverse survives; its minus signs mean e5 = e6 = +1"),
    ),
    not_comparable="the equations, h, L, l1 to l4 and the strokes are lost; ours are derived, and the dimensions"
    " assumed.",
)  # fmt: skip

POINTS: Final[Item[HybridStudy]] = Item(
    "Tables 2 to 6",
    "five points: pose, inverse, forward",
    "The paper's check of its equations, with our points, which lie on the helix as the paper's do.",
    values=(
        Value("points", "", 5, lambda study: len(study.points)),
        Value("pose and forward of inverse apart, largest of the five", "mm", 0.0,
              lambda study: float(_round_trip(study).max()), 1e-9, 9, DERIVED),
        Value("checks of the run that failed", "", None,
              lambda study: len(study.run_of("five-points").report.reasons)),
    ),
    listings=(
        Listing("The points, their joints, and the way back; at the end what the other assembly mode would make of the"
                " same joints",
                ("point", "x mm", "y mm", "z mm", "th1 deg", "Z5 mm", "Z6 mm", "th4 deg", "x mm", "y mm", "z mm",
                 "other radius mm", "other z mm"), _point_rows),
    ),
    errata=(
        Erratum(
            "forward and inverse kinematics",
            "without th4",
            "with phi = th1 + th4",
            "the gripper's rotation is a driven joint",
            (
                Formula("attitude at the second point, without th4 and with it", "deg",
                        lambda study: float(study.point_joints[1, 0]),
                        lambda study: float(study.point_joints[1, 0] + study.point_joints[1, 3]),
                        lambda study: float(study.points[1, 3]), "the prescribed pose", 6),
            ),
        ),
    ),
    pictures=(RunPicture("five-points", "tool-path", "From point to point by the counted steps"),),
    not_comparable="the tables' numbers are lost.",
)  # fmt: skip

HELIX: Final[Item[HybridStudy]] = Item(
    "Figs. 6 and 9",
    "the helix: tool and joints over time",
    "The paper prescribes the tip by splines of time in ADAMS, records the waist's and the sliders' curves, drives the"
    " joints with Akima's splines of them, and compares the tip's path with the first one. The same is done here with"
    " our inverse. Four turns of radius 80 mm, 60 mm up at each, are assumed.",
    values=(
        Value("duration", "s", DURATION_S, lambda study: study.run_of("helix").report.run.duration_s, 1e-9, 3),
        Value("steps", "", STEPS, lambda study: len(study.joints) - 1),
        Value("tool off the helix, joints on Akima's splines, max", "mm", None,
              lambda study: float(study.off_helix_mm(_akima_joints(study)).max()), decimals=6),
        Value("tool off the helix, straight lines in the joints, max", "mm", None,
              lambda study: float(study.off_helix_mm(_linear_joints(study)).max()), decimals=6),
        *(_pulses(axis, name) for axis, name in enumerate(("th1", "Z5", "Z6", "th4"))),
        Value("tool off with joints in whole steps, max", "mm", None,
              lambda study: float(tool_off_mm(study.robot, in_whole_steps(study.robot, study.joints),
                                              study.joints).max()), decimals=6),
        *tool_values(lambda study: study.run_of("helix")),
    ),
    listings=(
        Listing("Some of the samples", ("t s", "x mm", "y mm", "z mm", "th1 deg", "Z5 mm", "Z6 mm", "th4 deg"),
                _helix_rows),
        run_listing("helix", lambda study: study.run_of("helix")),
    ),
    pictures=(
        Plot("fig-6-tool", "The tool over time, prescribed and driven", _tool_panels),
        Plot("joints", "Waist, sliders and gripper over time", _joint_panels),
        Plot("between", "Between the samples: distance from the helix", _between_panels, columns=1),
        RunPicture("helix", "tool-pose", "The tool's pose and direction cosines by the plan of the run"),
        RunPicture("helix", "tool-path", "The helix by the counted steps"),
    ),
    not_comparable="the helix' size and the tables that go with the figures are lost, and no numbers are known of the"
    " figures' axes. The paper's results are simulated; there is no hardware in it.",
)  # fmt: skip

PAPER: Final = Paper(
    "hybrid-arm",
    "Zhou Hongju, Shaanxi Institute of Technology, Xi'an: a four-DOF hybrid (serial-parallel) handling robot; title and"
    " year are not in the copy used.",
    HybridStudy,
    (EQUATIONS, POINTS, HELIX),
)
