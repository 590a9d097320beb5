"""The SCARA family: a planar arm of two links, with or without a wrist and a lift, and optional slides below them.

h is the direction of the arm when shoulder and elbow are at 0. w is +1, or -1 if the tool points down, because
Rx(180) Rz(t) = Rz(-t) Rx(180):

    attitude = h + shoulder + elbow + w wrist
    x = l1 cos(h + shoulder) + l2 cos(h + shoulder + elbow) + l_tool cos(attitude) + slide        y with sin
    z = z0 + lift + slide, or z0 - lift + slide if the lift pushes downwards

Without a wrist or a lift its term is left out: then the attitude or the height of a pose is not free. The columns of
the joints and the signs with which they count are data, given by each mechanism's own module.

From shoulder to wrist the arm is two links in a plane, `Planar2R`:

    x = l1 cos th1 + l2 cos(th1 + th2)        y = l1 sin th1 + l2 sin(th1 + th2)

Their inverse follows from the law of cosines. It uses atan2 throughout, which keeps the quadrant; the sign of the elbow
is the only choice (J. J. Craig, "Introduction to Robotics", section 4.4):

    c2 = (x^2 + y^2 - l1^2 - l2^2) / (2 l1 l2)    th2 = +-atan2(sqrt(1 - c2^2), c2)
    th1 = atan2(y, x) - atan2(l2 sin th2, l1 + l2 cos th2)

There angles are in radians, and all arguments and results are arrays of one shape.
"""

from dataclasses import dataclass
from enum import Enum
from typing import Final

import numpy as np

from steptwin.host.common.arrays import BoolArray, FloatArray
from steptwin.host.common.errors import InputError
from steptwin.host.robots.joint import Joint
from steptwin.host.robots.kinematics.base import Branch, Constraint, joint_constraints, nearest_turns
from steptwin.host.robots.kinematics.links import ArmPart, scara_links
from steptwin.host.robots.kinematics.on_base import OnBase
from steptwin.host.robots.poses.rotations import wrapped_deg

REACH_TOLERANCE: Final = 1e-9
"""Rounding error by which |c2| may exceed 1 at the edge of reach."""


class Elbow(Enum):
    """Side of the elbow relative to the line from shoulder to wrist, seen outwards; right has th2 >= 0."""

    RIGHT = "right"
    LEFT = "left"

    @property
    def sign(self) -> int:
        """The sign of th2."""
        return 1 if self is Elbow.RIGHT else -1


@dataclass(frozen=True, slots=True)
class Planar2R:
    """The two links, in mm; raises InputError unless both are longer than 0."""

    l1_mm: float
    l2_mm: float

    def __post_init__(self) -> None:
        if not (self.l1_mm > 0 and self.l2_mm > 0):
            raise InputError(f"links of {self.l1_mm:g} and {self.l2_mm:g} mm make no arm")

    @property
    def reach_mm(self) -> tuple[float, float]:
        """Lowest and highest distance of the wrist from the shoulder."""
        return abs(self.l1_mm - self.l2_mm), self.l1_mm + self.l2_mm

    def forward(self, th1_rad: FloatArray, th2_rad: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return the wrist's x and y in mm."""
        x_mm = self.l1_mm * np.cos(th1_rad) + self.l2_mm * np.cos(th1_rad + th2_rad)
        y_mm = self.l1_mm * np.sin(th1_rad) + self.l2_mm * np.sin(th1_rad + th2_rad)
        return x_mm, y_mm

    def inverse(self, x_mm: FloatArray, y_mm: FloatArray, elbow: Elbow) -> tuple[FloatArray, FloatArray]:
        """Return th1 in (-2 pi, 2 pi) and th2 in [-pi, pi]; both are NaN where the wrist is out of reach."""
        l1, l2 = self.l1_mm, self.l2_mm
        c2 = (x_mm**2 + y_mm**2 - l1**2 - l2**2) / (2.0 * l1 * l2)
        c2 = np.where(np.abs(c2) <= 1.0 + REACH_TOLERANCE, np.clip(c2, -1.0, 1.0), np.nan)
        th2_rad = elbow.sign * np.arctan2(np.sqrt(1.0 - c2**2), c2)
        th1_rad = np.arctan2(y_mm, x_mm) - np.arctan2(l2 * np.sin(th2_rad), l1 + l2 * c2)
        return th1_rad, th2_rad

    def determinant(self, th2_rad: FloatArray) -> FloatArray:
        """Return det J = l1 l2 sin th2 in mm^2; it is 0 where the arm is stretched or folded and the branches meet."""
        return np.asarray(self.l1_mm * self.l2_mm * np.sin(th2_rad))

    def joint_velocities(
        self, th1_rad: FloatArray, th2_rad: FloatArray, vx_mm_s: FloatArray, vy_mm_s: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        """Return the joints' speeds in rad/s for the wrist's velocity: J^-1 v in closed form; not finite if singular.

        J = [[-y, -l2 s12], [x, l2 c12]] with the wrist (x, y), s12 = sin(th1 + th2), c12 = cos(th1 + th2).
        """
        x_mm, y_mm = self.forward(th1_rad, th2_rad)
        across = self.l2_mm * (np.cos(th1_rad + th2_rad) * vx_mm_s + np.sin(th1_rad + th2_rad) * vy_mm_s)
        outward = x_mm * vx_mm_s + y_mm * vy_mm_s
        det = self.determinant(th2_rad)
        with np.errstate(divide="ignore", invalid="ignore"):
            return across / det, -outward / det


SINGULAR: Final = 0.005
"""Least |sin(elbow)|, 0.29 degrees from a stretched or folded arm; below, the arm is near singular."""

FOLLOWING: Final = 1e-3
"""Tolerance in mm or degrees of a height or attitude that the arm determines. It is less than a microstep, and allows
poses with as many digits as are printed."""


@dataclass(frozen=True, slots=True)
class Scara(OnBase):
    """The kinematics of one mechanism of the family; implements Kinematics.

    Attributes:
        limits: joints in axis order; their limits determine only whether a pose is reachable.
        arm: the two links.
        lift: column of the lift; None if there is none.
        shoulder: column of the shoulder.
        elbow: column of the elbow.
        wrist: column of the wrist; None if there is none.
        height_mm: z0, height of the tool with the lift at 0.
        heading_deg: h, direction of the arm at shoulder = elbow = 0.
        lift_sign: -1 if the lift pushes the tool down, otherwise 1.
        wrist_sign: w, -1 if the tool points down, otherwise 1.
        tool_mm: l_tool, distance of the tool from the wrist's axis, in the direction of the attitude.
        base_mm: height of the first link with the lift at 0, only for drawing.
        offset_mm: height of the second link above the first, only for drawing.
    """

    limits: tuple[Joint, ...]
    arm: Planar2R
    lift: int | None
    shoulder: int
    elbow: int
    wrist: int | None
    height_mm: float
    heading_deg: float = 0.0
    lift_sign: int = 1
    wrist_sign: int = 1
    tool_mm: float = 0.0
    base_mm: float = 0.0
    offset_mm: float = 0.0

    @property
    def branches(self) -> tuple[str, ...]:
        """The elbow's sides, `right` and `left`."""
        return tuple(elbow.value for elbow in Elbow)

    @property
    def attitude_follows(self) -> bool:
        """True without a wrist."""
        return self.wrist is None

    @property
    def turning(self) -> int | None:
        """The wrist, unless the tool is beside its axis."""
        return None if self.tool_mm else self.wrist

    @property
    def levers_mm(self) -> FloatArray:
        """Shape (joints,): largest travel of any point of the arm, in mm, per mm or degree of each joint alone."""
        levers_mm = np.ones(len(self.limits))
        lengths_mm = {self.shoulder: sum(self._reaches_mm), self.elbow: sum(self._reaches_mm[1:])}
        if self.wrist is not None:
            lengths_mm[self.wrist] = self._reaches_mm[2]
        for column, length_mm in lengths_mm.items():
            levers_mm[column] = np.deg2rad(length_mm)
        return levers_mm

    @property
    def _reaches_mm(self) -> tuple[float, float, float]:
        """Lengths of both links and of the tool beside the wrist."""
        return self.arm.l1_mm, self.arm.l2_mm, abs(self.tool_mm)

    def dh_variables(self, joints: FloatArray) -> dict[str, FloatArray]:
        """Return the joints by their names."""
        return {joint.name: joints[:, axis] for axis, joint in enumerate(self.limits)}

    def forward_from_base(self, joints: FloatArray) -> FloatArray:
        """Return poses of shape (n, 4) in the base's frame for joints of shape (n, joints)."""
        shoulder_deg = joints[:, self.shoulder] + self.heading_deg
        attitude_deg = self._attitude_deg(joints)
        poses = np.empty((len(joints), 4))
        poses[:, 0], poses[:, 1] = self.arm.forward(np.deg2rad(shoulder_deg), np.deg2rad(joints[:, self.elbow]))
        poses[:, 2] = self.height_mm if self.lift is None else self.height_mm + self.lift_sign * joints[:, self.lift]
        poses[:, 3] = wrapped_deg(attitude_deg)
        if self.tool_mm:
            poses[:, 0] += self.tool_mm * np.cos(np.deg2rad(attitude_deg))
            poses[:, 1] += self.tool_mm * np.sin(np.deg2rad(attitude_deg))
        for column, coordinate in self.slides:
            poses[:, coordinate] += joints[:, column]
        return poses

    def links_from_base(self, joints: FloatArray) -> tuple[ArmPart, ...]:
        """Return the slides' guides, the column, both links and the tool, for joints of shape (n, joints)."""
        return scara_links(self, joints)

    def solve_from_base(self, poses: FloatArray, branch: str, near: FloatArray | None) -> Branch:
        """Return one branch for poses of shape (n, 4) in the base's frame; slides are as in `near`, or at 0.

        Angles are in (-180, 180], or in the turn within the limits nearest to `near`.
        """
        joints = np.zeros((len(poses), len(self.limits)))
        for column, _ in self.slides:
            joints[:, column] = 0.0 if near is None else near[..., column]
        x_mm, y_mm = self._wrist(poses, joints)
        shoulder_rad, elbow_rad = self.arm.inverse(x_mm, y_mm, Elbow(branch))
        slid_mm = sum((joints[:, column] for column, coordinate in self.slides if coordinate == 2), np.zeros(()))
        lifted_mm = poses[:, 2] - slid_mm - self.height_mm
        if self.lift is not None:
            joints[:, self.lift] = self.lift_sign * lifted_mm
        joints[:, self.shoulder] = wrapped_deg(np.rad2deg(shoulder_rad) - self.heading_deg)
        joints[:, self.elbow] = np.rad2deg(elbow_rad)
        arm_deg = self.heading_deg + joints[:, self.shoulder] + joints[:, self.elbow]
        if self.wrist is not None:
            joints[:, self.wrist] = wrapped_deg(self.wrist_sign * (poses[:, 3] - arm_deg))
        nearest_turns(self.limits, joints, near)
        mechanism = [self._reach(np.hypot(x_mm, y_mm), kept=~np.isnan(elbow_rad))]
        if self.lift is None:
            mechanism.append(_followed("z", "mm", poses[:, 2] + self.base.z_mm, lifted_mm))
        if self.wrist is None:
            attitude_deg = np.where(np.isnan(poses[:, 3]), arm_deg, poses[:, 3])
            deviations_deg = wrapped_deg(attitude_deg - arm_deg)
            mechanism.append(_followed("phi", "deg", attitude_deg + self.base.phi_deg, deviations_deg))
        return Branch(branch, joints, tuple(mechanism), joint_constraints(self.limits, joints))

    def singularities(self, joints: FloatArray) -> tuple[Constraint, ...]:
        """Return |sin(elbow)| = |det J| / (l1 l2), which is 0 where the arm is stretched or folded."""
        values = np.abs(np.sin(np.deg2rad(joints[:, self.elbow])))
        name = self.limits[self.elbow].name
        return (Constraint(f"{name}: near singular, |sin {name}|", "", values, SINGULAR, 1.0, values >= SINGULAR),)

    def velocities_from_base(self, joints: FloatArray, tool_velocities: FloatArray) -> FloatArray:
        """Return joint velocities for joints (n, joints) and pose derivatives (n, 4); slides do not move."""
        shoulder_rad = np.deg2rad(joints[:, self.shoulder] + self.heading_deg)
        elbow_rad = np.deg2rad(joints[:, self.elbow])
        attitude_rad = shoulder_rad + elbow_rad
        if self.wrist is not None:
            attitude_rad = attitude_rad + self.wrist_sign * np.deg2rad(joints[:, self.wrist])
        turning_mm_s = self.tool_mm * np.deg2rad(tool_velocities[:, 3])
        shoulder_rad_s, elbow_rad_s = self.arm.joint_velocities(
            shoulder_rad,
            elbow_rad,
            tool_velocities[:, 0] + turning_mm_s * np.sin(attitude_rad),
            tool_velocities[:, 1] - turning_mm_s * np.cos(attitude_rad),
        )
        velocities = np.zeros_like(joints)
        if self.lift is not None:
            velocities[:, self.lift] = self.lift_sign * tool_velocities[:, 2]
        velocities[:, self.shoulder] = np.rad2deg(shoulder_rad_s)
        velocities[:, self.elbow] = np.rad2deg(elbow_rad_s)
        if self.wrist is not None:
            with np.errstate(invalid="ignore"):  # the difference of two infinities is invalid
                arm_deg_s = velocities[:, self.shoulder] + velocities[:, self.elbow]
            velocities[:, self.wrist] = self.wrist_sign * (tool_velocities[:, 3] - arm_deg_s)
        return velocities

    def _attitude_deg(self, joints: FloatArray) -> FloatArray:
        arm_deg = joints[:, self.shoulder] + self.heading_deg + joints[:, self.elbow]
        return np.asarray(arm_deg if self.wrist is None else arm_deg + self.wrist_sign * joints[:, self.wrist])

    def _wrist(self, poses: FloatArray, joints: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return the wrist's x and y in mm relative to the shoulder, whose position depends on the slides."""
        x_mm, y_mm = poses[:, 0], poses[:, 1]
        if self.tool_mm:
            attitude_rad = np.deg2rad(poses[:, 3])
            x_mm, y_mm = x_mm - self.tool_mm * np.cos(attitude_rad), y_mm - self.tool_mm * np.sin(attitude_rad)
        for column, coordinate in self.slides:
            if coordinate == 0:
                x_mm = x_mm - joints[:, column]
        return x_mm, y_mm

    def _reach(self, wrist_mm: FloatArray, kept: BoolArray) -> Constraint:
        nearest_mm, farthest_mm = self.arm.reach_mm
        return Constraint("shoulder to wrist", "mm", wrist_mm, nearest_mm, farthest_mm, kept)


def _followed(name: str, unit: str, given: FloatArray, deviations: FloatArray) -> Constraint:
    """Return the constraint that a coordinate of the pose equals the one that the arm determines."""

    def explain(i: int) -> str:
        what, why = ("height", "has no lift") if name == "z" else ("attitude", "does not turn by itself")
        right = float(given[i] - deviations[i])
        return f"{name} {given[i]:.4f} {unit}: the tool {why}, its {what} here is {right:.4f} {unit}"

    kept = np.abs(deviations) <= FOLLOWING
    return Constraint(name, unit, deviations, -FOLLOWING, FOLLOWING, kept, explain)
