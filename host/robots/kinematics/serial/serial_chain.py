"""The kinematics of a chain of joints, with a numeric inverse, and its parts to draw.

A pose has the solution that is found from near joints, and further ones from other starts.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Final, Self

import numpy as np

from steptwin.host.common.arrays import BoolArray, FloatArray
from steptwin.host.robots.joint import Joint, Unit
from steptwin.host.robots.kinematics.base import (
    Branch,
    Constraint,
    joint_constraints,
    nearest_turns,
    read_geometry,
    require_joints,
)
from steptwin.host.robots.kinematics.dh import Convention, DhTable
from steptwin.host.robots.kinematics.links import ArmPart, Role, line
from steptwin.host.robots.kinematics.serial.chain_geometry import TASKS, ChainGeometry
from steptwin.host.robots.kinematics.serial.following import find_along, find_near
from steptwin.host.robots.kinematics.serial.levenberg import PLACE_OFF_MM, Found, NumericInverse
from steptwin.host.robots.kinematics.serial.screws import Screws, screws_of
from steptwin.host.robots.poses import DIRECTION_TASK, POSE, Task
from steptwin.host.robots.poses.base_frame import BaseFrame
from steptwin.host.robots.poses.rotations import reversed_rotation, turned, wrapped_deg
from steptwin.host.robots.robot import Robot

_HAND_PART: Final = 0.08
"""Drawn length of the tool's z axis, as a fraction of the arm's size."""


def chain_parts(dh: DhTable, joints: Mapping[str, FloatArray], size_mm: float) -> tuple[ArmPart, ...]:
    """Return a part from each joint to the next, the tool's z axis, and the tool from the last joint to its tip.

    `joints` are positions of shape (n,) by the names of the table's variables, in the order of the chain.
    """
    frames, names = dh.frames(joints), list(joints)
    corners = [frames[0][:, :3, 3]]
    parts: list[ArmPart] = []
    for i, row in enumerate(dh.rows):
        corners += _corners(dh.convention, frames[i], frames[i + 1], row.a_mm)
        if row.theta_deg.variable or row.d_mm.variable:
            slides = bool(row.d_mm.variable)
            parts.append(line(f"to {names.pop(0)}", Role.GUIDE if not parts or slides else Role.LINK, *corners))
            corners = corners[-1:]
    tip_mm = frames[-1][:, :3, 3]
    hand = line("hand", Role.HAND, tip_mm, tip_mm + _HAND_PART * size_mm * frames[-1][:, :3, 2])
    return (*parts, hand, line("tool", Role.TOOL, *corners, *([tip_mm] if len(corners) == 1 else [])))


def _corners(convention: Convention, before: FloatArray, behind: FloatArray, a_mm: float) -> list[FloatArray]:
    """Return the corner of a row's link, where the common normal meets the axis, and its end, each of shape (n, 3)."""
    start, end = before[:, :3, 3], behind[:, :3, 3]
    modified = convention is Convention.MODIFIED
    corner = start + a_mm * before[:, :3, 0] if modified else end - a_mm * behind[:, :3, 0]
    return [point for point, last in ((corner, start), (end, corner)) if np.abs(point - last).max() > PLACE_OFF_MM]


NEAREST: Final = "nearest"
"""Name of the branch: the solution found from near joints."""
FURTHER: Final = "solution-{}"
"""Names of further solutions. No path can use them, because their numbers change from pose to pose."""

_ILL: Final = 1e-3
"""Ratio of a Jacobian's singular values below which a chain is near singular."""
NEAR: Final = 0.1
"""Singularity measure below which a singularity is the reason of a joint that is too fast."""
SINGULAR_DET: Final = 1e-9
"""Determinant of a scaled Jacobian below which velocities are least-squares solutions."""


@dataclass(frozen=True, slots=True, eq=False)
class SerialChain:
    """The kinematics of a chain; implements Kinematics.

    Attributes:
        limits: joints in axis order; their limits determine only whether a pose is reachable.
        dh: the chain as a DH table, with the joints' names as variables, and the base's position in the station.
        task: task of the tool.
        held: columns of the joints that keep their positions when the tool is commanded to a pose.
    """

    limits: tuple[Joint, ...]
    dh: DhTable
    task: Task
    held: tuple[int, ...] = ()

    @classmethod
    def of(cls, robot: Robot) -> Self:
        """Return a robot's kinematics; raise InputError if its dimensions or joints are not this mechanism's."""
        geometry = read_geometry(ChainGeometry, robot)
        require_joints(robot, geometry.joints)
        held = tuple(column for column, name in enumerate(geometry.joints) if name in geometry.held)
        return cls(robot.joints, geometry.dh, TASKS[geometry.tool_task][0], held)

    def on(self, base: BaseFrame) -> Self:
        """Return the chain with its base at a place in the station."""
        return replace(self, dh=replace(self.dh, base=base))

    @property
    def branches(self) -> tuple[str, ...]:
        """The one branch `nearest`."""
        return (NEAREST,)

    @property
    def slides(self) -> tuple[tuple[int, int], ...]:
        """No joint shifts the whole arm."""
        return ()

    @property
    def attitude_follows(self) -> bool:
        """False: no coordinate of the task is determined by the others."""
        return False

    @property
    def turning(self) -> None:
        """No joint turns the tool on the spot."""
        return None

    @property
    def has_closed_form(self) -> bool:
        """False: joints are found numerically."""
        return False

    @property
    def keeps_branch(self) -> bool:
        """False: on a path the branch may change at a point where two meet."""
        return False

    @property
    def inverse_words(self) -> str:
        """Description of the inverse method."""
        return "numeric, from the present joints"

    # --- properties of the table

    @property
    def names(self) -> tuple[str, ...]:
        """The joints' names."""
        return tuple(joint.name for joint in self.limits)

    @property
    def _screws(self) -> Screws:
        return screws_of(self.dh, self.names)

    @property
    def free(self) -> tuple[int, ...]:
        """Columns of the joints that a pose determines."""
        return tuple(column for column in range(len(self.limits)) if column not in self.held)

    @property
    def numeric(self) -> NumericInverse:
        """The numeric inverse of the chain."""
        lower, upper = (np.array([getattr(joint, end) for joint in self.limits]) for end in ("lower", "upper"))
        slides = np.array([joint.unit is Unit.MM for joint in self.limits])
        return NumericInverse(self._screws, self.task, self.free, slides, self.reach_mm, lower, upper)

    @property
    def reach_mm(self) -> float:
        """Size of the arm: sum of the lengths of its rows, at least 1 mm."""
        return max(1.0, sum(abs(row.a_mm) + abs(row.d_mm.constant) for row in self.dh.rows))

    # --- forward

    def dh_variables(self, joints: FloatArray) -> dict[str, FloatArray]:
        """Return the joints by their names."""
        return {name: joints[:, column] for column, name in enumerate(self.names)}

    def forward(self, joints: FloatArray) -> FloatArray:
        """Return poses of shape (n, task.width) for joints of shape (n, joints)."""
        return self._told(self._screws.forward(joints))

    def _told(self, poses: FloatArray) -> FloatArray:
        """Return the task's coordinates of complete poses of shape (n, 7)."""
        if self.task is POSE:
            return poses
        if self.task is DIRECTION_TASK:
            return np.column_stack([poses[:, :3], turned(np.array([0.0, 0.0, 1.0]), poses[:, 3:])])
        return poses[:, :3]

    def axis_mm(self, joints: FloatArray) -> tuple[float, float]:
        """Return x and y of the base."""
        del joints
        return self.dh.base.x_mm, self.dh.base.y_mm

    def links(self, joints: FloatArray) -> tuple[ArmPart, ...]:
        """Return a part from each joint to the next, the tool's z axis, and the tool from the last joint to its tip."""
        return chain_parts(self.dh, self.dh_variables(joints), self.reach_mm)

    # --- inverse

    def inverse(self, poses: FloatArray, near: FloatArray | None = None) -> tuple[Branch, ...]:
        """Return the found solutions for poses of shape (n, task.width)."""
        standing = self.standing(poses, near)
        nearest = self.numeric.anywhere(poses, standing)
        return (self.found(NEAREST, nearest, near), *self._further(poses, standing, nearest.joints, near))

    def solve(self, poses: FloatArray, branch: str, near: FloatArray | None = None) -> Branch:
        """Return one branch, by its name."""
        del branch
        return self.found(NEAREST, self.numeric.anywhere(poses, self.standing(poses, near)), near)

    def _further(
        self, poses: FloatArray, standing: FloatArray, nearest: FloatArray, near: FloatArray | None
    ) -> tuple[Branch, ...]:
        """Return further solutions of poses, each of shape (n, joints)."""
        rows = [self.numeric.solutions(*each) for each in zip(poses, standing, nearest, strict=True)]
        joints = np.full((max(map(len, rows), default=0), *standing.shape), np.nan)
        for pose, solutions in enumerate(rows):
            joints[: len(solutions), pose] = solutions
        off = np.where(np.isfinite(joints[:, :, 0]), 0.0, np.nan)
        return tuple(
            self.found(FURTHER.format(number), Found(each, own, own), near)
            for number, (each, own) in enumerate(zip(joints, off, strict=True), start=1)
        )

    def standing(self, poses: FloatArray, near: FloatArray | None) -> FloatArray:
        """Return the start joints of the search, of shape (n, joints): `near`, or 0."""
        shape = (len(poses), len(self.limits))
        return np.zeros(shape) if near is None else np.array(np.broadcast_to(near, shape), dtype=np.float64)

    def found(self, name: str, found: Found, near: FloatArray | None, reached: tuple[Constraint, ...] = ()) -> Branch:
        """Return the branch of numerically found joints, with further constraints."""
        joints, rotary = found.joints.copy(), [joint.unit is Unit.DEG for joint in self.limits]
        turning = [column for column in self.free if rotary[column]]
        joints[:, turning] = wrapped_deg(joints[:, turning])
        nearest_turns(self.limits, joints, near)
        return Branch(name, joints, (*reached, self.off(found)), joint_constraints(self.limits, joints))

    def off(self, found: Found) -> Constraint:
        """Return the remaining distance from the pose as a constraint."""

        def explain(i: int) -> str:
            if found.solved[i] or not np.isfinite(found.off_mm[i]):
                return "no joints of its own found for it"
            turn = "" if self.task.is_flat else f" and {found.off_deg[i]:.3g} deg"
            return f"no joints found for it: the nearest ones miss it by {found.off_mm[i]:.3g} mm{turn}"

        kept = found.solved & np.isfinite(found.joints).all(axis=1)
        return Constraint("distance", "mm", found.off_mm, 0.0, PLACE_OFF_MM, kept, explain)

    # --- along a path

    def along(self, poses: FloatArray, branch: str, near: FloatArray) -> Branch:
        """Return the joints along a path that begins near joints of shape (joints,)."""
        del branch
        found = find_along(self.numeric, poses, near)
        return Branch(NEAREST, found.joints, (self.off(found),), joint_constraints(self.limits, found.joints))

    def at(self, poses: FloatArray, branch: str, near: FloatArray, guides: FloatArray) -> FloatArray:
        """Return joints of shape (n, joints) at poses of a path, nearest to guides of that shape."""
        del branch, near
        return find_near(self.numeric, poses, guides).joints

    # --- singularities and velocities

    def singularities(self, joints: FloatArray) -> tuple[Constraint, ...]:
        """Return measures that must stay away from 0."""
        sizes = np.linalg.svd(self.numeric.jacobians(joints)[1], compute_uv=False)
        return (measure("near singular, least part of a tool's motion", sizes[:, -1] / sizes[:, 0], _ILL),)

    def near_what(self, joints: FloatArray) -> str:
        """Return the name of a singularity near joints of shape (joints,); an empty text if there is none."""
        ratio = self.singularities(joints[np.newaxis])[0].values[0]
        return "where the arm is near singular" if ratio < NEAR else ""

    def joint_velocities(self, joints: FloatArray, tool_velocities: FloatArray) -> FloatArray:
        """Return joint velocities for tool velocities of shape (n, task.rates); least squares at a singularity."""
        numeric = self.numeric
        rotations, jacobians = numeric.jacobians(joints)
        back = reversed_rotation(rotations)
        wanted = turned(tool_velocities[:, :3], back) / numeric.reach_mm
        if not self.task.is_flat:
            turning = np.deg2rad(turned(tool_velocities[:, 3:], back))
            wanted = np.column_stack([wanted, turning if self.task is POSE else turning[:, :2]])
        rates = _solved_rates(jacobians, wanted)
        velocities = np.zeros_like(joints)
        velocities[:, self.free] = rates * np.where(numeric.slides, numeric.reach_mm, np.rad2deg(1.0))[list(self.free)]
        return velocities


def _solved_rates(jacobians: FloatArray, wanted: FloatArray) -> FloatArray:
    """Return J^-1 v, of shape (n, free), or the least-squares solution for singular or non-square Jacobians."""
    count, rows, free = jacobians.shape
    rates = np.empty((count, free))
    regular: BoolArray = np.zeros(count, np.bool_)
    if rows == free:
        regular = np.abs(np.linalg.det(jacobians)) > SINGULAR_DET
        rates[regular] = np.linalg.solve(jacobians[regular], wanted[regular, :, np.newaxis])[:, :, 0]
    singular = ~regular
    if singular.any():
        inverse = np.linalg.pinv(jacobians[singular], rcond=_ILL * _ILL)
        rates[singular] = (inverse @ wanted[singular, :, np.newaxis])[:, :, 0]
    return rates


def measure(name: str, values: FloatArray, least: float) -> Constraint:
    """Return the constraint that a measure is not less than `least`."""
    return Constraint(name, "", values, least, 1.0, values >= least)
