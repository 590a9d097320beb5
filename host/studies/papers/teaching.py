"""What is computed for the classroom robot's paper, whose items are in teaching.toml.

X. Yao, Y. Pan, Y. Gao, "Research and Implementation of SCARA Manipulator Control Algorithm in Experimental Teaching",
2017, DOI 10.3969/j.issn.1000-386x.2017.06.019.
"""

from dataclasses import dataclass
from functools import cached_property
from math import cos, degrees, radians, sin
from typing import ClassVar, Final

import numpy as np

from steptwin.host.common.arrays import FloatArray
from steptwin.host.planning.jobs.carry import GOAL_RAD, START_RAD
from steptwin.host.planning.laws import Cubic, Law, Quintic
from steptwin.host.planning.motions.joint_move import JointMove
from steptwin.host.studies.papers.paper import Computed, Curve, Figures, Panel, Rows
from steptwin.host.studies.papers.study import JobRun, Study, panels_over, texts

L1_MM: Final = 95.0
L2_MM: Final = 100.0
D4_MM: Final = -40.0
DURATION_S: Final = 1.0
STEP_S: Final = 0.015
_TURNING: Final = ((0, "th1"), (1, "th2"), (3, "th4"))
"""Columns and names of the joints that move."""
_POINTS_DEG: Final = {name: tuple(map(degrees, point)) for name, point in (("qa", START_RAD), ("qb", GOAL_RAD))}
_ENDS_S: Final = np.array([0.0, DURATION_S])


@dataclass(frozen=True)
class TeachingStudy(Study):
    """The two points, the laws between them, and the run; formulas at th1, th2, d3, th4 of `at`."""

    robot_name = "teaching-scara"
    at: ClassVar[tuple[float, ...]] = (30.0, 60.0, 20.0, 15.0)
    shown: ClassVar[tuple[float, ...]] = (20.0, 50.0, 20.0, 30.0)

    @property
    def formulas(self) -> dict[str, Computed]:
        """The misprinted formulas at `at`, and th2 at the last sample."""
        th1_deg, th2_deg, d3_mm, th4_deg = self.at
        _, _, z_mm, phi_deg = self.pose.tolist()
        th2, th4 = radians(th2_deg), radians(th4_deg)
        first, second = sin(th2) * cos(th4), cos(th2) * sin(th4)
        at_099, at_1 = self.joints[-2:, 1].tolist()
        return {
            "d3": Computed(-z_mm, -z_mm + D4_MM, d3_mm),
            "sine": Computed(first - second, first + second, sin(radians(phi_deg - th1_deg))),
            "last": Computed(at_099, at_1, _POINTS_DEG["qb"][1]),
        }

    @property
    def elbow_rows(self) -> Rows:
        """Both arms at the experiment's points."""
        rows = []
        for name, joints in _POINTS_DEG.items():
            pose = self.kinematics.forward(np.array([joints]))
            for elbow in ("left", "right"):
                branch = self.kinematics.solve(pose, elbow)
                reached = "yes" if branch.reachable[0] else "no"
                rows.append([name, elbow, reached, *texts(np.deg2rad(branch.joints[0, [0, 1, 3]]), 9)])
        return rows

    @cached_property
    def test(self) -> JobRun:
        """The test of sect. 4.2: the job `carry` with the quintic, gripping a part."""
        return JobRun(self.runs.outcome(self.robot_name, "carry", {"law": "quintic", "depth_mm": "20"}))

    @property
    def carried(self) -> int:
        """Number of parts that the test took at qa and put down at qb, by the emulated spots."""
        events = [(event[0], event[1]) for event in self.test.shelf_rows]
        return min(events.count(("box taken", "qa")), events.count(("box put down", "qb")))

    def _motion(self, law: Law) -> JointMove:
        return JointMove(self.robot.joint_names, _POINTS_DEG["qa"], _POINTS_DEG["qb"], law)

    @cached_property
    def cubic(self) -> JointMove:
        """The motion by the text's law."""
        return self._motion(Cubic(1.0, DURATION_S))

    @cached_property
    def quintic(self) -> JointMove:
        """The motion by the toolbox's law."""
        return self._motion(Quintic(1.0, DURATION_S))

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

    @property
    def goal_rad(self) -> FloatArray:
        """Where the motion ends, of shape (4,)."""
        return np.asarray(np.deg2rad(self.cubic.positions(_ENDS_S)[1]))

    @property
    def tool_at_goal(self) -> FloatArray:
        """The tool's pose at qb, of shape (4,)."""
        return np.asarray(self.kinematics.forward(np.array([_POINTS_DEG["qb"]]))[0])

    @property
    def points(self) -> Figures:
        """The points qa and qb: th1 + th2 + th4, the arm that they seem to be of, and how singular qa is.

        The tool of that arm is at y = 0 in qb: l1 sin th1 + l2 sin(th1 + th2) = 0.
        """
        th1, th2, _, _ = GOAL_RAD
        ratio = -sin(th1) / sin(th1 + th2)
        return {
            "sum_qa_rad": sum(START_RAD),
            "sum_qb_rad": sum(GOAL_RAD),
            "link_ratio": ratio,
            "goal_part": (cos(th1) + ratio * cos(th1 + th2)) / (1 + ratio),
            "determinant_mm2": L1_MM * L2_MM * sin(START_RAD[1]),
        }

    @property
    def laws(self) -> dict[str, Figures]:
        """By both laws, in degrees and seconds: peak speed of th2, largest speed and acceleration at start and end."""
        dense_s, figures = np.linspace(0.0, DURATION_S, 1001), dict[str, Figures]()
        for name, motion in (("cubic", self.cubic), ("quintic", self.quintic)):
            peak = float(np.abs(motion.velocities(dense_s)[:, 1]).max())
            figures[name] = {
                "peak": peak,
                "peak_in_samples": peak / float(self.printed_t_s[-1]),
                "end_speed": float(np.abs(motion.velocities(_ENDS_S)).max()),
                "end_acceleration": float(np.abs(motion.accelerations(_ENDS_S)).max()),
            }
        return figures

    @property
    def coefficient_rows(self) -> Rows:
        """A row for each joint that turns: eqs. 25 to 28 with T = 1 s."""
        rows = []
        for axis, name in _TURNING:
            way = GOAL_RAD[axis] - START_RAD[axis]
            rows.append([name, *texts((START_RAD[axis], 0.0, 3 * way, -2 * way))])
        return rows

    @property
    def sample_rows(self) -> Rows:
        """Some of the samples with their joints and the tool."""
        poses = self.kinematics.forward(self.joints)
        return [
            [str(k), f"{self.samples_s[k]:g}", *texts(self.joints[k, [0, 1, 3]]), *texts(poses[k, :2], 3)]
            for k in (0, 10, 20, 33, 50, 60, 66, 67)
        ]

    @property
    def _dense_s(self) -> FloatArray:
        """Instants for curves."""
        return np.linspace(0.0, DURATION_S, 501)

    @property
    def motion_panels(self) -> tuple[Panel, ...]:
        """Figs. 4 to 6: angle, speed and acceleration by both laws."""
        styles = (("cubic", self.cubic, "broad"), ("quintic", self.quintic, "broken"))
        columns = [
            (
                f"{name} [deg{per}]",
                [(law, getattr(motion, derivative)(self._dense_s)[:, axis], style) for law, motion, style in styles],
            )
            for derivative, per in (("positions", ""), ("velocities", "/s"), ("accelerations", "/s^2"))
            for axis, name in _TURNING
        ]
        return panels_over(self._dense_s, "time [s]", columns)

    @property
    def tool_panels(self) -> tuple[Panel, ...]:
        """The tool over time by both laws, and its path from above."""
        cubic, quintic = (
            self.kinematics.forward(motion.positions(self._dense_s)) for motion in (self.cubic, self.quintic)
        )
        columns = [
            (label, [("cubic", cubic[:, i], "broad"), ("quintic", quintic[:, i], "broken")])
            for i, label in enumerate(("x [mm]", "y [mm]"))
        ]
        path = Curve("path", cubic[:, 0], cubic[:, 1])
        plan = Panel("", "x [mm]", "y [mm]", (path,), true_to_scale=True)
        return (*panels_over(self._dense_s, "time [s]", columns), plan)
