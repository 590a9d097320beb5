"""A robot's DH chain with parameter errors: the true pose of the tool, and its derivatives by the parameters.

Motions are planned with the nominal model, the closed form of `make_kinematics`. Here the DH table is multiplied out
with the errors in the robot file: wrong lengths, and axes that are not parallel.

A row of the table is two screws: a and alpha along and about x, d and theta along and about z. An error of a parameter
shifts the rest of the chain along the axis of its screw, or turns it about this axis. So the derivatives of the tool's
position p and attitude are geometric; u is the direction of the axis and o a point on it, both in the station's frame:


    by a length    dp = u                 no turning
    by an angle    dp = u x (p - o)       turning about u

In a standard table the z screw comes first, about the z axis of the frame before the row, and the x screw about the x
axis of the frame behind it; in a modified table it is the other way round. Source: the columns of the geometric
Jacobian, B. Siciliano et al., "Robotics: Modelling, Planning and Control", section 3.1.3, for all four parameters of a
link instead of the joint's alone.
"""

from collections.abc import Iterable
from dataclasses import dataclass, replace
from typing import Final, Self

import numpy as np

from steptwin.host.common.arrays import FloatArray
from steptwin.host.common.bad_input import prefixed, unknown
from steptwin.host.common.errors import InputError
from steptwin.host.common.findings import Findings
from steptwin.host.robots.kinematics.dh import Convention, DhTable
from steptwin.host.robots.kinematics.kinds import make_kinematics
from steptwin.host.robots.link_errors import QUANTITIES, LinkErrors
from steptwin.host.robots.poses.rotations import wrapped_deg
from steptwin.host.robots.robot import Robot

MOVES: Final = ("x_mm", "y_mm", "z_mm", "rx_deg", "ry_deg", "rz_deg")
"""Effects of a parameter on the tool: shifts along and turns about the station's axes; rz adds to the attitude."""


@dataclass(frozen=True, slots=True, eq=False)
class Chain:
    """A robot's DH chain.

    Attributes:
        table: the nominal table.
        joint_names: the joints in axis order; all variables of the table are among them.
        errors: shape (links, 4), errors of a_mm, alpha_deg, d_mm and theta_deg of each row.
    """

    table: DhTable
    joint_names: tuple[str, ...]
    errors: FloatArray

    @classmethod
    def of(cls, robot: Robot) -> Self:
        """Return the chain with the errors in the robot file; raise InputError for a robot that is no DH chain."""
        table = make_kinematics(robot).dh
        with prefixed(f"{robot.name}: "):
            check_links(robot.kinematics, table, robot.joint_names, robot.dh_errors)
        errors = (robot.dh_errors.get(name, LinkErrors()) for name in table.link_names)
        return cls(table, robot.joint_names, np.array([[getattr(e, q) for q in QUANTITIES] for e in errors]))

    @property
    def parameters(self) -> tuple[str, ...]:
        """The names of all parameters, in the order of the flattened errors: link1.a_mm and so on."""
        return tuple(f"{link}.{quantity}" for link in self.table.link_names for quantity in QUANTITIES)

    @property
    def link_errors(self) -> dict[str, LinkErrors]:
        """The errors by link, without links that have none; raises InputError for an error that is too large."""
        rows = zip(self.table.link_names, self.errors.tolist(), strict=True)
        return {link: LinkErrors(*row) for link, row in rows if any(row)}

    def with_errors(self, errors: FloatArray) -> Self:
        """Return the chain with other errors, of shape (links, 4) or flattened."""
        return replace(self, errors=np.reshape(errors, self.errors.shape))

    def transforms(self, joints: FloatArray) -> FloatArray:
        """Return the tool's homogeneous transforms in the station, (n, 4, 4), for joints of shape (n, joints)."""
        tool: FloatArray = self._frames(joints)[-1]
        return tool

    def poses(self, joints: FloatArray) -> FloatArray:
        """Return poses of shape (n, 4); the attitude is the direction of the tool's x axis seen from above."""
        transforms = self.transforms(joints)
        attitude_deg = np.rad2deg(np.arctan2(transforms[:, 1, 0], transforms[:, 0, 0]))
        return np.column_stack([transforms[:, :3, 3], wrapped_deg(attitude_deg)])

    def tilts_deg(self, joints: FloatArray) -> FloatArray:
        """Return, of shape (n,), the angles between the tool's axis and the vertical."""
        x, y, z = self.transforms(joints)[:, :3, 2].T
        return np.asarray(np.rad2deg(np.arctan2(np.hypot(x, y), np.abs(z))))

    def sensitivities(self, joints: FloatArray) -> FloatArray:
        """Return the derivatives of MOVES by the parameters, of shape (n, 6, parameters), per mm and per degree."""
        frames = self._frames(joints)
        before, behind = frames[:-1], frames[1:]
        first, second = (behind, before) if self.table.convention is Convention.STANDARD else (before, behind)
        screws = np.stack([_screw(first, 0, frames[-1]), _screw(second, 2, frames[-1])], axis=1)
        links, count = len(before), len(joints)  # screws: (links, axis, length or angle, n, 6)
        return np.moveaxis(screws.reshape(4 * links, count, 6), 0, -1)

    def _frames(self, joints: FloatArray) -> FloatArray:
        variables = {name: joints[:, axis] for axis, name in enumerate(self.joint_names)}
        return self.table.with_errors(self.errors).frames(variables)


def _screw(frames: FloatArray, axis: int, tool: FloatArray) -> FloatArray:
    """Return how shifts along and turns about an axis of frames (links, n, 4, 4) move the tool: (links, 2, n, 6)."""
    direction, origin = frames[..., :3, axis], frames[..., :3, 3]
    moves = np.zeros((len(frames), 2, *direction.shape[1:-1], 6))
    moves[:, 0, :, :3] = direction
    moves[:, 1, :, :3] = np.deg2rad(np.cross(direction, tool[..., :3, 3] - origin))
    moves[:, 1, :, 3:] = direction
    return moves


def random_joints(robot: Robot, count: int, random: np.random.Generator) -> FloatArray:
    """Return random joint positions of shape (count, joints), uniform within the limits, rounded to thousandths."""
    lower, upper = (np.array(ends) for ends in zip(*((each.lower, each.upper) for each in robot.joints), strict=True))
    return np.clip(np.round(random.uniform(lower, upper, (count, len(lower))), 3), lower, upper)


def actual_chain(robot: Robot) -> Chain | None:
    """Return the chain of a robot whose file has parameter errors; None for any other."""
    return Chain.of(robot) if robot.dh_errors else None


def check_links(kind: str, table: DhTable, joints: Iterable[str], links: Iterable[str]) -> None:
    """Raise InputError if the table is not a chain of the joints or lacks one of these links."""
    strange = [name for name in table.variables if name not in set(joints)]
    if strange:
        are = "is no joint" if len(strange) == 1 else "are no joints"
        raise InputError(f"a {kind!r} is not a chain of DH links: {' and '.join(strange)} {are}")
    findings = Findings()
    for link in links:
        with findings.collecting():
            if link not in table.link_names:
                raise unknown("link", link, table.link_names)
    findings.raise_first()
