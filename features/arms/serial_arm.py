"""The kinematics of a chain of joints: its inverse in closed form if the arm has one, else numeric; its parts to draw.

An arm whose wrist's axes miss one point has the branches of its neighbour, whose axes meet; any other chain the
solution that is found from the joints near it, and those that other starts lead to.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import lru_cache
from itertools import pairwise
from math import inf
from typing import Final

import numpy as np

from steptwin.features.arms.chain_geometry import TASKS, ArmAxes, ChainGeometry, axes_of
from steptwin.features.arms.following import find_along, find_near, follow, joints_near
from steptwin.features.arms.levenberg import PLACE_OFF_MM, Found, NumericInverse
from steptwin.features.arms.offset_wrist import OffsetWrist, neighbour_of
from steptwin.features.arms.screws import Screws, screws_of
from steptwin.features.arms.spherical_wrist import NAMES, Solved, SphericalWrist, closed_form, why_not
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
from steptwin.host.robots.poses import DIRECTION_TASK, POSE, Task
from steptwin.host.robots.poses.base_frame import STATION, BaseFrame
from steptwin.host.robots.poses.rotations import (
    of_rotation_vector,
    product,
    reversed_rotation,
    turned,
    wrapped_deg,
)
from steptwin.host.robots.robot import Robot

_HAND_PART: Final = 0.08
"""Length drawn of the tool's z axis, as a part of the arm's size."""


def chain_parts(dh: DhTable, joints: Mapping[str, FloatArray], size_mm: float) -> tuple[ArmPart, ...]:
    """Return a part from each joint to the next, the tool's z axis, and the tool from the last joint to its tip.

    `joints` are positions of shape (n,) by the names of the table's variables, along the chain.
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
"""The one branch of a chain whose shape names none: the solution that is found from the joints near it."""
FURTHER: Final = "solution-{}"
"""Names of its other solutions, which no path can ask for: their numbers change from pose to pose."""

SINGULAR: Final = 0.005
"""Least part of the reach from axis 1, and least sine of the elbow, below which an arm is near singular."""
_ILL: Final = 1e-3
"""Least ratio of the singular values of a Jacobian, below which an arm without a closed form is near singular."""
_NEAR: Final = 0.1
"""Measure below which a joint that is too fast is so because of a singularity."""
_NEAR_WHAT: Final = ("near where the wrist meets axis 1", "near the stretched elbow", "near the stretched wrist")
_SINGULAR_DET: Final = 1e-9
"""Determinant of a scaled Jacobian below which velocities are those of the least squares."""


@dataclass(frozen=True, slots=True, eq=False)
class SerialArm:
    """The kinematics of a chain; implements Kinematics.

    Attributes:
        limits: the joints in axis order, whose limits decide only whether a pose is reachable.
        dh: the chain as a DH table, with the joints' names as variables, and the base's place in the station.
        task: what the tool can be told.
        held: columns of the joints that stay where they are when the tool is told a pose.
    """

    limits: tuple[Joint, ...]
    dh: DhTable
    task: Task
    held: tuple[int, ...] = ()

    def on(self, base: BaseFrame) -> "SerialArm":
        """Return the chain with its base at a place in the station."""
        return replace(self, dh=replace(self.dh, base=base))

    @property
    def branches(self) -> tuple[str, ...]:
        """The names by the arm's shape, or `nearest` for a chain whose shape names none."""
        return NAMES if self.form or self.neighbour else (NEAREST,)

    @property
    def slides(self) -> tuple[tuple[int, int], ...]:
        """No joint: one that is held does not shift the whole arm along its base."""
        return ()

    @property
    def attitude_follows(self) -> bool:
        """False: the task has no coordinate that follows from the others."""
        return False

    @property
    def turning(self) -> None:
        """No joint turns the tool on the spot."""
        return None

    @property
    def has_closed_form(self) -> bool:
        """True for an arm with a spherical wrist."""
        return self.form is not None

    @property
    def keeps_branch(self) -> bool:
        """False: on a path the branch may change where two meet."""
        return False

    @property
    def inverse_words(self) -> str:
        """How poses become joints, in a few words."""
        if self.form:
            return "in closed form: axes 2 and 3 are parallel, axes 4, 5 and 6 meet in a point"
        start = "the branches of an arm whose wrist's axes meet" if self.neighbour else "the present joints"
        return f"numeric, from {start}: {self._why_numeric}"

    # --- what follows from the table

    @property
    def _names(self) -> tuple[str, ...]:
        return tuple(joint.name for joint in self.limits)

    @property
    def _screws(self) -> Screws:
        return screws_of(self.dh, self._names)

    @property
    def _axes(self) -> ArmAxes:
        return axes_of(self.dh, self._names)

    @property
    def _free(self) -> tuple[int, ...]:
        return tuple(column for column in range(len(self.limits)) if column not in self.held)

    @property
    def _why_numeric(self) -> str:
        return _why_numeric(self.dh, self._names, self.held, self.task)

    @property
    def form(self) -> SphericalWrist | None:
        """The closed form, if the arm has one."""
        if self._why_numeric:
            return None
        return closed_form(_free_axes(self.dh, self._names, self.held))

    @property
    def neighbour(self) -> SphericalWrist | None:
        """The closed form of the arm whose wrist's axes meet, if this one's miss a point by little."""
        if self.form or self.task is not POSE or not _is_first(self.held):
            return None
        return neighbour_of(_free_axes(self.dh, self._names, self.held), self.reach_mm)

    @property
    def numeric(self) -> NumericInverse:
        """The numeric inverse, which every chain has."""
        lower, upper = (np.array([getattr(joint, end) for joint in self.limits]) for end in ("lower", "upper"))
        slides = np.array([joint.unit is Unit.MM for joint in self.limits])
        return NumericInverse(self._screws, self.task, self._free, slides, self.reach_mm, lower, upper)

    @property
    def reach_mm(self) -> float:
        """A length of the arm's size: that of its rows together, at least 1 mm."""
        return max(1.0, sum(abs(row.a_mm) + abs(row.d_mm.constant) for row in self.dh.rows))

    # --- forward

    def dh_variables(self, joints: FloatArray) -> dict[str, FloatArray]:
        """Return the joints by their names."""
        return {name: joints[:, column] for column, name in enumerate(self._names)}

    def forward(self, joints: FloatArray) -> FloatArray:
        """Return poses of shape (n, task.width) for joints of shape (n, joints)."""
        return self._told(self._screws.forward(joints))

    def _told(self, poses: FloatArray) -> FloatArray:
        """Return what the task has of whole poses, of shape (n, 7)."""
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
        """Return every branch for poses of shape (n, task.width); of a chain without names the solutions found."""
        standing = self._standing(poses, near)
        if self.form:
            solved = self.form.solve_all(self._from_base(poses, standing), np.deg2rad(standing[..., self._free]))
            return tuple(self._branch(name, each, standing, near) for name, each in solved.items())
        if self.neighbour:
            return self._beside(self.neighbour, NAMES, poses, near)
        nearest = self.numeric.anywhere(poses, standing)
        return (self._found(NEAREST, nearest, near), *self._further(poses, standing, nearest.joints, near))

    def solve(self, poses: FloatArray, branch: str, near: FloatArray | None = None) -> Branch:
        """Return one branch, by its name."""
        standing = self._standing(poses, near)
        if self.neighbour:
            (found,) = self._beside(self.neighbour, (branch,), poses, near)
            return found
        if self.form is None:
            return self._found(NEAREST, self.numeric.anywhere(poses, standing), near)
        start = np.deg2rad(standing[:, self._free])
        return self._branch(
            branch, self.form.solve(self._from_base(poses, standing), self.form.signs[branch], start), standing, near
        )

    def _beside(
        self, form: SphericalWrist, names: tuple[str, ...], poses: FloatArray, near: FloatArray | None
    ) -> tuple[Branch, ...]:
        """Return branches of an arm whose neighbour has a closed form."""
        standing = self._standing(poses, near)
        numeric, own = self.numeric, screws_of(replace(self.dh, base=STATION), self._names)
        found = OffsetWrist(form, numeric, own).find(names, poses, self._from_base(poses, standing), standing)
        return tuple(self._found(name, each, near, self._reached(form, solved)) for name, solved, each in found)

    def _further(
        self, poses: FloatArray, standing: FloatArray, nearest: FloatArray, near: FloatArray | None
    ) -> tuple[Branch, ...]:
        """Return the solutions of poses beside the nearest ones, each of shape (n, joints)."""
        rows = [self.numeric.solutions(*each) for each in zip(poses, standing, nearest, strict=True)]
        joints = np.full((max(map(len, rows), default=0), *standing.shape), np.nan)
        for pose, solutions in enumerate(rows):
            joints[: len(solutions), pose] = solutions
        off = np.where(np.isfinite(joints[:, :, 0]), 0.0, np.nan)
        return tuple(
            self._found(FURTHER.format(number), Found(each, own, own), near)
            for number, (each, own) in enumerate(zip(joints, off, strict=True), start=1)
        )

    def _standing(self, poses: FloatArray, near: FloatArray | None) -> FloatArray:
        """Return the joints near the solutions, of shape (n, joints), by default 0."""
        shape = (len(poses), len(self.limits))
        return np.zeros(shape) if near is None else np.array(np.broadcast_to(near, shape), dtype=np.float64)

    def _from_base(self, poses: FloatArray, standing: FloatArray) -> FloatArray:
        """Return whole poses in the base's frame, as if the joints that are held were at 0."""
        base = self.dh.base
        if base == STATION and not self.held:
            return poses
        place = poses[:, :3] - np.array([base.x_mm, base.y_mm, base.z_mm])
        back = of_rotation_vector(np.array([0.0, 0.0, -base.phi_deg]))
        place, rotation = turned(place, back), product(back, poses[:, 3:])
        axes = self._axes
        for column in self.held:
            k, at = axes.directions[column], standing[:, column, np.newaxis]
            if axes.slides[column]:
                place = place - at * k
            else:
                back = of_rotation_vector(-at * k)
                place = turned(place - axes.points_mm[column], back) + axes.points_mm[column]
                rotation = product(back, rotation)
        return np.column_stack([place, rotation])

    def _joints(self, solved: Solved, standing: FloatArray) -> FloatArray:
        """Return joints of shape (n, joints), in degrees and mm, of a branch."""
        joints = standing.copy()
        joints[:, self._free] = wrapped_deg(np.rad2deg(solved.joints))
        return joints

    def _branch(self, name: str, solved: Solved, standing: FloatArray, near: FloatArray | None) -> Branch:
        joints = self._joints(solved, standing)
        nearest_turns(self.limits, joints, near)
        assert self.form is not None
        return Branch(name, joints, self._reached(self.form, solved), joint_constraints(self.limits, joints))

    def _reached(self, form: SphericalWrist, solved: Solved) -> tuple[Constraint, ...]:
        """Return the constraints of a branch in closed form."""
        reach = solved.reach
        upper_mm, fore_mm = form.lengths_mm
        found, offset_mm = np.isfinite(solved.joints[:, 0]), abs(form.offset_mm)
        beside = np.isnan(reach.shoulder_mm)
        nearest_mm, farthest_mm = abs(upper_mm - fore_mm), upper_mm + fore_mm
        return (
            Constraint("axis 1 to wrist", "mm", reach.axis_mm, offset_mm, inf, ~beside),
            Constraint("shoulder to wrist", "mm", reach.shoulder_mm, nearest_mm, farthest_mm, found | beside),
            *([] if form.is_square else [_bend(reach.beside)]),
        )

    def _found(self, name: str, found: Found, near: FloatArray | None, reached: tuple[Constraint, ...] = ()) -> Branch:
        """Return the branch of joints that were found numerically, with what else they must keep."""
        joints, rotary = found.joints.copy(), [joint.unit is Unit.DEG for joint in self.limits]
        turning = [column for column in self._free if rotary[column]]
        joints[:, turning] = wrapped_deg(joints[:, turning])
        nearest_turns(self.limits, joints, near)
        return Branch(name, joints, (*reached, self._off(found)), joint_constraints(self.limits, joints))

    def _off(self, found: Found) -> Constraint:
        """Return the distance from the pose as a constraint."""

        def explain(i: int) -> str:
            if found.solved[i] or not np.isfinite(found.off_mm[i]):
                return "no joints of its own found for it"
            turn = "" if self.task.is_flat else f" and {found.off_deg[i]:.3g} deg"
            return f"no joints found for it: the nearest ones miss it by {found.off_mm[i]:.3g} mm{turn}"

        kept = found.solved & np.isfinite(found.joints).all(axis=1)
        return Constraint("distance", "mm", found.off_mm, 0.0, PLACE_OFF_MM, kept, explain)

    # --- along a path

    def along(self, poses: FloatArray, branch: str, near: FloatArray) -> Branch:
        """Return the joints along a path that begins near joints of shape (joints,), on whatever branch is near there.

        Each pose takes the branch nearest to the joints before it; `changes` tells where that is another one.
        """
        del branch
        if self.form is None:
            return self._found_along(poses, near)
        standing, free = self._standing(poses, near), list(self._free)
        last = np.asarray(near[free], dtype=np.float64)
        followed = follow(self.form, self._from_base(poses, standing), last)
        standing[:, free] = followed.joints
        reached, limits = self._reached(self.form, followed.solved), joint_constraints(self.limits, standing)
        return Branch(followed.first, standing, reached, limits, followed.changes)

    def _found_along(self, poses: FloatArray, near: FloatArray) -> Branch:
        """Return the joints of a chain without a closed form along a path, and the names that their shape has."""
        found = find_along(self.numeric, poses, near)
        limits = joint_constraints(self.limits, found.joints)
        if self.neighbour is None:
            return Branch(NEAREST, found.joints, (self._off(found),), limits)
        names = self.neighbour.names_of(np.deg2rad(found.joints[:, self._free]))
        changes = ((i, name) for i, (before, name) in enumerate(pairwise(names), start=1) if name != before)
        return Branch(names[0], found.joints, (self._off(found),), limits, tuple(changes))

    def at(self, poses: FloatArray, branch: str, near: FloatArray, guides: FloatArray) -> FloatArray:
        """Return joints of shape (n, joints) at poses of a path, nearest to guides of that shape."""
        del branch, near
        if self.form is None:
            return find_near(self.numeric, poses, guides).joints
        joints, free = guides.copy(), list(self._free)
        joints[:, free] = joints_near(self.form, self._from_base(poses, guides), guides[:, free])
        return joints

    # --- singularities and velocities

    def singularities(self, joints: FloatArray) -> tuple[Constraint, ...]:
        """Return what must stay away from 0: not the wrist's sine, since a path goes straight through its zero."""
        form, names = self.form, self._names
        if form is None:
            jacobians = self.numeric.jacobians(joints)[1]
            sizes = np.linalg.svd(jacobians, compute_uv=False)
            ratio = sizes[:, -1] / sizes[:, 0]
            return (_measure("near singular, least part of a tool's motion", ratio, _ILL),)
        ahead, elbow, _ = form.measures(np.deg2rad(joints[:, self._free]))
        first, third = names[self._free[0]], names[self._free[2]]
        return (
            _measure(f"{first}: near singular, the wrist beside its axis as a part of the reach", ahead, SINGULAR),
            _measure(f"{third}: near singular, |sin| of the elbow", elbow, SINGULAR),
        )

    def near_what(self, joints: FloatArray) -> str:
        """Return near which singularity joints of shape (joints,) are, in words; an empty text if near none."""
        if self.form is None:
            ratio = self.singularities(joints[np.newaxis])[0].values[0]
            return "where the arm is near singular" if ratio < _NEAR else ""
        measures = self.form.measures(np.deg2rad(joints[np.newaxis, self._free]))
        nearest = int(np.argmin([measure[0] for measure in measures]))
        return _NEAR_WHAT[nearest] if measures[nearest][0] < _NEAR else ""

    def joint_velocities(self, joints: FloatArray, tool_velocities: FloatArray) -> FloatArray:
        """Return joint velocities for tool velocities of shape (n, task.rates), where singular by least squares."""
        velocities, singular = np.zeros_like(joints), np.ones(len(joints), np.bool_)
        if self.form:
            of_base = (self._turned_back(tool_velocities[:, part], joints) for part in (slice(3), slice(3, 6)))
            moves_mm, turns_deg = of_base
            rates, det = self.form.rates.of(np.deg2rad(joints[:, self._free]), moves_mm, np.deg2rad(turns_deg))
            singular = ~(np.abs(det) > _SINGULAR_DET * self.reach_mm**3)
            velocities[:, self._free] = np.rad2deg(rates)
        if singular.any():
            velocities[singular] = self._numeric_velocities(joints[singular], tool_velocities[singular])
        return velocities

    def _numeric_velocities(self, joints: FloatArray, tool_velocities: FloatArray) -> FloatArray:
        numeric = self.numeric
        rotations, jacobians = numeric.jacobians(joints)
        back = reversed_rotation(rotations)
        wanted = turned(tool_velocities[:, :3], back) / numeric.reach_mm
        if not self.task.is_flat:
            turning = np.deg2rad(turned(tool_velocities[:, 3:], back))
            wanted = np.column_stack([wanted, turning if self.task is POSE else turning[:, :2]])
        rates = _solved_rates(jacobians, wanted)
        velocities = np.zeros_like(joints)
        velocities[:, self._free] = (
            rates * np.where(numeric.slides, numeric.reach_mm, np.rad2deg(1.0))[list(self._free)]
        )
        return velocities

    def _turned_back(self, vectors: FloatArray, standing: FloatArray) -> FloatArray:
        """Return vectors of shape (n, 3) in the base's frame, as if the joints that are held were at 0."""
        axes = self._axes
        if self.dh.base.phi_deg:
            vectors = turned(vectors, of_rotation_vector(np.array([0.0, 0.0, -self.dh.base.phi_deg])))
        for column in self.held:
            if not axes.slides[column]:
                back = of_rotation_vector(-standing[:, column, np.newaxis] * axes.directions[column])
                vectors = turned(vectors, back)
        return vectors


def _solved_rates(jacobians: FloatArray, wanted: FloatArray) -> FloatArray:
    """Return J^-1 v, of shape (n, free); the least squares for Jacobians that are singular or not square."""
    count, rows, free = jacobians.shape
    rates = np.empty((count, free))
    regular: BoolArray = np.zeros(count, np.bool_)
    if rows == free:
        regular = np.abs(np.linalg.det(jacobians)) > _SINGULAR_DET
        rates[regular] = np.linalg.solve(jacobians[regular], wanted[regular, :, np.newaxis])[:, :, 0]
    singular = ~regular
    if singular.any():
        inverse = np.linalg.pinv(jacobians[singular], rcond=_ILL * _ILL)
        rates[singular] = (inverse @ wanted[singular, :, np.newaxis])[:, :, 0]
    return rates


def _measure(name: str, values: FloatArray, least: float) -> Constraint:
    return Constraint(name, "", values, least, 1.0, values >= least)


def _bend(beside: FloatArray) -> Constraint:
    return Constraint("cosine of the wrist's bend", "", beside, -1.0, 1.0, np.abs(beside) <= 1.0 + 1e-12)


# --- making


@lru_cache(maxsize=16)
def _why_numeric(dh: DhTable, names: tuple[str, ...], held: tuple[int, ...], task: Task) -> str:
    """Return why a chain's inverse is numeric; an empty text if it has a closed form."""
    if task is not POSE:
        return f"the tool is told a {task.name}"
    if not _is_first(held):
        return "a joint amid the arm is held"
    return why_not(_free_axes(dh, names, held))


def _is_first(held: tuple[int, ...]) -> bool:
    """Return whether the joints that are held come first in the chain."""
    return held == tuple(range(len(held)))


@lru_cache(maxsize=16)
def _free_axes(dh: DhTable, names: tuple[str, ...], held: tuple[int, ...]) -> ArmAxes:
    """Return the axes of the joints that are not held, which come first in the chain."""
    axes, first = axes_of(dh, names), len(held)
    return ArmAxes(
        axes.directions[first:], axes.points_mm[first:], axes.slides[first:], axes.home_mm, axes.home_rotation
    )


def serial_arm(robot: Robot) -> SerialArm:
    """Return a robot's kinematics; raise InputError if its dimensions or joints are not this mechanism's."""
    geometry = read_geometry(ChainGeometry, robot)
    require_joints(robot, geometry.joints)
    held = tuple(column for column, name in enumerate(geometry.joints) if name in geometry.held)
    return SerialArm(robot.joints, geometry.dh, TASKS[geometry.tool_task][0], held)
