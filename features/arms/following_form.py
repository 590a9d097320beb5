"""Joints of an arm with a closed form along a path: at each pose the solution nearest to the one before.

The branch may change where two branches meet: straight through a stretched wrist, `noflip` becomes `flip`, and no joint
jumps.
"""

from math import inf
from typing import Final, NamedTuple

import numpy as np

from steptwin.features.arms.spherical_wrist import Solved, SphericalWrist
from steptwin.host.common.arrays import FloatArray
from steptwin.host.common.planning_time import check_planning_time
from steptwin.host.robots.kinematics.serial.following import turned_to
from steptwin.host.robots.kinematics.serial.levenberg import PLACE_OFF_MM
from steptwin.host.robots.poses.rotations import wrapped_deg

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
