"""What every kinematics offers, and what an inverse solution says about itself.

Joints are arrays of shape (n, joints) in the robot's order, mm and degrees. Poses are arrays of shape (n, 4) in the
world frame: x_mm, y_mm, z_mm and the tool's attitude_deg about the vertical.
"""

from collections.abc import Mapping
from dataclasses import dataclass, fields
from typing import Final, Protocol, TypeVar

import numpy as np
from numpy.typing import NDArray

from steptwin.host.common.arrays import FloatArray
from steptwin.host.common.bad_input import apart, unknown
from steptwin.host.common.errors import InputError
from steptwin.host.robots.joint import Joint, Unit
from steptwin.host.robots.kinematics.dh import DhTable
from steptwin.host.robots.robot import Robot

BoolArray = NDArray[np.bool_]
Geometry = TypeVar("Geometry")

LIMIT_TOLERANCE: Final = 1e-9
"""By this much, in mm or degrees, a solution may miss a joint's limit: the rounding of forward and back."""


@dataclass(frozen=True, slots=True, eq=False)
class Constraint:
    """A quantity that must stay between two limits, at each of n poses.

    Attributes:
        quantity: what it is, as the beginning of a complaint.
        unit: of the values and limits; empty for a plain number.
        values: shape (n,).
        lower: the least value.
        upper: the greatest value.
        kept: shape (n,), whether the value is between them; a NaN is not.
        complaint_text: what to say instead of the figures, where these say nothing to people.
    """

    quantity: str
    unit: str
    values: FloatArray
    lower: float
    upper: float
    kept: BoolArray
    complaint_text: str = ""

    def complaint(self, i: int) -> str:
        """One line that says how pose i breaks this constraint."""
        if self.complaint_text:
            return self.complaint_text
        value = float(self.values[i])
        text, _ = apart(value, self.lower if value < self.lower else self.upper)
        unit = f" {self.unit}" if self.unit else ""
        return f"{self.quantity} {text}{unit} is outside {self.lower:g}..{self.upper:g}{unit}"


@dataclass(frozen=True, slots=True, eq=False)
class Branch:
    """One of the ways in which a mechanism takes n poses.

    Attributes:
        name: of the branch, such as `right`.
        joints: shape (n, joints), beyond their limits where that is what the pose takes, NaN where nothing reaches it.
        mechanism: what must hold for the mechanism to get there at all.
        limits: the joints' limits.
    """

    name: str
    joints: FloatArray
    mechanism: tuple[Constraint, ...]
    limits: tuple[Constraint, ...]

    @property
    def constraints(self) -> tuple[Constraint, ...]:
        """All that must hold, the first one broken being the reason."""
        return self.mechanism + self.limits

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

    @property
    def branches(self) -> tuple[str, ...]:
        """The names of the ways to take a pose, the usual one first."""
        ...

    @property
    def dh(self) -> DhTable:
        """The mechanism as a DH table from the world to the tool."""
        ...

    def dh_variables(self, joints: FloatArray) -> dict[str, FloatArray]:
        """The variables of the DH table, each of shape (n,), for joints of shape (n, joints)."""
        ...

    def forward(self, joints: FloatArray) -> FloatArray:
        """Poses, shape (n, 4), of joints of shape (n, joints); limits are not asked."""
        ...

    def inverse(self, poses: FloatArray, near: FloatArray | None = None) -> tuple[Branch, ...]:
        """Every branch for poses of shape (n, 4).

        `near`, of shape (joints,) or (n, joints), says where the machine stands: joints that the pose leaves free
        stay there, and joints that turn further than a circle take the nearest turn. Without it they are at 0.
        """
        ...

    def solve(self, poses: FloatArray, branch: str, near: FloatArray | None = None) -> Branch:
        """One branch, by its name; else as `inverse`."""
        ...

    def singularities(self, joints: FloatArray) -> tuple[Constraint, ...]:
        """What must stay away from 0 so that tool velocities have joint velocities: numbers from 0 to 1."""
        ...

    def joint_velocities(self, joints: FloatArray, tool_velocities: FloatArray) -> FloatArray:
        """Joint velocities, shape (n, joints), in mm/s and degrees/s, that give the tool its velocity.

        Tool velocities of shape (n, 4) are the poses' derivatives by time, per second. Joints that the pose leaves
        free stand still. At a singular pose the result is not finite.
        """
        ...


def singularity_measure(kinematics: Kinematics, joints: FloatArray) -> FloatArray:
    """Shape (n,): how far joints of shape (n, joints) are from the nearest singularity, from 0 to 1."""
    values = [constraint.values for constraint in kinematics.singularities(joints)]
    return np.asarray(np.minimum.reduce(values))


def within_limits(limits: tuple[Joint, ...], joints: FloatArray) -> BoolArray:
    """Shape (n,): whether joints of shape (n, joints) keep all their limits."""
    kept: BoolArray = np.logical_and.reduce([constraint.kept for constraint in joint_constraints(limits, joints)])
    return kept


def joint_constraints(limits: tuple[Joint, ...], joints: FloatArray) -> tuple[Constraint, ...]:
    """The joints' limits as constraints on positions of shape (n, joints)."""
    return tuple(_joint_constraint(joint, joints[:, axis]) for axis, joint in enumerate(limits))


def nearest_turns(limits: tuple[Joint, ...], joints: FloatArray, near: FloatArray | None) -> None:
    """Turn rotary joints, in place, by full circles: to the turn within the limits that is nearest to `near` or 0.

    Joints whose limits are within one circle have no choice, and are left alone.
    """
    for axis, joint in enumerate(limits):
        if joint.unit is not Unit.DEG or (joint.lower >= -180.0 and joint.upper <= 180.0):
            continue
        angle_deg = joints[:, axis]
        fewest = np.ceil((joint.lower - LIMIT_TOLERANCE - angle_deg) / 360.0)
        most = np.floor((joint.upper + LIMIT_TOLERANCE - angle_deg) / 360.0)
        wanted = np.round(((0.0 if near is None else near[..., axis]) - angle_deg) / 360.0)
        joints[:, axis] += 360.0 * np.where(fewest <= most, np.clip(wanted, fewest, most), 0.0)


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
