"""The hybrid arm's paper, item by item.

H. Zhou, Shaanxi Institute of Technology, Xi'an: a four-DOF hybrid (serial-parallel) handling robot. Its equations,
tables and dimensions are lost in the copy used.
"""

from dataclasses import dataclass
from functools import cached_property
from math import hypot, sqrt
from typing import TYPE_CHECKING, Final

import numpy as np

from steptwin.host.common.arrays import FloatArray
from steptwin.host.planning.jobs import make_job
from steptwin.host.planning.jobs.hybrid_jobs import OPERATING_MODE, HelixOptions, five_poses, helix_poses
from steptwin.host.robots.kinematics import AssemblyMode, HybridArm
from steptwin.host.robots.kinematics.loop_closure import LoopClosure
from steptwin.host.robots.workspace import monte_carlo
from steptwin.host.studies.papers.drawing import COLUMNS, dh_listing, link_rows
from steptwin.host.studies.papers.paper import (
    Coverage,
    Erratum,
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

if TYPE_CHECKING:
    from matplotlib.figure import Figure

AT: Final = (20.0, 0.0, 0.0, 0.0)
"""th1, Z5, Z6, th4 where matrices are shown."""
SHOWN: Final = (-35.0, 0.0, 40.0, 0.0)
"""Joints at which frames can be told apart in a picture."""
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
    return alone(f"pulses of {name} in the 241 samples", "", lambda study: pulses(study.robot, study.joints)[axis])


def _round_trip(study: HybridStudy) -> FloatArray:
    """Return the distances, of shape (5,), between the points and the forward kinematics of their inverse."""
    return np.asarray(np.linalg.norm((study.arm.forward(study.point_joints) - study.points)[:, :3], axis=1))


def _point_rows(study: HybridStudy) -> list[list[str]]:
    return [
        [str(n), *(f"{value:z.6f}" for value in (*pose[:3], *joints))]
        for n, (pose, joints) in enumerate(zip(study.points.tolist(), study.point_joints.tolist(), strict=True), 1)
    ]


def _back_rows(study: HybridStudy) -> list[list[str]]:
    back = study.arm.forward(study.point_joints)
    other = study.arm.forward_as(study.point_joints, AssemblyMode.BELOW)
    return [
        [str(n), *(f"{value:z.6f}" for value in again[:3]), f"{hypot(*mirrored[:2]):.3f}", f"{mirrored[2]:z.3f}"]
        for n, (again, mirrored) in enumerate(zip(back.tolist(), other.tolist(), strict=True), 1)
    ]


def _simulated_joint_rows(study: HybridStudy) -> list[list[str]]:
    """Return, as table 5 of the paper, the joints of the loop driven at the tool, and how far ours are from them."""
    solved = LoopClosure.of(study.robot).driven_at_the_tool(study.points).joints
    return [
        [str(n), *(f"{value:z.6f}" for value in row), f"{apart:z.9f}"]
        for n, (row, apart) in enumerate(
            zip(solved[:, :3].tolist(), np.abs(solved - study.point_joints).max(axis=1).tolist(), strict=True), 1)
    ]  # fmt: skip


def _simulated_tool_rows(study: HybridStudy) -> list[list[str]]:
    """Return, as table 6 of the paper, the tool of the loop driven at the joints, and how far ours is from it."""
    solved = LoopClosure.of(study.robot).driven_at_the_joints(study.point_joints).poses[:, :3]
    apart_mm = np.linalg.norm(solved - study.arm.forward(study.point_joints)[:, :3], axis=1)
    return [
        [str(n), *(f"{value:z.6f}" for value in row), f"{apart:z.9f}"]
        for n, (row, apart) in enumerate(zip(solved.tolist(), apart_mm.tolist(), strict=True), 1)
    ]


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


def _outside_reach(study: HybridStudy) -> int:
    """Return how many random positions of the tool are nearer to the waist or farther than z2's range allows."""
    radius_mm = np.hypot(*monte_carlo(study.robot, 20_000, 1).cloud_mm[:, :2].T)
    middle_mm = study.dimension("l2_mm") + study.dimension("l3_mm")
    return int(np.count_nonzero(np.abs(radius_mm - middle_mm) > study.dimension("z2_max_mm") + 1e-9))


def _draw_helix(study: HybridStudy) -> "Figure":
    from steptwin.host.record.plots.in_space import draw_path_in_space

    dense = np.linspace(0.0, 1.0, 1001)
    driven_mm = study.arm.forward(make_job(study.robot, "helix").positions(DURATION_S * dense))[:, :3]
    return draw_path_in_space(study.robot, helix_poses(dense, HelixOptions())[:, :3], driven_mm, study.joints[-1])


MECHANISM: Final[Item[HybridStudy]] = Item(
    "Figs. 1 to 3, table 1, eqs. 1 to 11",
    "mechanism, frames, DH parameters",
    "A waist, a parallel mechanism of two sliders, an arm and a gripper: four driven joints. The platform, link 11, is"
    " joined to the base by three chains; the two with sliders drive it, the third only guides it and has no joint that"
    f" is driven. At th1 = {AT[0]:g} deg and the sliders and the gripper at 0, as `steptwin fk hybrid-arm 20 0 0 0"
    " --matrices` prints them too:",
    parts=(
        Part("fig. 1", "parallel mechanism: links 1 to 13, three chains",
             "picture below; the third chain's place and length are ours"),
        Part("figs. 2, 3", "equivalent mechanism and frames", "picture below"),
        Part("table 1", "DH parameters", "table below: the equivalent serial arm", Coverage.PARTLY,
             "the paper's own cells are lost in our copy"),
        Part("eqs. 1 to 11", "transforms of the links and of the tool", "T1 to T4 and 0T4 below", Coverage.PARTLY,
             "the paper's own formulas are lost in our copy"),
    ),
    values=(
        dimension("introduction", "driven joints", "", 4, lambda study: len(study.robot.joints)),
    ),
    listings=(
        dh_listing("hybrid-arm", "Table 1: DH parameters of the equivalent serial arm"),
        Listing("Eqs. 2 to 11: the links' transforms and their product", COLUMNS,
                lambda study: link_rows(study.robot, AT)),
    ),
    left_open=(
        Gap("figs. 1 to 3", "direction of z2, tool up, meaning of l2 and l3", "our reading, keys of the robot's file"),
    ),
    lost=(
        Gap("table 1", "the table's cells", "derived"),
        Gap("eqs. 1 to 9", "the formulas", "derived from figs. 2 and 3's description"),
        Gap("eqs. 2 to 12", "h, L, l1 to l4 and the strokes", "assumed, marked [A] in the robot's file"),
    ),
    pictures=(
        Sketch("fig. 1", "fig-1-arm", "the arm at home", arm_picture),
        Sketch("fig. 3", "fig-3-frames", "link frames of the equivalent serial arm", frames_picture(SHOWN)),
    ),
)  # fmt: skip

EQUATIONS: Final[Item[HybridStudy]] = Item(
    "Fig. 4, eqs. 12 to 16",
    "forward kinematics and the parallel mechanism",
    "What survives of the inverse is Z5 = Z0 - l1 + l4 - ..., and Z6 likewise; the minus means that both sliders are"
    " below the platform. The rest is derived: (z2 + h)^2 + (z3 - Z5)^2 = L^2, (z2 - h)^2 + (z3 - Z6)^2 = L^2. Eqs. 10"
    " to 12 give the position only; the attitude, th1 + th4, is ours. The numbers below are those of the second point.",
    parts=(
        Part("eq. 12", "X0, Y0, Z0", "`steptwin fk hybrid-arm`"),
        Part("fig. 4, eqs. 13 to 16", "the sliders' equations", "self-checks below"),
        Part("inverse, Z5 and Z6", "Z0 - l1 + l4 - ...", "self-checks below"),
    ),
    values=(
        alone("Z5 by the fragment, completed by the root", "mm", lambda study: _slider_mm(study, 1), 6),
        self_check("Z5 of our inverse minus the fragment's", "mm", 0.0,
                   lambda study: float(study.point_joints[1, 1]) - _slider_mm(study, 1), 1e-9, 9),
        alone("Z6 by the fragment, completed by the root", "mm", lambda study: _slider_mm(study, -1), 6),
        self_check("Z6 of our inverse minus the fragment's", "mm", 0.0,
                   lambda study: float(study.point_joints[1, 2]) - _slider_mm(study, -1), 1e-9, 9),
        self_check("links' lengths in all poses, largest difference from L", "mm", 0.0,
                   lambda study: float(np.abs(_links_mm(study) - study.dimension("L_mm")).max()), 1e-9, 9),
        self_check("our inverse minus the loop's equations solved by Newton's method, helix and points", "mm, deg", 0.0,
                   _loop_apart, 1e-9, 9),
        self_check("tool by the loop's equations minus ours, helix and points", "mm", 0.0, _loop_tool_apart_mm, 1e-9,
                   9),
    ),
    errata=(
        Erratum("text before table 5's splines, joint variables", "th1, z3, z4", "th1, Z5, Z6",
                "the mechanism's description"),
        Erratum("text on figs. 9 and table 6, kind of robot", "a parallel robot", "a hybrid robot",
                "a serial waist and gripper around a parallel part"),
    ),
    lost=(
        Gap("eqs. 12 to 16", "the formulas", "derived"),
        Gap("inverse", "all but Z0 - l1 + l4 -", "completed by the root that eq. 14's description asks for"),
    ),
)  # fmt: skip

WORKSPACE: Final[Item[HybridStudy]] = Item(
    "Fig. 5",
    "the workspace",
    "The paper scans it; here are random joints within their ranges and the scanned boundary of the sections. The sizes"
    " are those of the assumed dimensions.",
    parts=(Part("fig. 5", "workspace by scanning", "pictures below; `steptwin workspace hybrid-arm`"),),
    values=(
        self_check("random positions outside what l2, l3 and z2's range allow", "", 0, _outside_reach),
    ),
    lost=(Gap("fig. 5", "the figure, and so its axes", "assumed dimensions"),),
    pictures=(
        WorkspacePicture("fig. 5", "fig-5-cloud", "tool positions at random joint positions", in_space=True),
        WorkspacePicture("fig. 5", "fig-5-workspace", "100 000 random joint positions and the boundary"),
    ),
)  # fmt: skip

POINTS: Final[Item[HybridStudy]] = Item(
    "Tables 2 to 6",
    "five points: pose, inverse, forward; by formulas, and by simulation of the loop",
    "The paper takes five points arbitrarily in the workspace; ours lie on our helix. Its check of the formulas is the"
    " way there and back; its check by simulation drives the model at the tool, then at the joints. Here a numerical"
    " solution of the loop's equations stands for the simulated prototype.",
    parts=(
        Part("tables 2 to 4", "five points, inverse, forward", "two tables below"),
        Part("virtual prototype", "CAD model in a simulator", "numerical closure of the loop", Coverage.PARTLY,
             "kinematic only: no bodies, no masses, as in the paper's comparison"),
        Part("table 5", "inverse by simulation", "table below"),
        Part("table 6", "forward by simulation", "table below"),
    ),
    values=(
        dimension("table 2", "points", "", 5, lambda study: len(study.points)),
        self_check("pose and forward of inverse apart, largest of the five", "mm", 0.0,
                   lambda study: float(_round_trip(study).max()), 1e-9, 9),
        self_check("checks of the run that failed", "", 0,
                   lambda study: len(study.run_of("five-points").report.reasons)),
    ),
    listings=(
        Listing("Tables 2 and 3: the points and their joints",
                ("point", "x mm", "y mm", "z mm", "th1 deg", "Z5 mm", "Z6 mm", "th4 deg"), _point_rows),
        Listing("Table 4: the way back; at the end what the other assembly mode would make of the same joints",
                ("point", "x mm", "y mm", "z mm", "other radius mm", "other z mm"), _back_rows),
        Listing("Table 5: joints of the loop driven at the tool, and largest difference from ours",
                ("point", "th1 deg", "Z5 mm", "Z6 mm", "apart mm, deg"), _simulated_joint_rows),
        Listing("Table 6: tool of the loop driven at the joints, and distance from ours",
                ("point", "x mm", "y mm", "z mm", "apart mm"), _simulated_tool_rows),
    ),
    lost=(Gap("tables 2 to 6", "all numbers", "five points on our helix"),),
    pictures=(RunPicture("table 2", "five-points", "tool-path", "from point to point by the counted steps"),),
)  # fmt: skip

HELIX: Final[Item[HybridStudy]] = Item(
    "Figs. 6 to 9",
    "the helix: tool and joints over time",
    "The paper prescribes the tip by splines of time in ADAMS, records the waist's and the sliders' curves, drives the"
    " joints with Akima's splines of them, and compares the tip's path with the first one. The same is done here with"
    " our inverse. Four turns of radius 80 mm, 60 mm up at each, are assumed.",
    parts=(
        Part("fig. 6", "prescribed path of the tip: a helix", "pictures below: in space, and over time"),
        Part("fig. 7", "waist over time, 80 s, 240 steps", "picture below: th1"),
        Part("fig. 8", "sliders over time", "picture below: Z5 and Z6"),
        Part("fig. 9", "tip driven by the splines", "picture below: driven; job `helix`"),
        Part("text on fig. 6", "AKISPL: Akima's splines", "job `helix` moves on them"),
    ),
    values=(
        dimension("text on fig. 7", "duration", "s", 80.0, lambda study: study.run_of("helix").report.run.duration_s),
        dimension("text on fig. 7", "steps", "", 240, lambda study: len(study.joints) - 1),
        alone("tool off the helix, joints on Akima's splines, max", "mm",
              lambda study: float(study.off_helix_mm(_akima_joints(study)).max()), 6),
        alone("tool off the helix, straight lines in the joints, max", "mm",
              lambda study: float(study.off_helix_mm(_linear_joints(study)).max()), 6),
        *(_pulses(axis, name) for axis, name in enumerate(("th1", "Z5", "Z6", "th4"))),
        alone("tool off with joints in whole steps, max", "mm",
              lambda study: float(tool_off_mm(study.robot, in_whole_steps(study.robot, study.joints),
                                              study.joints).max()), 6),
        *tool_values(lambda study: study.run_of("helix")),
    ),
    listings=(
        Listing("Some of the samples", ("t s", "x mm", "y mm", "z mm", "th1 deg", "Z5 mm", "Z6 mm", "th4 deg"),
                _helix_rows),
        run_listing("helix", lambda study: study.run_of("helix")),
    ),
    left_open=(Gap("conclusion", "results on a real robot: the paper itself says that it has none", "emulated board"),),
    lost=(Gap("figs. 6 to 9", "the figures, and so the helix' size", "four turns of radius 80 mm, 60 mm up at each"),),
    pictures=(
        Sketch("fig. 6", "fig-6-space", "the helix in space, and the arm at its end", _draw_helix),
        Plot("figs. 6, 9", "fig-6-9-tool", "the tool over time, prescribed and driven", _tool_panels),
        Plot("figs. 7, 8", "fig-7-8-joints", "waist, sliders and gripper over time", _joint_panels),
        Plot("figs. 6, 9", "between", "between the samples: distance from the helix", _between_panels, columns=1),
        RunPicture("fig. 9", "helix", "tool-pose", "the tool's pose and direction cosines by the plan of the run"),
        RunPicture("fig. 9", "helix", "tool-path", "the helix by the counted steps"),
    ),
)  # fmt: skip

PAPER: Final = Paper(
    "hybrid-arm",
    "Zhou Hongju, Shaanxi Institute of Technology, Xi'an: a four-DOF hybrid (serial-parallel) handling robot; title and"
    " year are not in the copy used.",
    HybridStudy,
    (MECHANISM, EQUATIONS, WORKSPACE, POINTS, HELIX),
)
