"""What is computed for the laboratory SCARA's paper, whose items are in lab.toml.

H. Wang, B. Yin, R. Luo, X. Wang, "Mechanism design and kinematics analysis of 4-dof SCARA robot system", J. Mechanical
& Electrical Engineering 36(12), 2019, 1320-1324. The numbers of its figures are known as far as they stand here.
"""

from dataclasses import dataclass, replace
from functools import cached_property
from math import atan2, cos, degrees, floor, hypot, pi, radians, sin, sqrt
from typing import TYPE_CHECKING, ClassVar, Final

import numpy as np

from steptwin.host.common.arrays import FloatArray
from steptwin.host.planning.jobs.spiral import STEP_RAD, SpiralOptions, ZLaw, spiral_poses
from steptwin.host.robots.kinematics import make_kinematics
from steptwin.host.robots.kinematics.base import tool_frames
from steptwin.host.robots.poses.base_frame import BaseFrame
from steptwin.host.studies.papers.paper import Computed, Curve, Figures, Panel, Rows
from steptwin.host.studies.papers.study import Study, texts

if TYPE_CHECKING:
    from matplotlib.figure import Figure

A2_MM: Final = 400.0
A3_MM: Final = 400.0
TURNS: Final = 3
_BASE: Final = BaseFrame(x_mm=100.0, y_mm=200.0, z_mm=50.0, phi_deg=30.0)
"""A place of the base in the station, for eq. 6."""
_TRANSMISSIONS: Final = (
    "stepper 1, ball screw, big arm",
    "stepper 2, toothed belt 1, forearm",
    "stepper 3, toothed belt 2, wrist",
    "stepper 4, end effector",
)
"""Chains of J1 to J4 by sect. 1."""


@dataclass(frozen=True)
class LabStudy(Study):
    """The spiral at the paper's 377 points, and its formulas at d1, th2, th3, th4 of `at`."""

    robot_name = "lab-scara"
    at: ClassVar[tuple[float, ...]] = (150.0, 30.0, 45.0, 60.0)
    shown: ClassVar[tuple[float, ...]] = (150.0, 20.0, 50.0, 0.0)
    products: ClassVar[tuple[int, ...]] = (4, 5)

    @property
    def transmission_rows(self) -> Rows:
        """Each joint's chain by the paper, and its steps in the robot's file."""
        return [[joint.name, chain, f"{joint.transmission.steps_per_unit:g} steps/{joint.unit}"]
                for joint, chain in zip(self.robot.joints, _TRANSMISSIONS, strict=True)]  # fmt: skip

    @property
    def workspace(self) -> Figures:
        """The tool's distances from joint 2's axis, on which the paper's base frame stands, and its heights, in mm."""
        lift, elbow = self.joint["d1"], self.joint["th3"]
        ends = np.array([[lift.lower, 0.0, 0.0, 0.0], [lift.upper, 0.0, elbow.upper, 0.0]])
        (stretched, bent), heights_mm = self.transforms(ends)[:, :2, 3].tolist(), self.transforms(ends)[:, 2, 3]
        lowest, highest = heights_mm.tolist()
        return {"greatest": hypot(*stretched), "least": hypot(*bent), "lowest": lowest, "highest": highest,
                "way": highest - lowest}  # fmt: skip

    @property
    def formulas(self) -> dict[str, Computed]:
        """The formulas that the paper misprints, computed for the joints `at`."""
        d1_mm, th2_deg, th3_deg, th4_deg = self.at
        c4, s4, c23, s23 = (f(radians(angle)) for angle in (th4_deg, th2_deg + th3_deg) for f in (cos, sin))
        o_x, o_y, o_z = self.product[:3, 1].tolist()
        x_mm, y_mm, z_mm = self.product[:3, 3].tolist()
        d5_mm = float(self.robot.geometry["d5_mm"])
        r_mm = hypot(x_mm, y_mm)
        k = (r_mm**2 + A2_MM**2 - A3_MM**2) / (2 * A2_MM * r_mm)
        towards_rad, root_rad = atan2(-x_mm, y_mm), atan2(sqrt(1 - k**2), k)  # eq. 7 takes the root's + here
        printed, corrected = c4 * c23 - s4 * s23, c4 * c23 + s4 * s23
        th4_minus, th4_plus = (th2_deg + th3_deg - degrees(atan2(o_y, sign * o_x)) for sign in (-1, 1))
        return {
            "o_x": Computed(printed, corrected, o_x),
            "o": Computed(hypot(printed, o_y, o_z), hypot(corrected, o_y, o_z), 1.0),
            "p_z": Computed(d1_mm + d5_mm, d1_mm - d5_mm, z_mm),
            "th2": Computed(degrees(towards_rad + root_rad), degrees(towards_rad - root_rad), th2_deg),
            "th4": Computed(th4_minus, th4_plus, th4_deg),
        }

    @property
    def inverse(self) -> Figures:
        """Eqs. 7 and 8 at the tool's transform, how far the robot's inverse is from `at`, and eq. 6 with a base.

        The last is the largest difference between the tool's transform of a robot whose file has a `[base]`, and S_0T
        times the product.
        """
        x_mm, y_mm, z_mm = self.product[:3, 3].tolist()
        k = (x_mm**2 + y_mm**2 - A2_MM**2 - A3_MM**2) / (2 * A2_MM * A3_MM)
        based = make_kinematics(replace(self.robot, base=_BASE))
        station = tool_frames(based, np.array([self.at]))[0] - _BASE.matrix @ self.product
        return {
            "th3_deg": degrees(atan2(sqrt(1 - k**2), k)),
            "d1_mm": z_mm + float(self.robot.geometry["d5_mm"]),
            "apart": float(np.abs(self.solved - np.array(self.at)).max()),
            "station": float(np.abs(station).max()),
        }

    @cached_property
    def poses(self) -> FloatArray:
        """Poses of the spiral's points by law A, of shape (377, 4)."""
        return spiral_poses(SpiralOptions())

    @cached_property
    def _law_b(self) -> FloatArray:
        return spiral_poses(SpiralOptions(z_law=ZLaw.B))

    @cached_property
    def joints(self) -> FloatArray:
        """Joints at the points, of shape (377, 4), by inverse kinematics with the elbow on the right."""
        solved = self.kinematics.solve(self.poses, "right", np.array(self.robot.home))
        return np.asarray(np.unwrap(solved.joints, period=360.0, axis=0))

    @property
    def spiral(self) -> Figures:
        """The spiral: its points, axis, growth, attitude and rise, and what it asks of the joints of table 1."""
        joints, points = self.robot.joints, self.poses
        lower, upper, fastest = ([getattr(j, key) for j in joints] for key in ("lower", "upper", "speed_max"))
        beyond = (self.joints < lower).any(axis=0) | (self.joints > upper).any(axis=0)
        return {
            "points_in_turns": floor(TURNS * 2 * pi / STEP_RAD) + 1,
            "growth_mm": hypot(*(points[-1, :2] - points[0, :2])) / (STEP_RAD * (len(points) - 1)),
            "turned_deg": float(np.ptp(points[:, 3])),
            "rise_a_mm": float(np.ptp(points[:, 2])),
            "rise_b_mm": float(np.ptp(self._law_b[:, 2])),
            "fastest_ms": 1000 * float((np.abs(np.diff(self.joints, axis=0)).max(axis=0) / fastest).max()),
            "joints_beyond": int(np.count_nonzero(beyond)),
        }

    @property
    def joint_rows(self) -> Rows:
        """Every 47th point with its joints."""
        return [[str(k), *texts(self.poses[k, :3], 3), *texts(self.joints[k])] for k in range(0, len(self.poses), 47)]

    @property
    def range_rows(self) -> Rows:
        """A row for each joint: what the spiral needs of it, and its range of table 1."""
        lowest, highest = self.joints.min(axis=0), self.joints.max(axis=0)
        return [
            [f"{joint.name} [{joint.unit}]", f"{low:.3f}", f"{high:.3f}", f"{joint.lower:g}", f"{joint.upper:g}"]
            for joint, low, high in zip(self.robot.joints, lowest.tolist(), highest.tolist(), strict=True)
        ]

    @property
    def _u_rad(self) -> FloatArray:
        return STEP_RAD * np.arange(float(len(self.poses)))

    @property
    def _reached_mm(self) -> FloatArray:
        return np.asarray(self.transforms(self.joints)[:, :3, 3])

    @property
    def joint_panels(self) -> tuple[Panel, ...]:
        """Fig. 4: the joints over the spiral's parameter."""
        return tuple(
            Panel(joint.name, "u [rad]", f"{joint.name} [{joint.unit}]", (Curve(joint.name, self._u_rad, column),))
            for joint, column in zip(self.robot.joints, self.joints.T, strict=True)
        )

    @property
    def path_panels(self) -> tuple[Panel, ...]:
        """Fig. 5: the path from above, and both laws of its rise."""
        wanted, reached_mm, u_rad = self.poses, self._reached_mm, self._u_rad
        above = (
            Curve("prescribed", wanted[:, 0], wanted[:, 1], "broad"),
            Curve("forward of inverse", reached_mm[:, 0], reached_mm[:, 1]),
        )
        rise = (
            Curve("law A: pi mm a turn", u_rad, wanted[:, 2]),
            Curve("law B: pi mm a radian", u_rad, self._law_b[:, 2], "broken"),
        )
        plan = Panel("from above", "x [mm]", "y [mm]", above, true_to_scale=True)
        return plan, Panel("rise", "u [rad]", "z [mm]", rise)

    @property
    def spiral_picture(self) -> "Figure":
        """Fig. 5: the path in space."""
        from steptwin.host.record.plots.in_space import draw_path_in_space

        return draw_path_in_space(self.robot, self.poses[:, :3], self._reached_mm, self.joints[-1])

    def _deltas(self, joints: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return the errors at the points: of the position in mm, shape (377,), and of o's cosines, shape (377, 2)."""
        transforms, psi_rad = self.transforms(joints), np.deg2rad(self.poses[:, 3])
        wanted = np.column_stack([np.sin(psi_rad), -np.cos(psi_rad)])
        errors_mm = np.linalg.norm(transforms[:, :3, 3] - self.poses[:, :3], axis=1)
        return np.asarray(errors_mm), np.asarray(np.abs(transforms[:, :2, 1] - wanted))

    @property
    def deltas(self) -> Figures:
        """The largest errors of exact joints, and of joints in whole steps."""
        exact_mm, cosines = self._deltas(self.joints)
        stepped_mm, stepped_cosines = self._deltas(self.stepped)
        return {
            "mm": float(exact_mm.max()),
            "ax": float(cosines[:, 0].max()),
            "ay": float(cosines[:, 1].max()),
            "stepped_mm": float(stepped_mm.max()),
            "stepped_rms_mm": float(np.sqrt((stepped_mm**2).mean())),
            "stepped_a": float(stepped_cosines.max()),
        }

    @property
    def error_panels(self) -> tuple[Panel, ...]:
        """Fig. 6: the errors of exact joints, and of joints in whole steps."""
        points, (exact_mm, exact), (stepped_mm, stepped) = (
            np.arange(float(len(self.poses))), self._deltas(self.joints), self._deltas(self.stepped)
        )  # fmt: skip
        names = ("exact joints", "joints in whole steps")
        lengths = (("exact", "delta [1e-12 mm]", 1e12 * exact_mm), ("whole steps", "delta [mm]", stepped_mm))
        cosines = (("error [1e-15]", 1e15 * exact), ("error", stepped))
        return (
            *(Panel(f"position, {name}", "point", label, (Curve(curve, points, errors_mm),))
              for name, (curve, label, errors_mm) in zip(names, lengths, strict=True)),
            *(Panel(f"direction cosines of o, {name}", "point", label,
                    (Curve("delta_ax", points, errors[:, 0]), Curve("delta_ay", points, errors[:, 1], "broken")))
              for name, (label, errors) in zip(names, cosines, strict=True)),
        )  # fmt: skip
