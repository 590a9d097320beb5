"""The points of a trajectory file, whatever its format, as the file has them and as a robot's joints."""

from collections.abc import Sequence as Texts
from dataclasses import dataclass, replace
from math import inf, nan
from typing import Final

import numpy as np

from steptwin.host.common.arrays import FloatArray
from steptwin.host.common.bad_input import nearest_within, outside, unknown
from steptwin.host.common.errors import InputError
from steptwin.host.planning.motions.sampled import check_times
from steptwin.host.planning.paths import COORDINATES
from steptwin.host.planning.trajectory_file.tool_points import joints_at, point_place
from steptwin.host.robots.kinematics import make_kinematics
from steptwin.host.robots.kinematics.base import LIMIT_TOLERANCE
from steptwin.host.robots.robot import Robot

LONGEST_S: Final = 3600.0
"""Longest motion that a file may hold; a longer one probably has times in other units, and would not fit in memory."""


@dataclass(frozen=True, slots=True)
class Points:
    """The contents of a trajectory file, in the order of its columns.

    Attributes:
        names: one for each column, of a joint or of one of the tool's coordinates.
        places: where each point's time stands in the file, for messages.
        times_s: shape (points,).
        positions: shape (points, columns), in mm and degrees.
        velocities: likewise, in mm/s and deg/s; None if the file gives none.
        elbow: branch of the inverse kinematics that the file names; None if it names none.
        unread: names of the columns that follow from the others (`derived`).
    """

    names: list[str]
    places: Texts[str]
    times_s: FloatArray
    positions: FloatArray
    velocities: FloatArray | None
    elbow: str | None = None
    unread: tuple[str, ...] = ()

    def until(self, end_s: float) -> "Points":
        """Return the points up to an instant, all if it is infinite; raise InputError if no motion ends before it."""
        if end_s == inf:
            return self
        kept = int(np.count_nonzero(self.times_s <= end_s))
        if kept < min(2, len(self.times_s)):
            raise InputError(f"there is no second point up to {end_s:.6f} s")
        return replace(
            self,
            places=self.places[:kept],
            times_s=self.times_s[:kept],
            positions=self.positions[:kept],
            velocities=None if self.velocities is None else self.velocities[:kept],
        )

    def joint_points(self, robot: Robot, elbow: str | None = None, *, all_whole_ms: bool = False) -> "JointPoints":
        """Return the points as joint positions; `elbow` is the branch for a file of poses that does not name it.

        Raises:
            InputError: the columns are not the robot's joints or the tool's coordinates, the times are not a motion's
                (with `all_whole_ms` each must be a whole millisecond), a pose is out of reach, or `elbow` is for joints
                or contradicts the file.
        """
        names = set(self.names)
        if names & set(COORDINATES) and not names & set(robot.joint_names):
            return self._from_poses(robot, elbow, all_whole_ms=all_whole_ms)
        positions, velocities = self._ordered("joint", robot.joint_names, robot.name)
        self._check_times(all_whole_ms=all_whole_ms)
        if elbow is not None:
            raise InputError(f"elbow={elbow}: is for a file of the tool's poses; this one has joints")
        return JointPoints(self.times_s, self.places, positions, velocities, unread=self.unread)

    def _check_times(self, *, all_whole_ms: bool) -> None:
        times_s = self.times_s
        late = times_s > LONGEST_S
        if late.any():
            i = int(np.argmax(late))
            raise InputError(f"{self.places[i]}: {times_s[i]:.9g} s is more than {LONGEST_S:g} s: are the times in ms?")
        check_times(times_s, self.places, all_whole_ms=all_whole_ms or self.velocities is not None)

    def _from_poses(self, robot: Robot, elbow: str | None, *, all_whole_ms: bool) -> "JointPoints":
        kinematics = make_kinematics(robot)
        follows = kinematics.attitude_follows and COORDINATES[-1] not in self.names
        poses, velocities = self._ordered("column", COORDINATES[:-1] if follows else COORDINATES, "a pose")
        self._check_times(all_whole_ms=all_whole_ms)
        if follows:  # the kinematics takes NaN for an attitude that follows from the arm
            poses = np.pad(poses, ((0, 0), (0, 1)), constant_values=nan)
            velocities = None if velocities is None else np.pad(velocities, ((0, 0), (0, 1)))
        if None not in (elbow, self.elbow) and elbow != self.elbow:
            raise InputError(f"elbow={elbow}: the file's own elbow is {self.elbow!r}")
        branch, joints = joints_at(robot, poses, elbow or self.elbow, self.places)
        if velocities is not None:
            velocities = kinematics.joint_velocities(joints, velocities)
        return JointPoints(self.times_s, self.places, joints, velocities, poses[:, :3], branch, self.unread)

    def _ordered(self, what: str, wanted: Texts[str], owner: str) -> tuple[FloatArray, FloatArray | None]:
        """Return positions and velocities with the wanted columns; raise InputError unless the file has just these."""
        names = self.names
        for name in names:
            if name not in wanted:
                raise unknown(what, name, wanted)
            if names.count(name) > 1:
                raise InputError(f"{what} {name!r} appears {names.count(name)} times")
        for name in wanted:
            if name not in names:
                raise InputError(f"{what} {name!r} is missing: {owner} has {' '.join(wanted)}")
        columns = [names.index(name) for name in wanted]
        return self.positions[:, columns], None if self.velocities is None else self.velocities[:, columns]


@dataclass(frozen=True, slots=True, eq=False)
class JointPoints:
    """The points of a file as a robot's joint positions.

    Attributes:
        times_s: shape (points,), as `check_times` requires them.
        places: where each point's time stands in the file, for messages.
        positions: shape (points, joints), in mm and degrees.
        velocities: likewise, in mm/s and deg/s; None if the file gives none.
        tool_mm: x, y and z, of shape (points, 3), if the file has poses; None if it has joints.
        branch: branch of the inverse kinematics on which the poses are reached.
        unread: names of the file's columns that follow from the others (`derived`).
    """

    times_s: FloatArray
    places: Texts[str]
    positions: FloatArray
    velocities: FloatArray | None
    tool_mm: FloatArray | None = None
    branch: str | None = None
    unread: tuple[str, ...] = ()

    def check_within(self, robot: Robot) -> None:
        """Raise InputError for the first point outside a joint's limits, with its place, value and the nearest one."""
        lower, upper = (np.array([getattr(joint, end) for joint in robot.joints]) for end in ("lower", "upper"))
        beyond = (self.positions < lower - LIMIT_TOLERANCE) | (self.positions > upper + LIMIT_TOLERANCE)
        if not beyond.any():
            return
        row, column = (int(index) for index in np.argwhere(beyond)[0])
        joint, position = robot.joints[column], float(self.positions[row, column])
        limits = (joint.lower, joint.upper, joint.unit)
        others = int(beyond.any(axis=1).sum()) - 1
        more = f"; {others} more {'points are' if others > 1 else 'point is'} outside limits" if others else ""
        place = f"{point_place(self.places, row)}, {joint.name}"
        raise InputError(f"{place}: {outside(position, *limits)}{nearest_within(position, *limits)}{more}")
