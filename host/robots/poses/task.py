"""Tasks of tools: the meaning of a row of an array of poses.

Every pose begins with x, y and z in mm in the station's frame. Then, by the task:

    scara       phi, the tool's turn about the vertical in degrees
    position    nothing
    direction   the unit vector of the tool's z axis, its approach; the spin about it follows from the arm
    pose        the rotation as a unit quaternion x y z w
    no tool     not even x, y and z: a machine without a tool has no poses

Tool velocities are the derivatives of x, y, z and phi per second. For tools that turn in space, they are those of x, y
and z, and the angular velocity about the station's axes in degrees per second.
"""

from abc import ABC
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from math import isnan
from typing import ClassVar, Final

import numpy as np

from steptwin.host.common.arrays import FloatArray
from steptwin.host.common.errors import InputError
from steptwin.host.robots.poses.rotations import (
    COLUMNS,
    DIRECTION,
    Orientation,
    angle_deg,
    of_rotation_vector,
    of_rpy_deg,
    product,
    reversed_rotation,
    rotation_vector_deg,
    rpy_deg,
    turned,
    wrapped_deg,
)

Pose = tuple[float, ...]
"""A row of a pose array."""

PoseDocument = dict[str, float | list[float]]
"""A pose under the keys of documents and files: x_mm, y_mm, z_mm and the orientation."""

PLACE: Final = {"x": "mm", "y": "mm", "z": "mm"}
"""Coordinates at the start of every pose, and their units."""
_TURNS: Final = {"rx": "deg", "ry": "deg", "rz": "deg"}
TURNS: Final = tuple(_TURNS)
"""Names of rotations about axes."""

STEP_NAMES: Final = (*PLACE, "phi", *_TURNS)
"""Names of a tool's steps of all tasks: along the station's axes, by phi, or about the station's axes."""

SPIN_OFF_MAX: Final = 1e-6
"""Sine of the largest angle to a direction for a rotation about it."""
HALF_TURN_DEG: Final = 179.999
"""Angle from which on the sense of a rotation is ambiguous."""


class Task(ABC):
    """The meaning of poses, arrays of shape (n, width), of one kind of tool.

    Attributes:
        name: its name in robot files.
        width: columns of a pose.
        rates: columns of a tool velocity.
        coordinates: unit of each coordinate, by its name, for columns of files and fields of forms.
        steps: unit of each step of the tool, by its name.
        keys: names of the coordinates in documents.
        key: key of the coordinates' orientation; empty for flat tasks.
        is_flat: True if a straight motion is straight in every column.
    """

    name: ClassVar[str]
    width: ClassVar[int]
    rates: ClassVar[int]
    coordinates: ClassVar[Mapping[str, str]]
    steps: ClassVar[Mapping[str, str]]
    keys: ClassVar[tuple[str, ...]]
    key: ClassVar[str] = ""
    is_flat: ClassVar[bool] = True

    def __reduce__(self) -> tuple[Callable[[str], "Task"], tuple[str]]:
        """Be the same task in another process: tables have tasks as their keys."""
        return _task_of, (self.name,)

    def off_deg(self, poses: FloatArray, planned: FloatArray) -> FloatArray:
        """Return the angles, of shape (...), between poses of shape (..., width) and planned ones."""
        return np.zeros(np.broadcast_shapes(poses.shape, planned.shape)[:-1])

    def figures(self, poses: FloatArray) -> FloatArray:
        """Return the coordinates of poses of shape (..., width), shape (..., coordinates)."""
        return poses

    def of_figures(self, figures: FloatArray) -> FloatArray:
        """Return the poses with these coordinates; the inverse of `figures`."""
        return figures

    def unwrapped(self, figures: FloatArray) -> FloatArray:
        """Return coordinates over time, of shape (n, coordinates), with angles without jumps by a whole turn."""
        turning = [unit == "deg" for unit in self.coordinates.values()]
        return np.where(turning, np.unwrap(figures, period=360.0, axis=0), figures)

    def document(self, pose: FloatArray | Sequence[float]) -> PoseDocument:
        """Return a pose, of shape (width,), under the keys of documents."""
        return dict(zip(self.keys, np.asarray(pose).tolist(), strict=True))

    def words(self, pose: FloatArray | Sequence[float]) -> str:
        """Return a pose as text."""
        x_mm, y_mm, z_mm = (np.round(pose[:3], 9) + 0.0).tolist()  # without the dust of products
        return f"x {x_mm:g}, y {y_mm:g}, z {z_mm:g} mm"

    def changed(self, pose: Pose, coordinates: Mapping[str, float], orientation: Orientation | None) -> Pose:
        """Return a pose with some coordinates changed; raise InputError for those that the tool does not have."""
        self.check(coordinates, orientation)
        columns = np.array(pose)
        for i, name in enumerate(PLACE):
            columns[i] = coordinates.get(name, pose[i])
        if orientation is not None:
            columns[3:] = self.oriented(orientation)
        return tuple(columns.tolist())

    def told(self, figures: Mapping[str, float]) -> tuple[dict[str, float], Orientation | None]:
        """Return coordinates by name for `changed`."""
        return dict(figures), None

    def check(self, coordinates: Mapping[str, float], orientation: Orientation | None) -> None:
        """Raise InputError for a coordinate or an orientation that the tool does not have."""
        for name in coordinates:
            if name not in self.coordinates:
                raise InputError(f"{name}: {self._not_told}")
        if orientation is not None:
            self.oriented(orientation)

    def oriented(self, orientation: Orientation) -> FloatArray:
        """Return the columns of a pose after x, y and z; raise InputError if the tool has no such orientation."""
        raise InputError(f"{orientation.key}: {self._not_told}")

    _not_told: ClassVar[str]
    """Reason for refusing another orientation, with the remedy."""

    def check_steps(self, names: Iterable[str]) -> None:
        """Raise InputError for a step that the tool cannot make."""
        for name in names:
            if name not in self.steps:
                raise InputError(f"{name}: {self._not_told}")

    def stepped(self, pose: Pose, distances: Mapping[str, float]) -> Pose:
        """Return the pose after steps of the tool by name; raise InputError for a step that it cannot make."""
        self.check_steps(distances)
        columns = np.array(pose)
        for i, name in enumerate(PLACE):
            columns[i] = pose[i] + distances.get(name, 0.0)
        turn_deg = turn_of(distances)
        if turn_deg.any():
            columns[3:] = self.carried(of_rotation_vector(turn_deg), columns[3:])
        return tuple(columns.tolist())

    def carried(self, rotation: FloatArray, orientation: FloatArray) -> FloatArray:
        """Return orientations after rotations about the station's axes; not for flat tasks."""
        raise NotImplementedError

    def is_spin(self, orientation: FloatArray, turn_deg: FloatArray) -> bool:
        """Return whether a rotation vector changes no coordinate of the tool."""
        del orientation, turn_deg
        return False

    def turn_between_deg(self, start: FloatArray, goal: FloatArray) -> FloatArray:
        """Return the shortest rotation between two orientations as a rotation vector; not for flat tasks."""
        raise NotImplementedError

    def turning_deg(self, orientation: FloatArray, derivative: FloatArray) -> FloatArray:
        """Return the angular velocities about the station's axes, of shape (n, 3), from derivatives of orientations.

        Not for flat tasks.
        """
        raise NotImplementedError

    def continued(self, poses: FloatArray) -> FloatArray:
        """Return poses of shape (n, width) with columns that continue without jumps."""
        return poses


def turn_of(distances: Mapping[str, float]) -> FloatArray:
    """Return the steps about the station's axes as one rotation vector, of shape (3,), in degrees."""
    return np.array([distances.get(name, 0.0) for name in _TURNS])


class NoTool(Task):
    """The task of a machine without a tool."""

    name: ClassVar[str] = "none"
    width: ClassVar[int] = 0
    rates: ClassVar[int] = 0
    coordinates: ClassVar[Mapping[str, str]] = {}
    steps: ClassVar[Mapping[str, str]] = coordinates
    keys: ClassVar[tuple[str, ...]] = ()
    _not_told = "this machine has no tool; its joints have positions"


class PositionTask(Task):
    """Task of a tool with a position and a dependent or constant orientation."""

    name: ClassVar[str] = "position"
    width: ClassVar[int] = 3
    rates: ClassVar[int] = 3
    coordinates: ClassVar[Mapping[str, str]] = PLACE
    steps: ClassVar[Mapping[str, str]] = PLACE
    keys: ClassVar[tuple[str, ...]] = ("x_mm", "y_mm", "z_mm")
    _not_told = "the tool of this robot can be told x, y and z alone"


class ScaraTask(Task):
    """Task of a SCARA's tool: a position, and a rotation about the vertical, NaN if it follows from the arm."""

    name: ClassVar[str] = "scara"
    width: ClassVar[int] = 4
    rates: ClassVar[int] = 4
    coordinates: ClassVar[Mapping[str, str]] = {**PLACE, "phi": "deg"}
    steps: ClassVar[Mapping[str, str]] = coordinates
    keys: ClassVar[tuple[str, ...]] = ("x_mm", "y_mm", "z_mm", "attitude_deg")
    _not_told = "the tool of this robot turns about the vertical alone: its orientation is phi, in degrees"

    def off_deg(self, poses: FloatArray, planned: FloatArray) -> FloatArray:
        """Return the differences of phi, with sign."""
        return wrapped_deg(poses[..., 3] - planned[..., 3])

    def words(self, pose: FloatArray | Sequence[float]) -> str:
        """Return a pose as text, without a phi that is NaN because it follows from the arm."""
        attitude = "" if isnan(pose[3]) else f", phi {pose[3]:g} deg"
        return f"{super().words(pose)}{attitude}"

    def continued(self, poses: FloatArray) -> FloatArray:
        """Return poses with phi continuing from one to the next."""
        return np.column_stack([poses[:, :3], np.unwrap(poses[:, 3], period=360.0)])

    def changed(self, pose: Pose, coordinates: Mapping[str, float], orientation: Orientation | None) -> Pose:
        """Return a pose with some of x, y, z and phi changed."""
        self.check(coordinates, orientation)
        return tuple(coordinates.get(name, now) for name, now in zip(self.coordinates, pose, strict=True))

    def stepped(self, pose: Pose, distances: Mapping[str, float]) -> Pose:
        """Return the pose after steps; phi may turn it further than a circle."""
        self.check_steps(distances)
        return tuple(now + distances.get(name, 0.0) for name, now in zip(self.coordinates, pose, strict=True))


class DirectionTask(Task):
    """Task of an arm of five axes: a position, and the tool's direction."""

    name: ClassVar[str] = "direction"
    width: ClassVar[int] = 6
    rates: ClassVar[int] = 6
    coordinates: ClassVar[Mapping[str, str]] = {**PLACE, **COLUMNS[DIRECTION]}
    steps: ClassVar[Mapping[str, str]] = {**PLACE, **_TURNS}
    keys: ClassVar[tuple[str, ...]] = ("x_mm", "y_mm", "z_mm", "direction_x", "direction_y", "direction_z")
    is_flat = False
    key = DIRECTION
    _not_told = "the tool of this robot can be told its direction, such as direction = [0, 0, -1]; its spin follows"

    def off_deg(self, poses: FloatArray, planned: FloatArray) -> FloatArray:
        """Return the angles between the directions."""
        first, second = poses[..., 3:], planned[..., 3:]
        sine = np.linalg.norm(np.cross(first, second), axis=-1)
        return np.asarray(np.rad2deg(np.arctan2(sine, np.sum(first * second, axis=-1))))

    def of_figures(self, figures: FloatArray) -> FloatArray:
        """Return the poses with normalised directions."""
        length = np.linalg.norm(figures[..., 3:], axis=-1, keepdims=True)
        return np.concatenate([figures[..., :3], figures[..., 3:] / length], axis=-1)

    def told(self, figures: Mapping[str, float]) -> tuple[dict[str, float], Orientation | None]:
        """Return the position, and the other coordinates as a direction."""
        return _told(figures, self.key)

    def document(self, pose: FloatArray | Sequence[float]) -> PoseDocument:
        """Return position and direction under the keys of files."""
        columns = np.asarray(pose).tolist()
        return {**dict(zip(self.keys[:3], columns[:3], strict=True)), DIRECTION: columns[3:]}

    def words(self, pose: FloatArray | Sequence[float]) -> str:
        """Return a pose in words."""
        return f"{super().words(pose)}, direction {' '.join(f'{value:g}' for value in pose[3:])}"

    def oriented(self, orientation: Orientation) -> FloatArray:
        """Return the direction; raise InputError for a whole rotation, since the arm cannot choose its spin."""
        if orientation.key != DIRECTION:
            numbers = ", ".join(f"{value:.6g}" for value in (np.round(orientation.direction, 6) + 0.0).tolist())
            raise InputError(
                f"{orientation.key}: the spin of this robot's tool follows from the arm;"
                f" {DIRECTION} = [{numbers}] is where it points"
            )
        return orientation.direction

    def carried(self, rotation: FloatArray, orientation: FloatArray) -> FloatArray:
        """Return the directions after rotations."""
        return turned(orientation, rotation)

    def is_spin(self, orientation: FloatArray, turn_deg: FloatArray) -> bool:
        """Return whether the rotation is about the direction itself, to a millionth."""
        return bool(np.linalg.norm(np.cross(orientation, turn_deg)) <= SPIN_OFF_MAX * np.linalg.norm(turn_deg))

    def turn_between_deg(self, start: FloatArray, goal: FloatArray) -> FloatArray:
        """Return the rotation in the plane of both directions."""
        across = np.cross(start, goal)
        sine = float(np.linalg.norm(across))
        degrees = float(np.rad2deg(np.arctan2(sine, start @ goal)))
        return np.asarray(across / sine * degrees if sine else np.zeros(3) if degrees == 0.0 else [degrees, 0.0, 0.0])

    def turning_deg(self, orientation: FloatArray, derivative: FloatArray) -> FloatArray:
        """Return the angular velocity in the plane of the direction's change."""
        return np.asarray(np.rad2deg(np.cross(orientation, derivative)))


class PoseTask(Task):
    """Task of a tool with any position and orientation."""

    name: ClassVar[str] = "pose"
    width: ClassVar[int] = 7
    rates: ClassVar[int] = 6
    coordinates: ClassVar[Mapping[str, str]] = {**PLACE, **COLUMNS["rpy_deg"]}
    steps: ClassVar[Mapping[str, str]] = {**PLACE, **_TURNS}
    keys: ClassVar[tuple[str, ...]] = ("x_mm", "y_mm", "z_mm", "roll_deg", "pitch_deg", "yaw_deg")
    is_flat = False
    key = "rpy_deg"
    _not_told = "the tool of this robot turns in space: its orientation is rpy_deg = [roll, pitch, yaw] or another key"

    def off_deg(self, poses: FloatArray, planned: FloatArray) -> FloatArray:
        """Return the angles of the single rotations from the planned orientations."""
        return angle_deg(planned[..., 3:], poses[..., 3:])

    def figures(self, poses: FloatArray) -> FloatArray:
        """Return x, y, z and roll, pitch, yaw."""
        return np.concatenate([poses[..., :3], rpy_deg(poses[..., 3:])], axis=-1)

    def of_figures(self, figures: FloatArray) -> FloatArray:
        """Return the poses of x, y, z and roll, pitch, yaw."""
        return np.concatenate([figures[..., :3], of_rpy_deg(figures[..., 3:])], axis=-1)

    def told(self, figures: Mapping[str, float]) -> tuple[dict[str, float], Orientation | None]:
        """Return the position, and roll, pitch and yaw as an orientation."""
        return _told(figures, self.key)

    def document(self, pose: FloatArray | Sequence[float]) -> PoseDocument:
        """Return position, roll, pitch and yaw, and the quaternion with a scalar not below 0."""
        columns = np.asarray(pose)
        quaternion = -columns[3:] if columns[6] < 0.0 else columns[3:]
        return {
            **dict(zip(self.keys[:3], columns[:3].tolist(), strict=True)),
            "rpy_deg": (rpy_deg(quaternion) + 0.0).tolist(),
            "quaternion_xyzw": (quaternion + 0.0).tolist(),
        }

    def words(self, pose: FloatArray | Sequence[float]) -> str:
        """Return a pose in words."""
        turn = np.round(rpy_deg(np.array(pose[3:])), 6) + 0.0
        return f"{super().words(pose)}, rpy {' '.join(f'{value:g}' for value in turn.tolist())} deg"

    def oriented(self, orientation: Orientation) -> FloatArray:
        """Return the rotation; raise InputError for a direction, which leaves the spin open."""
        if orientation.key == DIRECTION:
            raise InputError(f"{DIRECTION}: leaves the spin open; {self._not_told}")
        return orientation.rotation

    def carried(self, rotation: FloatArray, orientation: FloatArray) -> FloatArray:
        """Return the rotations one after the other."""
        return product(rotation, orientation)

    def turn_between_deg(self, start: FloatArray, goal: FloatArray) -> FloatArray:
        """Return the rotation from start to goal."""
        return rotation_vector_deg(product(goal, reversed_rotation(start)))

    def turning_deg(self, orientation: FloatArray, derivative: FloatArray) -> FloatArray:
        """Return the angular velocity: the vector part of 2 q' q*."""
        return np.asarray(np.rad2deg(2.0 * product(derivative, reversed_rotation(orientation))[:, :3]))

    def continued(self, poses: FloatArray) -> FloatArray:
        """Return poses with each quaternion's sign nearer to the one before."""
        turned_back = np.sum(poses[1:, 3:] * poses[:-1, 3:], axis=1) < 0.0
        signs = np.where(np.logical_xor.accumulate([False, *turned_back]), -1.0, 1.0)
        return np.column_stack([poses[:, :3], poses[:, 3:] * signs[:, np.newaxis]])


def _told(figures: Mapping[str, float], key: str) -> tuple[dict[str, float], Orientation]:
    place = {name: figures[name] for name in PLACE}
    return place, Orientation(key, tuple(value for name, value in figures.items() if name not in PLACE))


NO_TOOL: Final = NoTool()
POSITION: Final = PositionTask()
SCARA: Final = ScaraTask()
DIRECTION_TASK: Final = DirectionTask()
POSE: Final = PoseTask()

TASKS: Final[dict[str, Task]] = {task.name: task for task in (SCARA, POSITION, DIRECTION_TASK, POSE, NO_TOOL)}
"""Every task by its name."""


def _task_of(name: str) -> Task:
    return TASKS[name]


@dataclass(frozen=True, slots=True, eq=False)
class Turning:
    """A rotation of the tool at a steady rate about one axis of the station; made by `shortest` or with any angle.

    Attributes:
        task: task of the tool.
        start: orientation at the start, the columns of a pose after x, y and z.
        turn_deg: shape (3,), the whole rotation as a rotation vector.
    """

    task: Task
    start: FloatArray
    turn_deg: FloatArray

    @classmethod
    def shortest(cls, task: Task, start: Pose, goal: Pose) -> "Turning":
        """Return the shortest rotation between two poses; raise InputError if it is ambiguous, at half a turn."""
        first = np.array(start[3:])
        turn = cls(task, first, task.turn_between_deg(first, np.array(goal[3:])))
        if turn.angle_deg > HALF_TURN_DEG:
            raise InputError(
                f"the tool turns by {turn.angle_deg:.6g} deg from {task.words(start)} to {task.words(goal)}: which way"
                " is not certain from 180 deg on; a position in between says it"
            )
        return turn

    @property
    def angle_deg(self) -> float:
        """The whole angle."""
        return float(np.linalg.norm(self.turn_deg))

    def at(self, part: FloatArray) -> FloatArray:
        """Return the orientations at fractions of the rotation of shape (n,), from 0 to 1, shape (n, columns)."""
        if not self.turn_deg.any():
            return np.tile(self.start, (len(part), 1))
        return self.task.carried(of_rotation_vector(part[:, np.newaxis] * self.turn_deg), self.start)
