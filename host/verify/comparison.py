"""Combine the expectation, a planned motion with the robot's conversions, and the evidence, axis by axis."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Any, Final, Self

import numpy as np

from steptwin.host.common.arrays import FloatArray, Int64Array
from steptwin.host.planning.motion import JointLaw, Motion
from steptwin.host.robots.coupling import Coupling
from steptwin.host.robots.kinematics import make_kinematics
from steptwin.host.robots.kinematics.chain import actual_chain
from steptwin.host.robots.poses import SCARA, Task
from steptwin.host.robots.robot import Robot
from steptwin.host.verify.counted import CountedSteps, counted_steps
from steptwin.host.verify.evidence import Evidence
from steptwin.host.verify.gates import OWN_FIRMWARE, Gates
from steptwin.host.verify.matching import Matching, match_steps, timing_errors_us
from steptwin.host.verify.net_counts import match_any_rule
from steptwin.host.verify.oracle import IdealSteps, ideal_steps


@dataclass(frozen=True, slots=True, eq=False)
class AxisLaw(JointLaw):
    """Positions and velocities of axes, from a law of the joints and their coupling."""

    law: JointLaw
    coupling: Coupling

    def positions(self, t_s: FloatArray) -> FloatArray:
        """Return axis positions, of shape (n, axes)."""
        return self.coupling.to_axes(self.law.positions(t_s))

    def velocities(self, t_s: FloatArray) -> FloatArray:
        """Return axis velocities, of shape (n, axes)."""
        return self.coupling.to_axes(self.law.velocities(t_s))


_AT_ONCE: Final = 1 << 16
"""Number of instants computed at once; bounds the memory."""

Forward = Callable[[FloatArray], FloatArray]
"""Forward kinematics, from joints of shape (n, joints) to poses of shape (n, task.width)."""


@dataclass(frozen=True, slots=True)
class Expectation:
    """A planned motion with the robot's conversions; values per joint are in the motion's joint order.

    The axes are those of the joints in the same order, then those of second motors.

    Attributes:
        motion: the planned motion.
        steps_per_unit: shape (axes,), driver steps per mm or degree of an axis position.
        joint_units: "mm" or "deg" for each joint.
        forward: the robot's forward kinematics.
        coupling: coupling of axes and joints.
        microsteps: microsteps per full step of each axis' driver; empty: those that the drivers make.
        actual_forward: forward kinematics of the actual tool, with the errors of the DH parameters in the robot's file;
            None without such errors.
        robot: the machine, whose arm and limits pictures show beside the motion; None: they leave them out.
        features: what features expect of the motion, by name.
        task: task of the tool, which defines the columns of poses.

    Raises:
        ValueError: the lengths do not agree.
    """

    motion: Motion
    steps_per_unit: FloatArray
    joint_units: tuple[str, ...]
    forward: Forward
    coupling: Coupling = field(default_factory=Coupling)
    microsteps: tuple[int, ...] = ()
    actual_forward: Forward | None = None
    robot: Robot | None = None
    features: Mapping[str, Any] = field(default_factory=dict)
    task: Task = SCARA

    @classmethod
    def of(cls, robot: Robot, motion: Motion, features: Mapping[str, Any] | None = None) -> Self:
        """Return the expectation for a motion of a robot, with what features expect of it."""
        units = tuple(joint.unit for joint in robot.joints)
        microsteps = tuple(axis.transmission.microsteps for axis in robot.axes)
        kinematics, actual = make_kinematics(robot), actual_chain(robot)
        return cls(
            motion,
            robot.steps_per_unit,
            units,
            kinematics.forward,
            robot.coupling,
            microsteps,
            actual.poses if actual else None,
            robot,
            features or {},
            kinematics.task,
        )

    def __post_init__(self) -> None:
        joints = len(self.motion.joint_names)
        if self.steps_per_unit.shape != (len(self.axis_names),) or len(self.joint_units) != joints:
            raise ValueError(
                f"{joints} joints, but steps_per_unit of shape {self.steps_per_unit.shape}"
                f" and {len(self.joint_units)} joint_units"
            )

    @property
    def axis_names(self) -> tuple[str, ...]:
        """The names of the axes: those of the joints, then those of the robot's second motors."""
        names = self.motion.joint_names
        return names if self.robot is None else (*names, *self.robot.axis_names[len(names) :])

    def microsteps_of(self, axis: int) -> int | None:
        """Return the microsteps per full step of an axis' driver; None for those that the driver makes."""
        return self.microsteps[axis] if self.microsteps else None

    @property
    def axis_motion(self) -> Motion:
        """The planned motion of the axes."""
        if not self.coupling.matrix:
            return self.motion
        return replace(self.motion, joint_names=self.axis_names, law=AxisLaw(self.motion.law, self.coupling))

    def axis_steps(self, joints: FloatArray) -> FloatArray:
        """Return the axes' positions or speeds in driver steps, from joints' of shape (..., joints)."""
        return np.asarray(self.coupling.to_axes(joints) * self.steps_per_unit)

    def axis_position(self, axis: int, t_s: FloatArray) -> FloatArray:
        """Return an axis' planned position in driver steps at instants of shape (n,); constant outside the motion."""
        within_s = np.clip(t_s, 0.0, self.motion.duration_s)
        positions = np.empty(t_s.shape)
        for begin in range(0, t_s.size, _AT_ONCE):
            part = slice(begin, begin + _AT_ONCE)
            positions[part] = self.axis_motion.positions(within_s[part])[:, axis]
        return np.asarray(positions * self.steps_per_unit[axis])

    def joints(self, steps: FloatArray | Int64Array) -> FloatArray:
        """Return the joint positions at the drivers' counts, of shape (..., axes)."""
        return self.coupling.to_joints(np.asarray(steps / self.steps_per_unit))

    def skews(self, steps: FloatArray | Int64Array) -> FloatArray:
        """Return the lead of second motors at the drivers' counts of shape (..., axes), in mm or degrees."""
        return self.coupling.skews(np.asarray(steps / self.steps_per_unit))


@dataclass(frozen=True, slots=True)
class Comparison:
    """One run: ideal steps, counted steps, and their pairs for each axis.

    `gates` are the limits that it is judged by.
    """

    expected: Expectation
    evidence: Evidence
    ideal: tuple[IdealSteps, ...]
    counted: tuple[CountedSteps, ...]
    matchings: tuple[Matching, ...]
    gates: Gates = OWN_FIRMWARE

    @property
    def joint_names(self) -> tuple[str, ...]:
        """Names of the joints."""
        return self.expected.motion.joint_names

    @property
    def axis_names(self) -> tuple[str, ...]:
        """Names of the axes: those of the joints, then those of second motors."""
        return self.expected.axis_names

    def timing_errors_us(self, axis: int) -> FloatArray:
        """Return the lateness of each step of an axis in microseconds; steps at slow crossings are left out."""
        return timing_errors_us(self.ideal[axis], self.counted[axis], self.matchings[axis])


def compare(expected: Expectation, evidence: Evidence, gates: Gates = OWN_FIRMWARE) -> Comparison:
    """Compute the ideal steps from the drivers' counts at t = 0 and match the accepted steps to them.

    Args:
        expected: the planned motion.
        evidence: the drivers' counts.
        gates: limits of the judgement; they decide the step rule by which steps are matched.

    Raises:
        ValueError: the evidence's axes are not the planned ones in the same order.
    """
    names = tuple(axis.name for axis in evidence.axes)
    if names != expected.axis_names:
        raise ValueError(f"evidence of axes {names}, but a plan of joints {expected.axis_names}")
    microsteps = expected.microsteps or (None,) * len(names)
    counted = tuple(
        counted_steps(axis, evidence.start_counts, planned)
        for axis, planned in zip(evidence.axes, microsteps, strict=True)
    )
    starts = tuple(axis.start_steps for axis in counted)
    ideal = ideal_steps(expected.axis_motion, expected.steps_per_unit, starts)
    pairs = enumerate(zip(ideal, counted, strict=True))
    matchings = tuple(
        match_steps(*pair)
        if gates.step_rule
        else match_any_rule(*pair, partial(expected.axis_position, axis), gates.position_error_steps)
        for axis, pair in pairs
    )
    return Comparison(expected, evidence, ideal, counted, matchings, gates)
