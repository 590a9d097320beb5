"""The interface of all kinematics, their inverse solutions, and the constraints of these.

Joints are arrays of shape (n, joints) in the robot's order, in mm and degrees. Poses are arrays of shape (n,
task.width) in the frame of the station, in which the robot's base has a position. The task of the mechanism's tool
defines the columns of poses.
"""

from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import MISSING, Field, dataclass, field, fields
from typing import Any, Final, Protocol, Self, TypeVar

import numpy as np

from steptwin.host.common.arrays import BoolArray, FloatArray
from steptwin.host.common.bad_input import by, nearest, outside, prefixed, shortened
from steptwin.host.common.errors import InputError
from steptwin.host.common.file_models import read_model
from steptwin.host.common.findings import Findings
from steptwin.host.robots.joint import Joint, Unit
from steptwin.host.robots.kinematics.dh import DhTable
from steptwin.host.robots.kinematics.links import ArmPart
from steptwin.host.robots.poses import Task
from steptwin.host.robots.poses.base_frame import BaseFrame
from steptwin.host.robots.robot import Dimension, Robot


def dimension(meaning: str, usual: object, default: object = MISSING) -> Any:
    """Return a dataclass field; `usual` is the value in a new robot file, `default` the value if the key is missing."""
    metadata = {"meaning": meaning, "usual": usual}
    return field(metadata=metadata) if default is MISSING else field(default=default, metadata=metadata)


def dimensions(geometry: type[Any]) -> dict[str, Field[Any]]:
    """Return the dimensions of a mechanism's dataclass by name."""
    return {dimension.name: dimension for dimension in fields(geometry)}


def meaning(dimension: Field[Any]) -> str:
    """Return the description of a dimension."""
    return str(dimension.metadata["meaning"])


Geometry = TypeVar("Geometry")

LIMIT_TOLERANCE: Final = 1e-9
"""Distance in mm or degrees by which a solution may exceed a joint's limit because of rounding errors."""


@dataclass(frozen=True, slots=True, eq=False)
class Constraint:
    """A quantity that must stay between two limits, at each of n poses.

    Attributes:
        quantity: name of the quantity, which begins a message.
        unit: unit of the values and limits; empty for a plain number.
        values: shape (n,).
        lower: lower limit.
        upper: upper limit.
        kept: shape (n,), true where the value is between the limits; false for NaN.
        explain: function that returns the message about pose i, for a quantity whose values would not help a user.
    """

    quantity: str
    unit: str
    values: FloatArray
    lower: float
    upper: float
    kept: BoolArray
    explain: Callable[[int], str] | None = None

    def complaint(self, i: int, *, of_path: bool = False) -> str:
        """Return one line about the violation of this constraint at pose i, and its amount.

        With `of_path` the poses are a path, and the amount is the one that the whole path needs.
        """
        if self.explain:
            return self.explain(i)
        value = float(self.values[i])
        text = f"{self.quantity} {outside(value, self.lower, self.upper, self.unit)}"
        if not self.unit:
            return text
        values = self.values if of_path else self.values[i : i + 1]
        distance = float(np.fmax(self.lower - values, values - self.upper).max())
        return f"{text}, by {'up to ' * of_path}{by(distance, self.unit)}"


@dataclass(frozen=True, slots=True, eq=False)
class Branch:
    """One branch of the inverse kinematics at n poses.

    Attributes:
        name: name of the branch, such as `right`.
        joints: shape (n, joints), beyond their limits if the pose requires it, NaN if the pose is out of reach.
        mechanism: constraints of the mechanism.
        limits: constraints of the joints' limits.
        changes: changes of the branch along a path: index of the first pose on it, and its name.
    """

    name: str
    joints: FloatArray
    mechanism: tuple[Constraint, ...]
    limits: tuple[Constraint, ...]
    changes: tuple[tuple[int, str], ...] = ()

    @property
    def constraints(self) -> tuple[Constraint, ...]:
        """All constraints; the first violated one is the reason why a pose is not reachable."""
        return self.mechanism + self.limits

    @property
    def reachable(self) -> BoolArray:
        """Shape (n,), true for poses that keep all constraints."""
        reachable: BoolArray = np.logical_and.reduce([constraint.kept for constraint in self.constraints])
        return reachable

    def reachable_but_for(self, column: int) -> BoolArray:
        """Return, of shape (n,), whether poses keep all constraints, ignoring the limits of one joint."""
        others = (*self.mechanism, *self.limits[:column], *self.limits[column + 1 :])
        reachable: BoolArray = np.logical_and.reduce([constraint.kept for constraint in others])
        return reachable

    def reason(self, i: int) -> str | None:
        """Return the reason why pose i is not reachable; None if it is."""
        complaints = (constraint.complaint(i) for constraint in self.constraints if not constraint.kept[i])
        return next(complaints, None)


class Kinematics(Protocol):
    """A mechanism's kinematics, vectorised over poses."""

    @property
    def task(self) -> Task:
        """Coordinates that can be commanded to the tool, which are the columns of poses."""
        ...

    def on(self, base: BaseFrame) -> Self:
        """Return the mechanism with its base at a position in the station."""
        ...

    @property
    def branches(self) -> tuple[str, ...]:
        """Names of the branches of the inverse kinematics, the usual one first."""
        ...

    @property
    def dh(self) -> DhTable:
        """The mechanism as a DH table from the base to the tool, with the base's position in the station."""
        ...

    @property
    def slides(self) -> tuple[tuple[int, int], ...]:
        """Columns of the joints that shift the whole arm, with the coordinate of the base's frame: 0 (x) or 2 (z)."""
        ...

    @property
    def attitude_follows(self) -> bool:
        """True if a SCARA's tool has no own rotation: phi is determined by the rest of the pose and the branch.

        The inverse then accepts NaN as attitude; a pose with any other attitude is not reachable.
        """
        ...

    @property
    def turning(self) -> int | None:
        """Column of the joint that alone changes the attitude of the tool.

        None if other joints also change with the attitude, for example because the tool is beside the wrist's axis, or
        if the tool cannot turn.
        """
        ...

    def dh_variables(self, joints: FloatArray) -> dict[str, FloatArray]:
        """Return the variables of the DH table, each of shape (n,), for joints of shape (n, joints)."""
        ...

    def forward(self, joints: FloatArray) -> FloatArray:
        """Return poses for joints of shape (n, joints); the joints' limits are not checked."""
        ...

    def axis_mm(self, joints: FloatArray) -> tuple[float, float]:
        """Return x and y of the arm's first axis, the centre of radii, at joints of shape (joints,)."""
        ...

    def links(self, joints: FloatArray) -> tuple[ArmPart, ...]:
        """Return the parts to draw for joints of shape (n, joints), from the base to the tool.

        The last point of the last part is the tip of the tool, as from `forward`.
        """
        ...

    def inverse(self, poses: FloatArray, near: FloatArray | None = None) -> tuple[Branch, ...]:
        """Return all branches for poses of shape (n, task.width).

        `near`, of shape (joints,) or (n, joints), is the machine's position, by default 0. Joints that the pose does
        not determine keep this position, and joints with a range above 360 degrees use the nearest turn.
        """
        ...

    def solve(self, poses: FloatArray, branch: str, near: FloatArray | None = None) -> Branch:
        """Return one branch by its name; otherwise like `inverse`."""
        ...

    def along(self, poses: FloatArray, branch: str, near: FloatArray) -> Branch:
        """Return the joints along a path of poses, which begins near joints of shape (joints,) on a branch.

        A mechanism that keeps its branch stays on it; another one uses the branch nearest to its last position.
        """
        ...

    def at(self, poses: FloatArray, branch: str, near: FloatArray, guides: FloatArray) -> FloatArray:
        """Return joints of shape (n, joints) at poses of such a path, near `guides` of that shape, except for turns."""
        ...

    @property
    def has_closed_form(self) -> bool:
        """True if the inverse is fast (many thousands of poses per second) and returns all branches."""
        ...

    @property
    def inverse_words(self) -> str:
        """Description of the inverse method; empty if the kind implies it."""
        ...

    @property
    def keeps_branch(self) -> bool:
        """True if the branch never changes along a path."""
        ...

    def near_what(self, joints: FloatArray) -> str:
        """Return the name of a singularity near joints of shape (joints,), or an empty text."""
        ...

    def singularities(self, joints: FloatArray) -> tuple[Constraint, ...]:
        """Return measures, from 0 to 1, that must stay away from 0, where the Jacobian is singular."""
        ...

    def joint_velocities(self, joints: FloatArray, tool_velocities: FloatArray) -> FloatArray:
        """Return joint velocities of shape (n, joints), in mm/s and degrees/s, for velocities of the tool.

        Tool velocities have the shape (n, task.rates). Joints that the pose does not determine have velocity 0. At a
        singular pose the result is not finite.
        """
        ...


class KeepsBranch(ABC):
    """Common part of Kinematics for mechanisms whose branches are continuous functions of the pose."""

    __slots__ = ()

    @abstractmethod
    def solve(self, poses: FloatArray, branch: str, near: FloatArray | None = None) -> Branch:
        """Return one branch, by its name, for poses of shape (n, task.width)."""

    @property
    def has_closed_form(self) -> bool:
        """True."""
        return True

    @property
    def inverse_words(self) -> str:
        """Empty: the kind implies it."""
        return ""

    @property
    def keeps_branch(self) -> bool:
        """True: the joints of a branch are continuous functions of the pose."""
        return True

    def near_what(self, joints: FloatArray) -> str:
        """Return an empty text: there is no singularity, or paths near it have been refused before."""
        del joints
        return ""

    def along(self, poses: FloatArray, branch: str, near: FloatArray) -> Branch:
        """Return the joints along a path of poses, all on one branch."""
        return self.solve(poses, branch, near)

    def at(self, poses: FloatArray, branch: str, near: FloatArray, guides: FloatArray) -> FloatArray:
        """Return the joints at some poses of a path, all on one branch."""
        del guides
        return self.solve(poses, branch, near).joints


def within_limits(limits: tuple[Joint, ...], joints: FloatArray) -> BoolArray:
    """Return, of shape (n,), whether joints of shape (n, joints) keep all their limits."""
    kept: BoolArray = np.logical_and.reduce([constraint.kept for constraint in joint_constraints(limits, joints)])
    return kept


def joint_constraints(limits: tuple[Joint, ...], joints: FloatArray) -> tuple[Constraint, ...]:
    """Return the joints' limits as constraints on positions of shape (n, joints)."""
    return tuple(_joint_constraint(joint, joints[:, axis]) for axis, joint in enumerate(limits))


def nearest_turns(limits: tuple[Joint, ...], joints: FloatArray, near: FloatArray | None) -> None:
    """Shift rotary joints, in place, by full turns to the position within the limits nearest to `near` or 0.

    A joint with a range of less than one turn does not change.
    """
    for axis, joint in enumerate(limits):
        if joint.unit is not Unit.DEG or (joint.lower >= -180.0 and joint.upper <= 180.0):
            continue
        angle_deg = joints[:, axis]
        fewest = np.ceil((joint.lower - LIMIT_TOLERANCE - angle_deg) / 360.0)
        most = np.floor((joint.upper + LIMIT_TOLERANCE - angle_deg) / 360.0)
        wanted = np.round(((0.0 if near is None else near[..., axis]) - angle_deg) / 360.0)
        joints[:, axis] += 360.0 * np.where(fewest <= most, np.clip(wanted, fewest, most), 0.0)


def _joint_constraint(joint: Joint, positions: FloatArray) -> Constraint:
    kept = (positions >= joint.lower - LIMIT_TOLERANCE) & (positions <= joint.upper + LIMIT_TOLERANCE)
    return Constraint(f"{joint.name}:", joint.unit, positions, joint.lower, joint.upper, kept)


def read_geometry(geometry: type[Geometry], robot: Robot) -> Geometry:
    """Return a mechanism's dimensions; raise InputError if the robot's do not fit."""
    return geometry_of(geometry, robot.geometry)


def geometry_of(geometry: type[Geometry], dimensions: Mapping[str, Dimension]) -> Geometry:
    """Return dimensions as the mechanism's dataclass, a `FileTable`; raise InputError if they do not fit."""
    findings = Findings()
    made = read_model(geometry, dict(dimensions), findings)
    with prefixed("kinematics."):
        findings.raise_first()
    return made


def require_joints(robot: Robot, expected: Mapping[str, Unit]) -> None:
    """Raise InputError, with all errors, if the robot's joints are not those of the mechanism, in its order."""
    check_names(robot.kinematics, robot.joint_names, expected)
    findings = Findings()
    for joint in robot.joints:
        with findings.collecting(f"joints.{joint.name}."):
            check_unit(joint.unit, expected[joint.name])
    findings.raise_first()


def check_names(kind: str, names: Sequence[str], expected: Iterable[str]) -> None:
    """Raise InputError, with all errors, if the joints' names are not those of the kind, in its order."""
    expected = tuple(expected)
    right, missing = " ".join(expected), [name for name in expected if name not in names]
    messages = [_strange_text(kind, name, expected, missing) for name in names if name not in expected]
    messages += [f"joints.{name}: is missing: the joints of this {kind!r} are {right}" for name in missing]
    if not messages and tuple(names) != expected:
        messages = [f"joints: {' '.join(names)} is not the order of the joints of this {kind!r}: {right}"]
    if messages:
        raise InputError(*messages)


def _strange_text(kind: str, name: str, expected: Sequence[str], missing: list[str]) -> str:
    near = missing if len(missing) == 1 else nearest(name, missing)
    known = f"did you mean {' or '.join(near)}?" if near else f"there are {', '.join(expected)}"
    return f"joints.{shortened(name)}: this {kind!r} has no such joint: {known}"


def check_unit(unit: Unit, expected: Unit) -> None:
    """Raise InputError if a joint's unit is not the kind's."""
    if unit is not expected:
        raise InputError(f"unit: {unit.value!r} is not the unit of this joint: it is {expected.value!r}")


def tool_places_mm(kinematics: Kinematics, joints: FloatArray) -> FloatArray:
    """Return the position of the tool, of shape (n, 3), for joints of shape (n, joints); of the base without a tool.

    So paths, pictures and boxes that follow the tool need no special case.
    """
    if kinematics.task.width:
        return kinematics.forward(joints)[:, :3]
    return np.tile(np.array([*kinematics.axis_mm(joints[0]), 0.0]), (len(joints), 1))


def tool_frames(kinematics: Kinematics, joints: FloatArray) -> FloatArray:
    """Return the tool's homogeneous transforms in the station, shape (n, 4, 4), for joints of shape (n, joints).

    The columns are n, o and a (the tool's x, y and z axes) and p (its position). They are the product of the DH table's
    links (`dh`), and NaN if the mechanism cannot be assembled.
    """
    return kinematics.dh.transforms(kinematics.dh_variables(joints))


def link_frames(kinematics: Kinematics, joints: FloatArray) -> FloatArray:
    """Return the transform of each row of the DH table relative to the previous row, shape (rows, n, 4, 4)."""
    table, variables = kinematics.dh, kinematics.dh_variables(joints)
    return np.stack([DhTable(table.convention, (row,)).transforms(variables) for row in table.rows])
