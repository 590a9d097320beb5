"""The points of a trajectory file of any format, as in the file and as a robot's joints.

Between two points with velocities the motion is a cubic, which determines accelerations and tool poses.
"""

from collections.abc import Iterable, Mapping, Sequence
from collections.abc import Sequence as Texts
from dataclasses import dataclass, replace
from math import ceil, degrees, floor, inf, nan
from typing import Final

import numpy as np

from steptwin.host.common.arrays import FloatArray
from steptwin.host.common.bad_input import nearest_within, outside, prefixed, unknown
from steptwin.host.common.errors import InputError
from steptwin.host.planning.motions.sampled import NumberedPlaces, check_times
from steptwin.host.planning.peaks import LONGEST_MS
from steptwin.host.robots.joint import Joint, Unit
from steptwin.host.robots.kinematics import Branch, Kinematics, make_kinematics
from steptwin.host.robots.kinematics.base import LIMIT_TOLERANCE, joint_constraints
from steptwin.host.robots.poses import COLUMNS, PLACE, TASKS, Orientation, Task, have_right_length, orientations_of
from steptwin.host.robots.robot import Robot
from steptwin.host.robots.workspace.nearest_pose import passing_text

_CIRCLE_DEG: Final = 360.0

_POSE_UNITS: Final[dict[str, str]] = {
    name: unit
    for columns in (*(task.coordinates for task in TASKS.values()), *COLUMNS.values())
    for name, unit in columns.items()
}
POSE_COLUMNS: Final = frozenset(_POSE_UNITS)
"""Headers of a file of poses, for all tasks of tools."""


def joints_at(robot: Robot, poses: FloatArray, branch: str | None, places: Sequence[str]) -> Branch:
    """Return the branch with its joints, of shape (points, joints), for poses of shape (points, width).

    The default branch is the first one that reaches all poses. An arm whose branches meet begins on it and then takes
    the nearest branch at each pose. Joints that turn further than a circle take the nearest turn, starting from the
    home position; joints that the pose does not determine stay at home. `places` are the places of the points' times in
    the file.

    Raises:
        InputError: no branch has the name; or none reaches all poses, with the point and the reason.
    """
    kinematics = make_kinematics(robot)
    if branch is not None and branch not in kinematics.branches:
        raise unknown("elbow:", branch, kinematics.branches)
    candidates = kinematics.branches if branch is None else (branch,)
    solved = [_solved(robot, kinematics, poses, name) for name in candidates]
    for candidate in solved:
        if candidate.reachable.all():
            return candidate
    farthest = max(solved, key=_first_out_of_reach)
    raise _broken_off(robot, kinematics, poses, farthest, places)


def _solved(robot: Robot, kinematics: Kinematics, poses: FloatArray, name: str) -> Branch:
    """Return a branch with joints without jumps of a whole turn, as long as it is in reach."""
    home = np.array(robot.home)
    first = kinematics.solve(poses[:1], name, home)
    if kinematics.keeps_branch or not first.reachable[0]:
        solved = kinematics.solve(poses, name, home)
    else:
        solved = kinematics.along(poses, name, first.joints[0])
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
    """Return the fewest whole turns that bring a joint's angles within its limits; 0 if none do."""
    fewest = ceil((joint.lower - turned_deg.min()) / _CIRCLE_DEG)
    most = floor((joint.upper - turned_deg.max()) / _CIRCLE_DEG)
    return _CIRCLE_DEG * min(max(0, fewest), most) if fewest <= most else 0.0


def _first_out_of_reach(branch: Branch) -> int:
    return int(np.argmin(branch.reachable))


def _broken_off(
    robot: Robot, kinematics: Kinematics, poses: FloatArray, branch: Branch, places: Sequence[str]
) -> InputError:
    """Return the error for the first pose out of a branch's reach, with the branch or the pose that is in reach."""
    i = _first_out_of_reach(branch)
    place = f"{point_place(places, i)}: {kinematics.task.words(poses[i].tolist())}"
    text = f"{place} is out of reach on the branch {branch.name!r}: {branch.reason(i)}"
    others = kinematics.inverse(poses[i : i + 1], np.array(robot.home))
    names = {*kinematics.branches} - {branch.name}  # further solutions of a chain are no branches
    other = next((other.name for other in others if other.reachable[0] and other.name in names), None)
    if other is None:
        passing = passing_text(robot, tuple(poses[i].tolist()), np.array(robot.home), branch.name)
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
    """Return a point's place in the file: `line 5`, if its time is at `line 5, t`."""
    return places[i].partition(",")[0]


_ANGLES_DEG: Final = {"deg": 1.0, "rad": degrees(1.0)}
_LENGTHS_MM: Final = {"mm": 1.0, "m": 1000.0}


@dataclass(frozen=True, slots=True)
class FileUnits:
    """Degrees in an angle's unit, and millimetres in a length's."""

    angle_deg: float = 1.0
    length_mm: float = 1.0

    @classmethod
    def named(cls, names: str) -> "FileUnits":
        """Return the units for `deg` or `rad`, `mm` or `m`, or one of each with a comma between them.

        Raises:
            InputError: a name is unknown, or two are for the same quantity.
        """
        angle: float | None = None
        length: float | None = None
        for name in (part.strip() for part in names.split(",")):
            if name in _ANGLES_DEG and angle is None:
                angle = _ANGLES_DEG[name]
            elif name in _LENGTHS_MM and length is None:
                length = _LENGTHS_MM[name]
            elif name in (*_ANGLES_DEG, *_LENGTHS_MM):
                twice = f"{names}: has two units of the same kind; rad,m is one of each"
                raise InputError(f"units={twice}").plainly(f"units {twice}")
            else:
                raise unknown(f"units={names}: the unit", name, [*_ANGLES_DEG, *_LENGTHS_MM])
        return cls(angle or 1.0, length or 1.0)


USUAL: Final = FileUnits()


VELOCITY: Final = "v_"
"""Prefix of a joint's name in the header of its velocities."""

ACCELERATION: Final = "a_"
"""Prefix of a joint's name in the header of its accelerations, in mm/s^2 and deg/s^2."""

TOOL: Final = "tool_"
"""Prefix of a coordinate of the tool in the header of derived columns, in mm and degrees."""

TOOL_AXES: Final = ("tool_nx", "tool_ny", "tool_nz", "tool_ox", "tool_oy", "tool_oz")
"""Direction cosines of the tool's x axis n and y axis o; its z axis is n x o."""


def derived_columns(joints: Iterable[str], task: Task) -> tuple[str, ...]:
    """Return the headers of all derived columns, in the order of `run`."""
    of_tool = (*(TOOL + name for name in task.coordinates), *TOOL_AXES) if task.width else ()
    return (*(ACCELERATION + name for name in joints), *of_tool)


def derived_in(header: Sequence[str]) -> frozenset[int]:
    """Return the indexes of a header's derived columns; a column with velocities of its own is a joint's position."""
    joints = [name for name in header if VELOCITY + name in header]
    names = {name for task in TASKS.values() for name in derived_columns(joints, task)} - set(joints) if joints else ()
    return frozenset(i for i, name in enumerate(header) if name in names)


LONGEST_S: Final = LONGEST_MS / 1000
"""Longest motion that a file may hold; a longer one probably has times in other units."""


@dataclass(frozen=True, slots=True)
class Points:
    """The contents of a trajectory file, in the order of its columns.

    names: name of each column: a joint or one of the tool's coordinates.
    places: place of each point's time in the file, for messages.
    times_s: shape (points,).
    positions: shape (points, columns), in mm and degrees.
    velocities: shape (points, columns), in mm/s and deg/s; None without velocities.
    elbow: branch of the inverse kinematics in the file; None without one.
    unread: names of derived columns, or kinds of derived values of a JSON point.
    rounded_s: largest shift of points to whole milliseconds.
    is_goal: True if the motion may begin at any position of the machine, as in ROS: the first point is after 0 s.
    begun_at_home: True if it was begun at the robot's home position.
    """

    names: list[str]
    places: Texts[str]
    times_s: FloatArray
    positions: FloatArray
    velocities: FloatArray | None
    elbow: str | None = None
    unread: tuple[str, ...] = ()
    rounded_s: float = 0.0
    is_goal: bool = False
    begun_at_home: bool = False

    def begun_at(self, start: Mapping[str, float]) -> "Points":
        """Return the points after a further one at 0 s, with all joints at positions given by name."""
        velocities = self.velocities
        return replace(
            self,
            places=NumberedPlaces("point {}, time_from_start", range(len(self.times_s) + 1)),
            times_s=np.concatenate(([0.0], self.times_s)),
            positions=np.vstack([[start[name] for name in self.names], self.positions]),
            velocities=None if velocities is None else np.vstack([np.zeros(len(self.names)), velocities]),
            is_goal=False,
        )

    def begun_at_home_of(self, robot: Robot) -> "Points":
        """Return a goal as the motion from a robot's home position; other points as they are."""
        if not self.is_goal or set(self.names) != set(robot.joint_names):
            return self
        return replace(self.begun_at(dict(zip(robot.joint_names, robot.home, strict=True))), begun_at_home=True)

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

    def in_units(self, units: FileUnits, robot: Robot) -> "Points":
        """Return the points in mm and degrees; `units` are those of the file's lengths and angles."""
        if units == USUAL:
            return self
        unit_of = {**_POSE_UNITS, **{joint.name: joint.unit for joint in robot.joints}}
        factor_of = {Unit.MM: units.length_mm, "": 1.0}
        factors = np.array([factor_of.get(unit_of.get(name, Unit.DEG), units.angle_deg) for name in self.names])
        velocities = None if self.velocities is None else self.velocities * factors
        return replace(self, positions=self.positions * factors, velocities=velocities)

    def joint_points(self, robot: Robot, elbow: str | None = None, *, all_whole_ms: bool = False) -> "JointPoints":
        """Return the points as joint positions; `elbow` is the branch for a file of poses without one.

        Raises:
            InputError: the columns are not the robot's joints or the tool's coordinates, the times are not a motion's
                (with `all_whole_ms` each must be a whole millisecond), a pose is out of reach, or `elbow` is for joints
                or contradicts the file.
        """
        names = set(self.names)
        if names & POSE_COLUMNS and not names & set(robot.joint_names):
            return self._from_poses(robot, elbow, all_whole_ms=all_whole_ms)
        positions, velocities = self._ordered("joint", robot.joint_names, robot.name)
        self._check_times(all_whole_ms=all_whole_ms)
        if elbow is not None:
            raise InputError(f"elbow={elbow}: is for a file of the tool's poses; this one has joints")
        return JointPoints(
            self.times_s,
            self.places,
            positions,
            velocities,
            unread=self.unread,
            rounded_s=self.rounded_s,
            begun_at_home=self.begun_at_home,
        )

    def _check_times(self, *, all_whole_ms: bool) -> None:
        times_s = self.times_s
        late = times_s > LONGEST_S
        if late.any():
            i = int(np.argmax(late))
            raise InputError(f"{self.places[i]}: {times_s[i]:.9g} s is more than {LONGEST_S:g} s: are the times in ms?")
        check_times(times_s, self.places, all_whole_ms=all_whole_ms or self.velocities is not None)

    def _from_poses(self, robot: Robot, elbow: str | None, *, all_whole_ms: bool) -> "JointPoints":
        kinematics = make_kinematics(robot)
        task = kinematics.task
        if not task.width:
            raise InputError(f"{robot.name} has no tool: its file has the joints {' '.join(robot.joint_names)}")
        follows = kinematics.attitude_follows and "phi" not in self.names
        key = self._orientation_key(task)
        columns = tuple(PLACE if follows else {**PLACE, **COLUMNS[key]} if key else task.coordinates)
        poses, velocities = self._ordered("column", columns, "a pose")
        self._check_times(all_whole_ms=all_whole_ms)
        if velocities is not None and not task.is_flat:
            raise InputError("velocities of a tool that turns in space: leave them out, the motion is a spline then")
        if key:
            self._check_orientations(task, key, poses[:, 3:])
            poses = np.column_stack([poses[:, :3], orientations_of(key, poses[:, 3:])])
        if follows:  # the kinematics takes NaN for a dependent attitude
            poses = np.pad(poses, ((0, 0), (0, 1)), constant_values=nan)
            velocities = None if velocities is None else np.pad(velocities, ((0, 0), (0, 1)))
        if None not in (elbow, self.elbow) and elbow != self.elbow:
            raise InputError(f"elbow={elbow}: the file's own elbow is {self.elbow!r}")
        branch = joints_at(robot, poses, elbow or self.elbow, self.places)
        if velocities is not None:
            velocities = kinematics.joint_velocities(branch.joints, velocities)
        return JointPoints(
            self.times_s, self.places, branch.joints, velocities, poses[:, :3], branch, self.unread, self.rounded_s
        )

    def _orientation_key(self, task: Task) -> str:
        """Return the key of the file's orientation columns, else the task's; empty for a tool without orientation."""
        if task.is_flat:
            return ""
        given = {key: name for key, columns in COLUMNS.items() for name in columns if name in self.names}
        if len(given) > 1:
            first, second, *_ = given.values()
            raise InputError(f"column {second!r}: beside {first!r}; a pose has one orientation")
        return next(iter(given), task.key)

    def _check_orientations(self, task: Task, key: str, values: FloatArray) -> None:
        """Raise InputError, with its place, for the first invalid or impossible orientation."""
        right = have_right_length(key, values)
        i = int(np.argmin(right))
        with prefixed(f"{point_place(self.places, i)}: "):
            task.oriented(Orientation(key, tuple(values[i].tolist())))

    def _ordered(self, what: str, wanted: Texts[str], owner: str) -> tuple[FloatArray, FloatArray | None]:
        """Return positions and velocities with the wanted columns; raise InputError if the file has other ones."""
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
        places: place of each point's time in the file, for messages.
        positions: shape (points, joints), in mm and degrees.
        velocities: shape (points, joints), in mm/s and deg/s; None without velocities.
        tool_mm: x, y and z, of shape (points, 3), if the file has poses; None if it has joints.
        reached: branch of the inverse kinematics for the poses, with its changes.
        unread: names of derived columns, or kinds of derived values.
        rounded_s: largest shift of points to whole milliseconds.
        begun_at_home: True if the first point is the robot's home position instead of the file's.
    """

    times_s: FloatArray
    places: Texts[str]
    positions: FloatArray
    velocities: FloatArray | None
    tool_mm: FloatArray | None = None
    reached: Branch | None = None
    unread: tuple[str, ...] = ()
    rounded_s: float = 0.0
    begun_at_home: bool = False

    @property
    def branch(self) -> str | None:
        """Name of the branch at the first point; None for a file of joints."""
        return None if self.reached is None else self.reached.name

    @property
    def branch_words(self) -> str:
        """The branch and its changes, with places in the file, as text; empty for a file of joints."""
        if self.reached is None:
            return ""
        changes = (f", from {point_place(self.places, i)} on {name!r}" for i, name in self.reached.changes)
        return f"on the branch {self.reached.name!r}{''.join(changes)}"

    def check_within(self, robot: Robot) -> None:
        """Raise InputError for the first point outside a joint's limits, with place, value and nearest valid value."""
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
