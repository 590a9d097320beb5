"""The joints at points that a file gives as poses of the tool: inverse kinematics on one branch."""

from collections.abc import Sequence
from dataclasses import replace
from math import ceil, floor
from typing import Final

import numpy as np

from steptwin.host.common.arrays import FloatArray
from steptwin.host.common.bad_input import unknown
from steptwin.host.common.errors import InputError
from steptwin.host.robots.joint import Joint, Unit
from steptwin.host.robots.kinematics import Branch, Kinematics, make_kinematics, pose_words
from steptwin.host.robots.kinematics.base import joint_constraints
from steptwin.host.robots.nearest_pose import passing_text
from steptwin.host.robots.robot import Robot

_CIRCLE_DEG: Final = 360.0


def joints_at(robot: Robot, poses: FloatArray, branch: str | None, places: Sequence[str]) -> tuple[str, FloatArray]:
    """Return the branch and the joints, of shape (points, joints), for poses of shape (points, 4).

    Without a branch it is the first one that reaches all poses. Joints that turn further than a circle go on to the
    nearest turn, from the turn nearest to the home position; joints that the pose does not determine stay at home.
    `places` says where each point's time stands in the file.

    Raises:
        InputError: no branch has the name; or none reaches all poses, with the point and why.
    """
    kinematics = make_kinematics(robot)
    if branch is not None and branch not in kinematics.branches:
        raise unknown("elbow:", branch, kinematics.branches)
    candidates = kinematics.branches if branch is None else (branch,)
    solved = [_solved(robot, kinematics, poses, name) for name in candidates]
    for candidate in solved:
        if candidate.reachable.all():
            return candidate.name, candidate.joints
    farthest = max(solved, key=_first_out_of_reach)
    raise _broken_off(robot, kinematics, poses, farthest, places)


def _solved(robot: Robot, kinematics: Kinematics, poses: FloatArray, name: str) -> Branch:
    """Return a branch whose joints go on without jumps of a whole turn, as far as it is within reach."""
    solved = kinematics.solve(poses, name, np.array(robot.home))
    joints = solved.joints
    within = ~np.isnan(joints).any(axis=1)
    end = len(poses) if within.all() else int(np.argmin(within))
    for axis, joint in enumerate(robot.joints):
        if joint.unit is Unit.DEG and joint.upper - joint.lower > _CIRCLE_DEG and end:
            turned_deg = np.unwrap(joints[:end, axis], period=_CIRCLE_DEG)
            joints[:end, axis] = turned_deg + _turns_deg(joint, turned_deg)
    same = np.concatenate([[False], (np.diff(np.nan_to_num(poses), axis=0) == 0.0).all(axis=1)])
    joints = joints[np.maximum.accumulate(np.where(same, 0, np.arange(len(poses))))]  # equal to the last digit
    return replace(solved, joints=joints, limits=joint_constraints(robot.joints, joints))


def _turns_deg(joint: Joint, turned_deg: FloatArray) -> float:
    """Return the fewest whole turns by which a joint's angles come within its limits, 0 if none do."""
    fewest = ceil((joint.lower - turned_deg.min()) / _CIRCLE_DEG)
    most = floor((joint.upper - turned_deg.max()) / _CIRCLE_DEG)
    return _CIRCLE_DEG * min(max(0, fewest), most) if fewest <= most else 0.0


def _first_out_of_reach(branch: Branch) -> int:
    return int(np.argmin(branch.reachable))


def _broken_off(
    robot: Robot, kinematics: Kinematics, poses: FloatArray, branch: Branch, places: Sequence[str]
) -> InputError:
    """Return the error for the first pose that a branch does not reach, with the branch or the pose that does."""
    i = _first_out_of_reach(branch)
    place = f"{point_place(places, i)}: {pose_words(poses[i].tolist())}"
    text = f"{place} is out of reach on the branch {branch.name!r}: {branch.reason(i)}"
    others = kinematics.inverse(poses[i : i + 1], np.array(robot.home))
    other = next((other.name for other in others if other.reachable[0] and other.name != branch.name), None)
    if other is None:
        x_mm, y_mm, z_mm, phi_deg = poses[i].tolist()
        passing = passing_text(robot, (x_mm, y_mm, z_mm, phi_deg), np.array(robot.home), branch.name)
        return InputError(f"{text}{passing}")
    missed = _solved(robot, kinematics, poses, other)
    if missed.reachable.all():
        return InputError(f"{text}; the branch {other!r} reaches all points (elbow={other})")
    j = _first_out_of_reach(missed)
    return InputError(
        f"{text}; the branch {other!r} reaches it, but not {point_place(places, j)}: {missed.reason(j)};"
        " the arm would have to change the branch on the way, which takes a file of joints"
    )


def point_place(places: Sequence[str], i: int) -> str:
    """Return where a point stands in the file: `line 5`, if its time stands at `line 5, t`."""
    return places[i].partition(",")[0]
