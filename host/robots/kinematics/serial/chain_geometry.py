"""The kind `chain`: a serial chain of 1 to 8 revolute or prismatic joints, in one of three notations.

modified-dh    theta_deg, alpha_deg, d_mm, a_mm of each joint in J. J. Craig's notation: alpha and a before the joint
standard-dh    the same four parameters with alpha and a behind the joint
urdf           xyz_mm, rpy_deg and axis of each joint: its pose in the frame before it, and its axis in that frame
"""

from collections.abc import Collection
from dataclasses import dataclass, fields
from enum import StrEnum
from functools import lru_cache, partial
from typing import Annotated, Any, Final

import numpy as np

from steptwin.host.common.arrays import FloatArray
from steptwin.host.common.bad_input import unknown
from steptwin.host.common.errors import InputError
from steptwin.host.common.file_models import FileReading, FileTable, read_table, table_schema
from steptwin.host.common.file_values import ReadBy
from steptwin.host.common.findings import UnreadError, check_all, judged
from steptwin.host.robots.joint import Unit
from steptwin.host.robots.kinematics.base import dimension
from steptwin.host.robots.kinematics.dh import Convention, DhParameter, DhRow, DhTable
from steptwin.host.robots.kinematics.serial.rows import FixedFrame, Triple, fixed_rows, rows_around, turned_onto
from steptwin.host.robots.poses import DIRECTION_TASK, POSE, POSITION, Task
from steptwin.host.robots.poses.base_frame import STATION
from steptwin.host.robots.poses.rotations import of_matrix, rpy_deg

JOINTS_MAX: Final = 8
_DECIMALS: Final = 9
AXIS_LEAST: Final = 1e-6
"""Least length of an axis, which is then normalised."""


class Notation(StrEnum):
    """The notation of a chain's joints."""

    MODIFIED_DH = "modified-dh"
    STANDARD_DH = "standard-dh"
    URDF = "urdf"


class ToolTask(StrEnum):
    """Coordinates that can be commanded to a chain's tool; by default the most that its joints allow."""

    POSE = "pose"
    DIRECTION = "direction"
    POSITION = "position"
    BY_JOINTS = "by-joints"


TASKS: Final[dict[ToolTask, tuple[Task, int]]] = {
    ToolTask.POSE: (POSE, 6),
    ToolTask.DIRECTION: (DIRECTION_TASK, 5),
    ToolTask.POSITION: (POSITION, 3),
}
"""Tasks, each with the number of joints that it determines."""


@dataclass(frozen=True, slots=True)
class ChainJoint:
    """A joint of a chain, with the parameters of its notation; those of other notations are 0.

    Attributes:
        slides: True for a sliding joint.
        theta_deg: DH parameter theta, to which a rotary joint adds its position.
        alpha_deg: DH parameter alpha.
        d_mm: DH parameter d, to which a sliding joint adds its position.
        a_mm: DH parameter a.
        xyz_mm: position in the previous frame (urdf).
        rpy_deg: orientation in the previous frame (urdf).
        axis: axis of the joint in this frame, of any length (urdf).
    """

    slides: bool = False
    theta_deg: float = 0.0
    alpha_deg: float = 0.0
    d_mm: float = 0.0
    a_mm: float = 0.0
    xyz_mm: tuple[float, float, float] = (0.0, 0.0, 0.0)
    rpy_deg: tuple[float, float, float] = (0.0, 0.0, 0.0)
    axis: tuple[float, float, float] = (0.0, 0.0, 1.0)

    def __post_init__(self) -> None:
        if not float(np.linalg.norm(self.axis)) >= AXIS_LEAST:
            raise InputError("axis: 0 0 0 is no direction; 0 0 1 is along z")


class _JointTable(FileTable):
    """Base of the tables of a chain's joints in its notations."""

    __slots__ = ()

    @classmethod
    def made_of(cls, values: dict[str, Any], reading: FileReading) -> ChainJoint:
        """Return the joint; raise UnreadError if it is not whole."""
        own: Any = cls
        others = _FIELDS - {field.name for field in fields(own)}
        joint = judged(ChainJoint, {**dict.fromkeys(others), **values}, reading.findings)
        for name in _FIELDS:
            getattr(joint, name)
        return joint


_FIELDS: Final = {field.name for field in fields(ChainJoint)}


@dataclass(frozen=True, slots=True)
class DhJoint(_JointTable):
    """A joint as a row of a DH table.

    Attributes:
        theta_deg: turn about z; the position of a joint that turns is added to it.
        alpha_deg: turn about x, the twist.
        d_mm: shift along z; the position of a joint that slides is added to it.
        a_mm: shift along x, the link's length.
        slides: true for a joint that slides along its axis.
    """

    theta_deg: float
    alpha_deg: float
    d_mm: float
    a_mm: float
    slides: bool = False


@dataclass(frozen=True, slots=True)
class FrameJoint(_JointTable):
    """A joint as a URDF describes it.

    Attributes:
        xyz_mm: its place in the frame before.
        rpy_deg: its roll, pitch and yaw in the frame before.
        axis: its axis in its own frame, of any length.
        slides: true for a joint that slides along its axis.
    """

    xyz_mm: Triple = (0.0, 0.0, 0.0)
    rpy_deg: Triple = (0.0, 0.0, 0.0)
    axis: Triple = (0.0, 0.0, 1.0)
    slides: bool = False


Chain = tuple[tuple[str, ChainJoint], ...]
"""The joints of a chain with their names, from the base to the tool."""


def _read_chain(value: Any, reading: FileReading) -> Chain:
    """Return the joints; their keys are those of the notation beside them."""
    if isinstance(value, tuple):
        return value
    model = FrameJoint if reading.table.get("notation") == Notation.URDF else DhJoint
    named: dict[str, ChainJoint] = read_table(dict[str, model], value, reading)  # type: ignore[valid-type]
    if len(named) < len(value):
        raise UnreadError("chain")
    return tuple(named.items())


def _chain_schema() -> dict[str, Any]:
    joints = [table_schema(model) for model in (DhJoint, FrameJoint)]
    return {"type": "object", "additionalProperties": {"anyOf": joints}}


TOOLS_NAMES: Final = frozenset({"x", "y", "z", "phi", "rx", "ry", "rz", "roll", "pitch", "yaw", "dx", "dy", "dz"})
"""Names of tool coordinates in programs, files and commands, which no joint may have."""


def check_joint_names(key: str, names: Collection[str]) -> None:
    """Raise InputError, under a key of a robot file, for too many joints, or one with the name of a coordinate."""
    if not 1 <= len(names) <= JOINTS_MAX:
        raise InputError(f"{key}: {len(names)} joints, a board drives 1 to {JOINTS_MAX}")
    if taken := [name for name in names if name in TOOLS_NAMES]:
        raise InputError(*(f"{key}.{name}: is the name of a coordinate of the tool; J{name} is free" for name in taken))


_SIX_AXES: Final[dict[str, dict[str, float]]] = {
    "J1": {"theta_deg": 0.0, "alpha_deg": 0.0, "d_mm": 170.0, "a_mm": 0.0},
    "J2": {"theta_deg": -90.0, "alpha_deg": -90.0, "d_mm": 0.0, "a_mm": 60.0},
    "J3": {"theta_deg": 0.0, "alpha_deg": 0.0, "d_mm": 0.0, "a_mm": 300.0},
    "J4": {"theta_deg": 0.0, "alpha_deg": -90.0, "d_mm": 220.0, "a_mm": 0.0},
    "J5": {"theta_deg": 0.0, "alpha_deg": 90.0, "d_mm": 0.0, "a_mm": 0.0},
    "J6": {"theta_deg": 180.0, "alpha_deg": -90.0, "d_mm": 40.0, "a_mm": 0.0},
}
"""A usual six-axis arm, the template of a new robot."""


def usual_arm(joints: int) -> dict[str, Any]:
    """Return the dimensions of an arm with the first 1 to 6 joints of the usual one; the others are fixed at 0.

    Four joints are one more than a position needs: the last one, which turns the tool about itself, is held.
    """
    names, rows = list(_SIX_AXES), list(_SIX_AXES.values())
    rest = (
        DhRow(row["alpha_deg"], row["a_mm"], DhParameter(row["d_mm"]), DhParameter(row["theta_deg"]))
        for row in rows[joints:]
    )
    frame = DhTable(Convention.MODIFIED, tuple(rest)).transforms({})[0]
    tool = {
        "xyz_mm": (np.round(frame[:3, 3], _DECIMALS) + 0.0).tolist(),
        "rpy_deg": (np.round(rpy_deg(of_matrix(frame[:3, :3])), _DECIMALS) + 0.0).tolist(),
    }
    task = next((task for task, (_, least) in TASKS.items() if joints >= least), ToolTask.POSITION)
    return {
        "chain": {name: _SIX_AXES[name] for name in names[:joints]},
        "task": task,
        **({"held": names[3:4]} if joints == 4 else {}),
        **({"tool": tool} if joints < len(names) else {}),
    }


@dataclass(frozen=True, slots=True)
class ChainGeometry(FileTable):
    """Joints of a chain, frames at its ends, and task of its tool; raises InputError if they do not fit."""

    notation: Notation = dimension("modified-dh, standard-dh or urdf", Notation.MODIFIED_DH)
    chain: Annotated[Chain, ReadBy(_read_chain, _chain_schema)] = dimension(
        "the joints from the base to the tool", _SIX_AXES
    )
    task: ToolTask = dimension("what the tool is told: pose, direction or position", ToolTask.POSE, ToolTask.BY_JOINTS)
    held: tuple[str, ...] = dimension("joints that stay where they are when the tool moves", (), ())
    base: FixedFrame = dimension("frame of the first joint in the base", None, FixedFrame())
    tool: FixedFrame = dimension("frame of the tool behind the last joint", None, FixedFrame())

    def __post_init__(self) -> None:
        check_all(partial(check_joint_names, "chain", self.joints), self._check_held, self._check_task)

    def _check_held(self) -> None:
        for name in self.held:
            if name not in self.joints:
                raise unknown("held: joint", name, self.joints)

    def _check_task(self) -> None:
        free, most = [name for name in self.joints if name not in self.held], TASKS[self.tool_task][1]
        if len(free) > most:
            held = ", ".join(f'"{name}"' for name in (*self.held, *free[: len(free) - most]))
            raise InputError(
                f"chain: {len(free)} joints for a {self.tool_task.value} of {most} coordinates: hold {len(free) - most}"
                f" of them where they stand, such as held = [{held}]"
            )

    @property
    def tool_task(self) -> ToolTask:
        """The given task, or the largest one that the joints allow."""
        if self.task is not ToolTask.BY_JOINTS:
            return self.task
        free = len(self.joints) - len(set(self.held))
        return next((task for task, (_, joints) in TASKS.items() if free >= joints), ToolTask.POSITION)

    @property
    def joints(self) -> dict[str, Unit]:
        """The joints' names and units, along the chain."""
        return {name: Unit.MM if joint.slides else Unit.DEG for name, joint in self.chain}

    @property
    def dh(self) -> DhTable:
        """The DH table; for a DH notation with the written rows, and further rows for base and tool."""
        if self.notation is Notation.URDF:
            return DhTable(Convention.MODIFIED, tuple(self._rows_of_frames()))
        convention = Convention.MODIFIED if self.notation is Notation.MODIFIED_DH else Convention.STANDARD
        rows = (_dh_row(name, joint) for name, joint in self.chain)
        ends = (tuple(fixed_rows(frame.matrix, convention)) for frame in (self.base, self.tool))
        before, behind = ends
        return DhTable(convention, (*before, *rows, *behind))

    def _rows_of_frames(self) -> tuple[DhRow, ...]:
        fixed, since = [], self.base.matrix
        for _, joint in self.chain:
            onto = turned_onto(np.array(joint.axis) / np.linalg.norm(joint.axis))
            fixed.append(since @ FixedFrame(joint.xyz_mm, joint.rpy_deg).matrix @ onto)
            since = onto.T
        fixed.append(since @ self.tool.matrix)
        return tuple(rows_around(fixed, {name: joint.slides for name, joint in self.chain}))


def _dh_row(name: str, joint: ChainJoint) -> DhRow:
    d_mm = DhParameter(joint.d_mm, name if joint.slides else "")
    theta_deg = DhParameter(joint.theta_deg, "" if joint.slides else name)
    return DhRow(joint.alpha_deg, joint.a_mm, d_mm, theta_deg)


@dataclass(frozen=True, slots=True, eq=False)
class ArmAxes:
    """The axes of a chain's joints with all joints at 0.

    Attributes:
        directions: shape (joints, 3), unit vectors.
        points_mm: shape (joints, 3), a point on each axis.
        slides: True for each sliding joint.
        home_mm: shape (3,), position of the tool.
        home_rotation: shape (3, 3), axes of the tool as columns.
    """

    directions: FloatArray
    points_mm: FloatArray
    slides: tuple[bool, ...]
    home_mm: FloatArray
    home_rotation: FloatArray


@lru_cache(maxsize=16)
def axes_of(table: DhTable, joints: tuple[str, ...]) -> ArmAxes:
    """Return the axes of a DH table whose variables are among the joints, in the joints' order."""
    at_zero = {name: np.zeros(1) for name in joints}
    frames = DhTable(table.convention, table.rows, STATION).frames(at_zero)[:, 0]
    behind = table.convention is Convention.MODIFIED  # in a modified row the joint turns about the z axis after the row
    found: dict[str, tuple[FloatArray, FloatArray, bool]] = {}
    for i, row in enumerate(table.rows):
        frame = frames[i + behind]
        for parameter, slides in ((row.theta_deg, False), (row.d_mm, True)):
            if parameter.variable:
                found[parameter.variable] = parameter.sign * frame[:3, 2], frame[:3, 3], slides
    axes, tool = [found[name] for name in joints], frames[-1]
    directions, points_mm = (np.array([axis[i] for axis in axes]) for i in (0, 1))
    return ArmAxes(directions, points_mm, tuple(axis[2] for axis in axes), tool[:3, 3], tool[:3, :3])
