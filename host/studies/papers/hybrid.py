"""What is computed for the hybrid arm's paper, whose items are in hybrid.toml.

H. Zhou, Shaanxi Institute of Technology, Xi'an: a four-DOF hybrid (serial-parallel) handling robot. Its equations,
tables and dimensions are lost in the copy used.
"""

from dataclasses import dataclass, replace
from functools import cached_property
from math import hypot, sqrt
from typing import TYPE_CHECKING, ClassVar, Final

import numpy as np

from steptwin.host.common.arrays import FloatArray
from steptwin.host.planning.jobs import make_job
from steptwin.host.planning.jobs.hybrid_jobs import OPERATING_MODE, HelixOptions, five_poses, helix_poses
from steptwin.host.planning.trajectory import Trajectory
from steptwin.host.robots.kinematics import AssemblyMode, HybridArm
from steptwin.host.robots.kinematics.loop_closure import LoopClosure
from steptwin.host.robots.workspace import monte_carlo
from steptwin.host.studies.papers.paper import Figures, Panel, Rows
from steptwin.host.studies.papers.study import Study, panels_over, texts

if TYPE_CHECKING:
    from matplotlib.figure import Figure

DURATION_S: Final = 80.0
STEPS: Final = 240
_DENSE: Final = 24_001
_SHOWN_S: Final = (28.0, 33.0)
_OUTER_S: Final = 2.0
"""Time at both ends when the job starts and stops, so that the tool is early or late there."""


def _helix_at(t_s: FloatArray) -> FloatArray:
    """Return the poses of the helix, of shape (n, 4)."""
    return helix_poses(t_s / DURATION_S, HelixOptions())


def _most_mm(offsets: FloatArray) -> float:
    """Return the largest distance of differences of poses, of shape (n, 4)."""
    return float(np.linalg.norm(offsets[:, :3], axis=1).max())


def _numbered(rows: FloatArray) -> Rows:
    return [[str(n), *texts(row)] for n, row in enumerate(rows.tolist(), 1)]


@dataclass(frozen=True)
class HybridStudy(Study):
    """The five points, the helix at the paper's steps, and the runs; matrices at th1, Z5, Z6, th4 of `at`."""

    robot_name = "hybrid-arm"
    at: ClassVar[tuple[float, ...]] = (20.0, 0.0, 0.0, 0.0)
    shown: ClassVar[tuple[float, ...]] = (-35.0, 0.0, 40.0, 0.0)

    @cached_property
    def arm(self) -> HybridArm:
        """Its kinematics, which knows of assembly modes."""
        return HybridArm.of(self.robot)

    @cached_property
    def loop(self) -> LoopClosure:
        """The loop's equations, solved by numbers as a simulated prototype would be."""
        return LoopClosure.of(self.robot)

    def _dimension_mm(self, key: str) -> float:
        return float(self.robot.geometry[key])

    def _joints_at(self, poses: FloatArray) -> FloatArray:
        """Return the joints in the operating mode."""
        return self.arm.solve(poses, OPERATING_MODE).joints

    @cached_property
    def points(self) -> FloatArray:
        """The five poses, of shape (5, 4)."""
        return five_poses(self.robot)

    @cached_property
    def point_joints(self) -> FloatArray:
        """The joints at the five poses, of shape (5, 4)."""
        return self._joints_at(self.points)

    @property
    def point_rows(self) -> Rows:
        """The points and their joints."""
        return _numbered(np.column_stack([self.points[:, :3], self.point_joints]))

    @property
    def back_rows(self) -> Rows:
        """The way back, and what the other assembly mode would make of the same joints."""
        back = self.arm.forward(self.point_joints)
        other = self.arm.forward_as(self.point_joints, AssemblyMode.BELOW)
        return [
            [*row, f"{hypot(*mirrored[:2]):.3f}", f"{mirrored[2]:z.3f}"]
            for row, mirrored in zip(_numbered(back[:, :3]), other.tolist(), strict=True)
        ]

    @property
    def simulated_joint_rows(self) -> Rows:
        """Table 5: the joints of the loop driven at the tool, and how far ours are from them."""
        solved = self.loop.driven_at_the_tool(self.points).joints
        apart = np.abs(solved - self.point_joints).max(axis=1).tolist()
        return [[*row, f"{off:z.9f}"] for row, off in zip(_numbered(solved[:, :3]), apart, strict=True)]

    @property
    def simulated_tool_rows(self) -> Rows:
        """Table 6: the tool of the loop driven at the joints, and how far ours is from it."""
        solved = self.loop.driven_at_the_joints(self.point_joints).poses[:, :3]
        apart_mm = np.linalg.norm(solved - self.arm.forward(self.point_joints)[:, :3], axis=1).tolist()
        return [[*row, f"{off:z.9f}"] for row, off in zip(_numbered(solved), apart_mm, strict=True)]

    @property
    def fragment_mm(self) -> dict[str, float]:
        """Z5 and Z6 at the second point by the fragment: Z0 - l1 + l4 - sqrt(L^2 - (z2 +- h)^2)."""
        x_mm, y_mm, z0_mm, _ = self.points[1].tolist()
        z2_mm = hypot(x_mm, y_mm) - self._dimension_mm("l2_mm") - self._dimension_mm("l3_mm")
        above_mm = z0_mm - self._dimension_mm("l1_mm") + self._dimension_mm("l4_mm")
        squares = {
            name: self._dimension_mm("L_mm") ** 2 - (z2_mm + side * self._dimension_mm("h_mm")) ** 2
            for name, side in (("Z5", 1), ("Z6", -1))
        }
        return {name: above_mm - sqrt(square) for name, square in squares.items()}

    @property
    def fragment_off_mm(self) -> dict[str, float]:
        """Our inverse minus the fragment's."""
        _, z5_mm, z6_mm, _ = self.point_joints[1].tolist()
        ours = {"Z5": z5_mm, "Z6": z6_mm}
        return {name: ours[name] - mm for name, mm in self.fragment_mm.items()}

    @property
    def _all_joints(self) -> FloatArray:
        """The joints at all helix samples and points."""
        return np.vstack([self.joints, self.point_joints])

    @property
    def checks(self) -> Figures:
        """The arm against itself: lengths of links, there and back, the loop's numerical solution, reach."""
        joints, poses, h_mm = self._all_joints, np.vstack([self.poses, self.points]), self._dimension_mm("h_mm")
        variables = self.arm.dh_variables(joints)
        left_mm = np.hypot(variables["z2"] + h_mm, variables["z3"] - joints[:, 1])
        right_mm = np.hypot(variables["z2"] - h_mm, variables["z3"] - joints[:, 2])
        by_tool, by_joints = self.loop.driven_at_the_tool(poses), self.loop.driven_at_the_joints(joints)
        radius_mm = np.hypot(*monte_carlo(self.robot, 20_000, 1).cloud_mm[:, :2].T)
        off_mm = np.abs(radius_mm - self._dimension_mm("l2_mm") - self._dimension_mm("l3_mm"))
        return {
            "links_mm": float(np.abs(np.column_stack([left_mm, right_mm]) - self._dimension_mm("L_mm")).max()),
            "there_and_back_mm": _most_mm(self.arm.forward(self.point_joints) - self.points),
            "loop_joints": float(np.abs(by_tool.joints - joints).max()),
            "loop_tool_mm": _most_mm(by_joints.poses - self.arm.forward(joints)),
            "outside_reach": int(np.count_nonzero(off_mm > self._dimension_mm("z2_max_mm") + 1e-9)),
        }

    @cached_property
    def t_s(self) -> FloatArray:
        """The instants of the paper's 240 steps."""
        return DURATION_S * np.arange(STEPS + 1) / STEPS

    @cached_property
    def poses(self) -> FloatArray:
        """The helix at these instants, of shape (241, 4)."""
        return _helix_at(self.t_s)

    @cached_property
    def joints(self) -> FloatArray:
        """The joints at these instants, of shape (241, 4)."""
        return self._joints_at(self.poses)

    @cached_property
    def _job(self) -> Trajectory:
        return make_job(self.robot, "helix")

    @cached_property
    def _dense_s(self) -> FloatArray:
        """Instants between the steps."""
        return np.linspace(_OUTER_S, DURATION_S - _OUTER_S, _DENSE)

    @cached_property
    def off_helix_mm(self) -> dict[str, FloatArray]:
        """The tool's distances from the helix at these, with the joints on straight lines and on Akima's splines."""
        linear = np.column_stack([np.interp(self._dense_s, self.t_s, column) for column in self.joints.T])
        wanted_mm = _helix_at(self._dense_s)[:, :3]
        curves = {"linear": linear, "akima": self._job.positions(self._dense_s)}
        return {
            name: np.asarray(np.linalg.norm(self.arm.forward(joints)[:, :3] - wanted_mm, axis=1))
            for name, joints in curves.items()
        }

    @property
    def off_most_mm(self) -> dict[str, float]:
        """The largest of these distances."""
        return {name: float(off_mm.max()) for name, off_mm in self.off_helix_mm.items()}

    @property
    def steps(self) -> int:
        """Number of the helix' steps."""
        return len(self.joints) - 1

    @property
    def helix_rows(self) -> Rows:
        """Some of the samples."""
        return [
            [f"{self.t_s[k]:g}", *texts(self.poses[k, :3], 3), *texts(self.joints[k])]
            for k in (0, 30, 60, 120, 180, 210, 240)
        ]

    @property
    def helix_picture(self) -> "Figure":
        """Fig. 6: the helix in space."""
        from steptwin.host.record.plots.in_space import draw_path_in_space

        t_s = DURATION_S * np.linspace(0.0, 1.0, 1001)
        driven_mm = self.arm.forward(self._job.positions(t_s))[:, :3]
        return draw_path_in_space(self.robot, _helix_at(t_s)[:, :3], driven_mm, self.joints[-1])

    @property
    def tool_panels(self) -> tuple[Panel, ...]:
        """Figs. 6 and 9: the tool over time, prescribed and driven."""
        t_s = np.linspace(0.0, DURATION_S, 2001)
        driven, wanted = self.arm.forward(self._job.positions(t_s)), _helix_at(t_s)
        columns = [
            (label, [("prescribed", wanted[:, i], "broad"), ("joints on Akima's splines", driven[:, i], "line")])
            for i, label in enumerate(("x [mm]", "y [mm]", "z [mm]", "phi [deg]"))
        ]
        return panels_over(t_s, "time [s]", columns)

    @property
    def joint_panels(self) -> tuple[Panel, ...]:
        """Figs. 7 and 8: the joints over time."""
        t_s = np.linspace(0.0, DURATION_S, 2001)
        curves = dict(zip(self.robot.joint_names, self._job.positions(t_s).T, strict=True))
        columns = [
            ("th1 [deg]", [("th1", curves["th1"], "line")]),
            ("sliders [mm]", [("Z5, left", curves["Z5"], "line"), ("Z6, right", curves["Z6"], "line")]),
            ("th4 [deg]", [("th4", curves["th4"], "line")]),
        ]
        titles = ("fig. 7: waist", "fig. 8: sliders", "gripper, not in the paper")
        panels = panels_over(t_s, "time [s]", columns)
        return tuple(replace(panel, title=title) for panel, title in zip(panels, titles, strict=True))

    @property
    def between_panels(self) -> tuple[Panel, ...]:
        """The distances over a quarter of the second turn, where single steps can be seen."""
        shown = (self._dense_s >= _SHOWN_S[0]) & (self._dense_s <= _SHOWN_S[1])
        names = (("straight lines in the joints", "linear"), ("Akima's splines", "akima"))
        curves = [(name, self.off_helix_mm[key][shown], "line") for name, key in names]
        return panels_over(self._dense_s[shown], "time [s]", [("off the helix [mm]", curves)])
