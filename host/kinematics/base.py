"""What every kinematics offers, and what an inverse solution says about itself.

Joints are arrays of shape (n, joints) in the robot's order, mm and degrees. Poses are arrays of shape (n, 4) in the
world frame: x_mm, y_mm, z_mm and the tool's attitude_deg about the vertical.
"""

from collections.abc import Mapping
from dataclasses import dataclass, fields
from typing import Final, Protocol, TypeVar

import numpy as np
from numpy.typing import NDArray

from host.errors import InputError
from host.inputs import apart, unknown
from host.robot import Joint, Robot, Unit
from host.trajectory import FloatArray

BoolArray = NDArray[np.bool_]
Geometry = TypeVar("Geometry")

LIMIT_TOLERANCE: Final = 1e-9
"""By this much, in mm or degrees, a solution may miss a joint's limit: the rounding of forward and back."""


@dataclass(frozen=True, slots=True, eq=False)
class Constraint:
    """A quantity that must stay between two limits, at each of n poses.

    Attributes:
        quantity: what it is, as the beginning of a complaint.
        unit: of the values and limits.
        values: shape (n,).
        lower: the least value.
        upper: the greatest value.
        kept: shape (n,), whether the value is between them; a NaN is not.
    """

    quantity: str
    unit: str
    values: FloatArray
    lower: float
    upper: float
    kept: BoolArray

    def complaint(self, i: int) -> str:
        """One line that says how pose i breaks this constraint."""
        value = float(self.values[i])
        text, _ = apart(value, self.lower if value < self.lower else self.upper)
        return f"{self.quantity} {text} {self.unit} is outside {self.lower:g}..{self.upper:g} {self.unit}"


@dataclass(frozen=True, slots=True, eq=False)
class Branch:
    """One of the ways in which a mechanism takes n poses.

    Attributes:
        name: of the branch, such as `right`.
        joints: shape (n, joints), beyond their limits where that is what the pose takes, NaN where nothing reaches it.
        constraints: all that must hold, the first one broken being the reason.
    """

    name: str
    joints: FloatArray
    constraints: tuple[Constraint, ...]

    @property
    def reachable(self) -> BoolArray:
        """Shape (n,): whether every constraint holds."""
        reachable: BoolArray = np.logical_and.reduce([constraint.kept for constraint in self.constraints])
        return reachable

    def reason(self, i: int) -> str | None:
        """Why pose i cannot be taken; None if it can."""
        complaints = (constraint.complaint(i) for constraint in self.constraints if not constraint.kept[i])
        return next(complaints, None)


class Kinematics(Protocol):
    """A mechanism's kinematics, vectorised over poses."""

    def forward(self, joints: FloatArray) -> FloatArray:
        """Poses, shape (n, 4), of joints of shape (n, joints); limits are not asked."""
        ...

    def inverse(self, poses: FloatArray, near: FloatArray | None = None) -> tuple[Branch, ...]:
        """Every branch for poses of shape (n, 4).

        `near`, of shape (joints,) or (n, joints), says where the machine stands: joints that the pose leaves free
        stay there. Without it they are at 0.
        """
        ...

    def joint_velocities(self, joints: FloatArray, tool_velocities: FloatArray) -> FloatArray:
        """Joint velocities, shape (n, joints), in mm/s and degrees/s, that give the tool its velocity.

        Tool velocities of shape (n, 4) are the poses' derivatives by time, per second. Joints that the pose leaves
        free stand still. At a singular pose the result is not finite.
        """
        ...


def joint_constraints(limits: tuple[Joint, ...], joints: FloatArray) -> tuple[Constraint, ...]:
    """The joints' limits as constraints on positions of shape (n, joints)."""
    return tuple(_joint_constraint(joint, joints[:, axis]) for axis, joint in enumerate(limits))


def _joint_constraint(joint: Joint, positions: FloatArray) -> Constraint:
    kept = (positions >= joint.lower - LIMIT_TOLERANCE) & (positions <= joint.upper + LIMIT_TOLERANCE)
    return Constraint(f"{joint.name}:", joint.unit, positions, joint.lower, joint.upper, kept)


def read_geometry(geometry: type[Geometry], robot: Robot) -> Geometry:
    """A mechanism's dimensions, a dataclass of floats, from those in the robot's file.

    Raises:
        InputError: one is missing or unknown, or the dataclass refuses it.
    """
    names = [field.name for field in fields(geometry)]  # type: ignore[arg-type]
    for name in robot.geometry:
        if name not in names:
            raise unknown("kinematics: dimension", name, names)
    for name in names:
        if name not in robot.geometry:
            raise InputError(f"kinematics.{name}: is missing")
    return geometry(**robot.geometry)


def require_joints(robot: Robot, expected: Mapping[str, Unit]) -> None:
    """InputError unless the robot's joints are the mechanism's, in name, order and unit."""
    if {joint.name: joint.unit for joint in robot.joints} != expected or robot.joint_names != tuple(expected):
        given = " ".join(f"{joint.name}[{joint.unit}]" for joint in robot.joints)
        right = " ".join(f"{name}[{unit}]" for name, unit in expected.items())
        raise InputError(f"joints: {given}: the kinematics {robot.kinematics!r} has {right}")
