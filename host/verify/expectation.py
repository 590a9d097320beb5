"""Hold the expectation that a run is verified against: the planned motion and the robot's conversions."""

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Self

import numpy as np

from steptwin.host.common.arrays import FloatArray, Int64Array
from steptwin.host.planning.errand import PlannedStock
from steptwin.host.planning.motions.axis_motion import AxisMotion
from steptwin.host.planning.trajectory import Trajectory
from steptwin.host.robots.coupling import Coupling
from steptwin.host.robots.kinematics import make_kinematics
from steptwin.host.robots.kinematics.chain import actual_chain
from steptwin.host.robots.robot import Robot

Forward = Callable[[FloatArray], FloatArray]
"""Forward kinematics, from joints of shape (n, joints) to poses of shape (n, 4): x_mm, y_mm, z_mm, attitude_deg."""


@dataclass(frozen=True, slots=True)
class Expectation:
    """A planned motion with the robot's conversions; values per joint are in the trajectory's joint order.

    Attributes:
        trajectory: the planned motion.
        steps_per_unit: shape (axes,), driver steps per mm or degree of an axis position.
        joint_units: "mm" or "deg" for each joint.
        forward: the robot's forward kinematics.
        coupling: how the axes follow the joints.
        microsteps: microsteps per full step of each axis' driver; empty: whatever the drivers make.
        actual_forward: forward kinematics with the errors of the DH parameters that the robot's file states: where the
            tool really is; None if it states none.
        robot: the machine, whose arm and limits pictures show beside the motion; None: they leave them out.
        stock: the boxes that the motion is planned to leave at a shelf; None: the motion planned none.

    Raises:
        ValueError: the lengths do not agree.
    """

    trajectory: Trajectory
    steps_per_unit: FloatArray
    joint_units: tuple[str, ...]
    forward: Forward
    coupling: Coupling = field(default_factory=Coupling)
    microsteps: tuple[int, ...] = ()
    actual_forward: Forward | None = None
    robot: Robot | None = None
    stock: PlannedStock | None = None

    @classmethod
    def of(cls, robot: Robot, trajectory: Trajectory, stock: PlannedStock | None = None) -> Self:
        """Return the expectation for a motion of a robot."""
        units = tuple(joint.unit for joint in robot.joints)
        microsteps = tuple(joint.transmission.microsteps for joint in robot.joints)
        forward, actual = make_kinematics(robot).forward, actual_chain(robot)
        actual_forward = actual.poses if actual else None
        return cls(
            trajectory, robot.steps_per_unit, units, forward, robot.coupling, microsteps, actual_forward, robot, stock
        )

    def __post_init__(self) -> None:
        joints = len(self.trajectory.joint_names)
        if self.steps_per_unit.shape != (joints,) or len(self.joint_units) != joints:
            raise ValueError(
                f"{joints} joints, but steps_per_unit of shape {self.steps_per_unit.shape}"
                f" and {len(self.joint_units)} joint_units"
            )

    @property
    def axis_motion(self) -> Trajectory:
        """The planned motion of the axes."""
        return AxisMotion(self.trajectory, self.coupling) if self.coupling.matrix else self.trajectory

    def axis_steps(self, joints: FloatArray) -> FloatArray:
        """Return the axes' positions or speeds in driver steps, from joints' of shape (..., joints)."""
        return np.asarray(self.coupling.to_axes(joints) * self.steps_per_unit)

    def joints(self, steps: FloatArray | Int64Array) -> FloatArray:
        """Return the joint positions at the drivers' counts, of shape (..., axes)."""
        return self.coupling.to_joints(np.asarray(steps / self.steps_per_unit))
