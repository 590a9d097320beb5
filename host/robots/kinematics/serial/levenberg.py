"""Numeric inverse kinematics of any chain: all poses at once, each from joints near its solution.

The error e of a pose is in the tool's frame: the remaining distance and the remaining rotation vector. Lengths are
divided by the arm's reach, so they compare with angles. Each step is

    dq = J^T (J J^T + d I)^-1 e        d = DAMPING |e|

It is short near a singularity of the Jacobian J, and a Newton step near the solution. The task selects the error's
components: a direction ignores the rotation about the tool's z axis, a position ignores all rotations.


Source: K. Levenberg, 1944, as S. R. Buss, "Introduction to inverse kinematics", 2009, equation 11 has it for arms.
"""

from dataclasses import dataclass
from typing import Final, NamedTuple

import numpy as np

from steptwin.host.common.arrays import BoolArray, FloatArray
from steptwin.host.common.planning_time import check_planning_time
from steptwin.host.robots.kinematics.base import LIMIT_TOLERANCE
from steptwin.host.robots.kinematics.serial.screws import Screws
from steptwin.host.robots.poses import DIRECTION_TASK, POSE, POSITION, Task
from steptwin.host.robots.poses.rotations import product, reversed_rotation, rotation_vector_deg, turned, wrapped_deg

PLACE_OFF_MM: Final = 1e-6
TURN_OFF_DEG: Final = 1e-7
"""Largest distance and angle between a solution and its pose."""

DAMPING: Final = 1e-2
_STEP_MAX_RAD: Final = 0.5
"""Largest step of a joint in rad; for a sliding joint as a fraction of the reach."""
_STEPS: Final = 40
"""Highest number of steps from one start; 3 to 6 are enough from a near one."""
_RESTARTS: Final = 20
"""Number of random starts for a pose that was not reached from a near start."""
_SEED: Final = 1
_STARTS: Final = 48
"""Number of starts in the search for all solutions of a pose; arms with six joints have up to 16."""
SOLUTIONS_MAX: Final = 16
_SAME: Final = 1e-4
"""Largest difference of joints, in mm and degrees, of equal solutions."""


ROWS: Final = {POSE: (0, 1, 2, 3, 4, 5), DIRECTION_TASK: (0, 1, 2, 3, 4), POSITION: (0, 1, 2)}
"""Components of the tool's error for each task, in the tool's frame: position, then rotation."""


class Found(NamedTuple):
    """Joints of shape (n, joints) in mm and degrees, and distances of the tool from the poses, of shape (n,)."""

    joints: FloatArray
    off_mm: FloatArray
    off_deg: FloatArray

    @property
    def solved(self) -> BoolArray:
        """Shape (n,), true where the joints are a solution of the pose."""
        return np.asarray((self.off_mm <= PLACE_OFF_MM) & (self.off_deg <= TURN_OFF_DEG))


@dataclass(frozen=True, slots=True, eq=False)
class NumericInverse:
    """The numeric inverse of a chain.

    Attributes:
        screws: the chain.
        task: task of its tool.
        free: columns of the joints that may move; the others stay at the start.
        slides: shape (joints,), true for joints in mm.
        reach_mm: length that corresponds to 1 rad.
        lower: shape (joints,), lower limits of random starts.
        upper: shape (joints,), upper limits of random starts.
    """

    screws: Screws
    task: Task
    free: tuple[int, ...]
    slides: BoolArray
    reach_mm: float
    lower: FloatArray
    upper: FloatArray

    def near(self, poses: FloatArray, start: FloatArray) -> Found:
        """Solve poses of shape (n, task.width), each from a start of shape (n, joints)."""
        joints = np.array(start, dtype=np.float64)
        place_mm, turn_deg = np.full(len(poses), np.inf), np.full(len(poses), np.inf)
        going = np.arange(len(poses))
        scale = np.where(self.slides, self.reach_mm, np.rad2deg(1.0))[list(self.free)]
        for step in range(_STEPS + 1):
            check_planning_time()
            errors, jacobians = self._errors(poses[going], joints[going])
            place_mm[going] = np.linalg.norm(errors[:, :3], axis=1) * self.reach_mm
            turn_deg[going] = np.rad2deg(np.linalg.norm(errors[:, 3:], axis=1))
            off = (place_mm[going] > PLACE_OFF_MM * _MARGIN) | (turn_deg[going] > TURN_OFF_DEG * _MARGIN)
            going, errors, jacobians = going[off], errors[off], jacobians[off]
            if step == _STEPS or not going.size:
                break
            moves = _steps(errors, jacobians)
            joints[going[:, np.newaxis], list(self.free)] += moves * scale
        return Found(joints, place_mm, turn_deg)

    def anywhere(self, poses: FloatArray, near: FloatArray) -> Found:
        """Solve poses from starts `near` of shape (n, joints); prefer solutions within the limits.

        A pose that is not reached is tried again from random starts within the limits, which are always the same.
        """
        found = self.near(poses, near)
        rng = np.random.default_rng(_SEED)
        for _ in range(_RESTARTS):
            left = np.flatnonzero(~self._within(found))
            if not left.size:
                break
            start = near[left].copy()
            start[:, self.free] = rng.uniform(self.lower, self.upper, start.shape)[:, self.free]
            again = self.near(poses[left], start)
            nearer = again.off_mm + again.off_deg < found.off_mm[left] + found.off_deg[left]
            better = self._within(again) | (~found.solved[left] & nearer)
            for old, new in (
                (found.joints, again.joints),
                (found.off_mm, again.off_mm),
                (found.off_deg, again.off_deg),
            ):
                old[left[better]] = new[better]
        return found

    def _within(self, found: Found) -> BoolArray:
        """Return, of shape (n,), where joints are a solution and, in some turn, within their limits."""
        above = found.joints - self.lower + LIMIT_TOLERANCE
        above = np.where(self.slides, above, above % 360.0)
        kept = (above >= 0.0) & (above <= self.upper - self.lower + 2.0 * LIMIT_TOLERANCE)
        return np.asarray(found.solved & kept[:, self.free].all(axis=1))

    def solutions(self, pose: FloatArray, near: FloatArray, known: FloatArray) -> FloatArray:
        """Return solutions of a pose of shape (task.width,), shape (k, joints), sorted by their joints.

        All are different, and different from `known`. The search starts from `near`, of shape (joints,), and from
        random joints within the limits, which are always the same. If the pose does not determine all joints, there are
        further solutions.
        """
        starts = np.tile(near, (_STARTS, 1))
        random = np.random.default_rng(_SEED).uniform(self.lower, self.upper, starts.shape)
        starts[1:, self.free] = random[1:, self.free]
        found = self.near(np.tile(pose, (_STARTS, 1)), starts)
        joints = np.where(self.slides, found.joints, wrapped_deg(found.joints))[found.solved]
        kept = [known]
        for each in joints[np.lexsort(np.round(joints / _SAME)[:, ::-1].T)]:
            if all(self._apart(each, other) > _SAME for other in kept):
                kept.append(each)
        return np.array(kept[1 : 1 + SOLUTIONS_MAX]).reshape(-1, len(near))

    def _apart(self, joints: FloatArray, others: FloatArray) -> float:
        """Return the largest difference of joints of shape (joints,), in mm and degrees, ignoring full turns."""
        apart = joints - others
        return float(np.abs(np.where(self.slides, apart, wrapped_deg(apart))).max())

    def jacobians(self, joints: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return the tool's rotations, of shape (n, 4), and its Jacobians of shape (n, rows, free).

        The rows of the task are in the tool's frame, in fractions of the reach and rad; the columns are per rad, or per
        reach for a slide.
        """
        tool, jacobians = self.screws.with_jacobian(joints)
        return tool[:, 3:], self._scaled(jacobians)

    def _scaled(self, jacobians: FloatArray) -> FloatArray:
        rows = ROWS[self.task]
        chosen = jacobians[:, rows][:, :, self.free]
        chosen[:, :3] /= self.reach_mm
        return np.asarray(chosen * np.where(self.slides, self.reach_mm, 1.0)[list(self.free)])

    def _errors(self, poses: FloatArray, joints: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return the errors, of shape (n, rows), in fractions of the reach and rad, and the Jacobians."""
        tool, jacobians = self.screws.with_jacobian(joints)
        back = reversed_rotation(tool[:, 3:])
        errors = [turned(poses[:, :3] - tool[:, :3], back) / self.reach_mm]
        if self.task is POSE:
            errors.append(np.deg2rad(rotation_vector_deg(product(back, poses[:, 3:]))))
        elif self.task is DIRECTION_TASK:
            wanted = turned(poses[:, 3:], back)
            sine = np.linalg.norm(wanted[:, :2], axis=1)
            angle = np.arctan2(sine, wanted[:, 2])
            part = np.divide(angle, sine, out=np.ones_like(sine), where=sine > 0.0)
            about_x = np.where(sine > 0.0, -wanted[:, 1] * part, angle)  # opposite: half a turn about any axis
            errors.append(np.column_stack([about_x, wanted[:, 0] * part]))
        return np.concatenate(errors, axis=1), self._scaled(jacobians)


_MARGIN: Final = 1e-2
"""Fraction of the tolerances at which the iteration ends: the last Newton step is far below them."""


def _steps(errors: FloatArray, jacobians: FloatArray) -> FloatArray:
    """Return the steps of the joints, of shape (n, free), in rad and fractions of the reach, limited in size."""
    transposed = np.swapaxes(jacobians, 1, 2)
    damping = DAMPING * np.linalg.norm(errors, axis=1)
    square = jacobians @ transposed
    square[:, range(square.shape[1]), range(square.shape[1])] += damping[:, np.newaxis] + _LEAST
    moves = (transposed @ np.linalg.solve(square, errors[:, :, np.newaxis]))[:, :, 0]
    largest = np.abs(moves).max(axis=1, keepdims=True)
    return np.asarray(moves * np.minimum(1.0, _STEP_MAX_RAD / np.maximum(largest, _LEAST)))


_LEAST: Final = 1e-14
"""Least damping, so that a step also exists at a singularity."""
