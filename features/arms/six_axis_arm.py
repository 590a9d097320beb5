"""Kinematics of a chain of joints whose inverse has a closed form, or nearly one.

An arm with a spherical wrist has eight branches in closed form. If the wrist's axes only nearly meet, the branches come
from the neighbour with meeting axes. Any other chain is solved numerically, as in the core.
"""

from dataclasses import dataclass, replace
from functools import lru_cache
from itertools import pairwise
from math import inf
from typing import Final, NamedTuple

import numpy as np

from steptwin.features.arms.offset_wrist import OffsetWrist, neighbour_of
from steptwin.features.arms.spherical_wrist import NAMES, Solved, SphericalWrist, closed_form, why_not
from steptwin.host.common.arrays import FloatArray
from steptwin.host.common.planning_time import check_planning_time
from steptwin.host.robots.kinematics.base import Branch, Constraint, joint_constraints, nearest_turns
from steptwin.host.robots.kinematics.dh import DhTable
from steptwin.host.robots.kinematics.serial.chain_geometry import ArmAxes, axes_of
from steptwin.host.robots.kinematics.serial.following import find_along, turned_to
from steptwin.host.robots.kinematics.serial.levenberg import PLACE_OFF_MM
from steptwin.host.robots.kinematics.serial.screws import screws_of
from steptwin.host.robots.kinematics.serial.serial_chain import NEAR, NEAREST, SINGULAR_DET, SerialChain, measure
from steptwin.host.robots.poses import POSE, Task
from steptwin.host.robots.poses.base_frame import STATION
from steptwin.host.robots.poses.rotations import of_rotation_vector, product, turned, wrapped_deg

SINGULAR: Final = 0.005
"""Singularity limits: wrist's distance from axis 1 as a fraction of the reach, and sine of the elbow."""
_NEAR_WHAT: Final = ("near where the wrist meets axis 1", "near the stretched elbow", "near the stretched wrist")


@dataclass(frozen=True, slots=True, eq=False)
class SixAxisArm(SerialChain):
    """Kinematics of a chain with branches named by its shape; implements Kinematics.

    Methods of the base class are called by its name: `super()` fails in a dataclass with slots, which is made anew.
    """

    @property
    def branches(self) -> tuple[str, ...]:
        """Names of the branches, by the arm's shape or by the chain."""
        return NAMES if self.form or self.neighbour else (NEAREST,)

    @property
    def has_closed_form(self) -> bool:
        """True for an arm with a spherical wrist."""
        return self.form is not None

    @property
    def inverse_words(self) -> str:
        """Method of the inverse, as text."""
        if self.form:
            return "in closed form: axes 2 and 3 are parallel, axes 4, 5 and 6 meet in a point"
        start = "the branches of an arm whose wrist's axes meet" if self.neighbour else "the present joints"
        return f"numeric, from {start}: {self._why_numeric}"

    @property
    def _axes(self) -> ArmAxes:
        return axes_of(self.dh, self.names)

    @property
    def _why_numeric(self) -> str:
        return _why_numeric(self.dh, self.names, self.held, self.task)

    @property
    def form(self) -> SphericalWrist | None:
        """The closed form; None without one."""
        if self._why_numeric:
            return None
        return closed_form(_free_axes(self.dh, self.names, self.held))

    @property
    def neighbour(self) -> SphericalWrist | None:
        """The closed form of the arm with meeting wrist axes, if they nearly meet."""
        if self.form or self.task is not POSE or not _is_first(self.held):
            return None
        return neighbour_of(_free_axes(self.dh, self.names, self.held), self.reach_mm)

    # --- inverse

    def inverse(self, poses: FloatArray, near: FloatArray | None = None) -> tuple[Branch, ...]:
        """Return all branches for poses of shape (n, task.width); for a chain without names, the solutions found."""
        if self.form:
            standing = self.standing(poses, near)
            solved = self.form.solve_all(self._from_base(poses, standing), np.deg2rad(standing[..., self.free]))
            return tuple(self._branch(name, each, standing, near) for name, each in solved.items())
        if self.neighbour:
            return self._beside(self.neighbour, NAMES, poses, near)
        return SerialChain.inverse(self, poses, near)

    def solve(self, poses: FloatArray, branch: str, near: FloatArray | None = None) -> Branch:
        """Return one branch by name."""
        if self.neighbour:
            (found,) = self._beside(self.neighbour, (branch,), poses, near)
            return found
        if self.form is None:
            return SerialChain.solve(self, poses, branch, near)
        standing = self.standing(poses, near)
        start = np.deg2rad(standing[:, self.free])
        return self._branch(
            branch, self.form.solve(self._from_base(poses, standing), self.form.signs[branch], start), standing, near
        )

    def _beside(
        self, form: SphericalWrist, names: tuple[str, ...], poses: FloatArray, near: FloatArray | None
    ) -> tuple[Branch, ...]:
        """Return branches of an arm with a neighbour in closed form."""
        standing = self.standing(poses, near)
        numeric, own = self.numeric, screws_of(replace(self.dh, base=STATION), self.names)
        found = OffsetWrist(form, numeric, own).find(names, poses, self._from_base(poses, standing), standing)
        return tuple(self.found(name, each, near, self._reached(form, solved)) for name, solved, each in found)

    def _from_base(self, poses: FloatArray, standing: FloatArray) -> FloatArray:
        """Return whole poses in the base's frame with all held joints at 0."""
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
        joints[:, self.free] = wrapped_deg(np.rad2deg(solved.joints))
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

    # --- along a path

    def along(self, poses: FloatArray, branch: str, near: FloatArray) -> Branch:
        """Return the joints along a path that starts near joints of shape (joints,), on any branch.

        Each pose takes the branch nearest to the joints before it; `changes` lists the changes of branch.
        """
        if self.form is None:
            return (
                self._found_along(self.neighbour, poses, near)
                if self.neighbour
                else SerialChain.along(self, poses, branch, near)
            )
        standing, free = self.standing(poses, near), list(self.free)
        last = np.asarray(near[free], dtype=np.float64)
        followed = follow(self.form, self._from_base(poses, standing), last)
        standing[:, free] = followed.joints
        reached, limits = self._reached(self.form, followed.solved), joint_constraints(self.limits, standing)
        return Branch(followed.first, standing, reached, limits, followed.changes)

    def _found_along(self, neighbour: SphericalWrist, poses: FloatArray, near: FloatArray) -> Branch:
        """Return the joints along a path, and the branch names of their shapes."""
        found = find_along(self.numeric, poses, near)
        names = neighbour.names_of(np.deg2rad(found.joints[:, self.free]))
        changes = ((i, name) for i, (before, name) in enumerate(pairwise(names), start=1) if name != before)
        limits = joint_constraints(self.limits, found.joints)
        return Branch(names[0], found.joints, (self.off(found),), limits, tuple(changes))

    def at(self, poses: FloatArray, branch: str, near: FloatArray, guides: FloatArray) -> FloatArray:
        """Return joints of shape (n, joints), nearest to guides of that shape, at poses of a path."""
        if self.form is None:
            return SerialChain.at(self, poses, branch, near, guides)
        joints, free = guides.copy(), list(self.free)
        joints[:, free] = joints_near(self.form, self._from_base(poses, guides), guides[:, free])
        return joints

    # --- singularities and velocities

    def singularities(self, joints: FloatArray) -> tuple[Constraint, ...]:
        """Return the distances from singularities, without the wrist's sine: a path goes straight through its zero."""
        if self.form is None:
            return SerialChain.singularities(self, joints)
        ahead, elbow, _ = self.form.measures(np.deg2rad(joints[:, self.free]))
        first, third = self.names[self.free[0]], self.names[self.free[2]]
        return (
            measure(f"{first}: near singular, the wrist beside its axis as a part of the reach", ahead, SINGULAR),
            measure(f"{third}: near singular, |sin| of the elbow", elbow, SINGULAR),
        )

    def near_what(self, joints: FloatArray) -> str:
        """Return the singularity near joints of shape (joints,) as text; empty if there is none."""
        if self.form is None:
            return SerialChain.near_what(self, joints)
        measures = self.form.measures(np.deg2rad(joints[np.newaxis, self.free]))
        nearest = int(np.argmin([each[0] for each in measures]))
        return _NEAR_WHAT[nearest] if measures[nearest][0] < NEAR else ""

    def joint_velocities(self, joints: FloatArray, tool_velocities: FloatArray) -> FloatArray:
        """Return joint velocities for tool velocities of shape (n, task.rates), by least squares near singularities."""
        velocities, singular = np.zeros_like(joints), np.ones(len(joints), np.bool_)
        if self.form:
            of_base = (self._turned_back(tool_velocities[:, part], joints) for part in (slice(3), slice(3, 6)))
            moves_mm, turns_deg = of_base
            rates, det = self.form.rates.of(np.deg2rad(joints[:, self.free]), moves_mm, np.deg2rad(turns_deg))
            singular = ~(np.abs(det) > SINGULAR_DET * self.reach_mm**3)
            velocities[:, self.free] = np.rad2deg(rates)
        if singular.any():
            velocities[singular] = SerialChain.joint_velocities(self, joints[singular], tool_velocities[singular])
        return velocities

    def _turned_back(self, vectors: FloatArray, standing: FloatArray) -> FloatArray:
        """Return vectors of shape (n, 3) in the base's frame with all held joints at 0."""
        axes = self._axes
        if self.dh.base.phi_deg:
            vectors = turned(vectors, of_rotation_vector(np.array([0.0, 0.0, -self.dh.base.phi_deg])))
        for column in self.held:
            if not axes.slides[column]:
                back = of_rotation_vector(-standing[:, column, np.newaxis] * axes.directions[column])
                vectors = turned(vectors, back)
        return vectors


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
    """Return whether the held joints come first in the chain."""
    return held == tuple(range(len(held)))


@lru_cache(maxsize=16)
def _free_axes(dh: DhTable, names: tuple[str, ...], held: tuple[int, ...]) -> ArmAxes:
    """Return the axes of the joints that are not held; held joints come first in the chain."""
    axes, first = axes_of(dh, names), len(held)
    return ArmAxes(
        axes.directions[first:], axes.points_mm[first:], axes.slides[first:], axes.home_mm, axes.home_rotation
    )


# --- joints along a path: the branch may change where two meet, as through a stretched wrist, without a jump

_WATCHED_DEG: Final = 1.0
"""Step of a joint between poses above which the other branches are checked."""
_OFF_GUIDE_DEG: Final = 30.0
"""Distance from the guide above which joints belong to another branch."""


class Followed(NamedTuple):
    """Joints of an arm with a closed form along a path.

    Attributes:
        first: name of the branch at the path's start.
        joints: shape (n, 6), in degrees, without jumps of whole turns.
        solved: solution of the closed form.
        changes: poses where the branch changes, and the new names.
    """

    first: str
    joints: FloatArray
    solved: Solved
    changes: tuple[tuple[int, str], ...]


def follow(form: SphericalWrist, poses: FloatArray, last: FloatArray) -> Followed:
    """Return the joints along poses of shape (n, 7) in the base's frame that start near joints of shape (6,)."""
    name, begin = _nearest_name(form, poses[0], last), 0
    first, joints, parts, changes = name, list[FloatArray](), list[Solved](), list[tuple[int, str]]()
    while True:
        check_planning_time()
        solved = form.solve(poses[begin:], form.signs[name], np.deg2rad(last))
        onward = _continued(solved, last)
        end, other = _first_change(form, poses[begin:], onward, last, name)
        joints.append(onward[:end])
        parts.append(solved.cut(end))
        begin += end
        if begin == len(poses):
            return Followed(first, np.concatenate(joints), Solved.joined(parts), tuple(changes))
        last, name = onward[end - 1], other
        changes.append((begin, name))


def joints_near(form: SphericalWrist, poses: FloatArray, guides: FloatArray) -> FloatArray:
    """Return the joints nearest to guides, of shape (n, 6) in degrees, at poses of shape (n, 7)."""
    rad = np.deg2rad(guides)
    joints = turned_to(guides, np.rad2deg(form.solve(poses, form.signs_of(rad), rad).joints))
    for row in np.flatnonzero(~(np.abs(joints - guides).max(axis=1) <= _OFF_GUIDE_DEG)):
        check_planning_time()
        solved = form.solve_all(poses[row : row + 1], rad[row])
        choices = turned_to(guides[row], np.rad2deg(np.concatenate([each.joints for each in solved.values()])))
        off = np.nan_to_num(np.abs(choices - guides[row]).max(axis=1), nan=inf)
        joints[row] = choices[int(off.argmin())]
    return joints


def _nearest_name(form: SphericalWrist, pose: FloatArray, last: FloatArray) -> str:
    """Return the branch nearest to joints (6,), whole turns aside, at a pose of shape (7,)."""
    solved = form.solve_all(pose[np.newaxis], np.deg2rad(last))
    distances = {name: _apart(np.rad2deg(each.joints[0]), last) for name, each in solved.items()}
    nearest = min(distances, key=distances.__getitem__)
    return nearest if distances[nearest] < inf else form.name_of(np.deg2rad(last))


def _apart(joints: FloatArray, others: FloatArray) -> float:
    """Return the largest angle between joints, whole turns aside; infinite for joints that do not exist."""
    return float(np.nan_to_num(np.abs(wrapped_deg(joints - others)).max(), nan=inf))


def _continued(solved: Solved, last: FloatArray) -> FloatArray:
    """Return joints in degrees, (n, 6), that continue from `last` without jumps of whole turns; a free q4 stays."""
    joints = np.rad2deg(solved.joints)
    if solved.is_free.any():
        kept = np.maximum.accumulate(np.where(solved.is_free, -1, np.arange(len(joints))))
        q4 = np.where(kept < 0, last[3], joints[kept, 3])
        joints[:, 5] += np.sign(solved.reach.beside) * (joints[:, 3] - q4)
        joints[:, 3] = q4
    return np.asarray(np.unwrap(np.vstack([last, joints]), period=360.0, axis=0)[1:])


def _first_change(
    form: SphericalWrist, poses: FloatArray, joints: FloatArray, last: FloatArray, name: str
) -> tuple[int, str]:
    """Return the first pose where another branch is nearer to the joints before, and its name.

    Most paths have none, and the index is their length. Only large steps are checked.
    """
    before = np.vstack([last, joints[:-1]])
    steps = np.abs(joints - before).max(axis=1)
    watched = np.flatnonzero(steps > _WATCHED_DEG)
    watched = watched[watched > 0]
    if watched.size:
        solved = form.solve_all(poses[watched], np.deg2rad(before[watched]))
        others = np.stack([np.rad2deg(each.joints) for each in solved.values()])
        apart = np.nan_to_num(np.abs(wrapped_deg(others - before[watched])).max(axis=2), nan=inf)
        names = list(solved)
        for column, row in enumerate(watched):
            nearest = int(apart[:, column].argmin())
            if names[nearest] != name and apart[nearest, column] < steps[row] - PLACE_OFF_MM:
                return int(row), names[nearest]
    return len(poses), name
