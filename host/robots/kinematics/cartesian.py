"""The kind `cartesian`: a gantry with a slide for each of x, y and z that it has, and perhaps a rotary axis c about z.

    x = X        y = Y        z = Z        phi = C

The joints have the letters of G-code. A coordinate without a slide is 0 in the frame of the base. Belts that move two
slides by two motors, as CoreXY and H-bot have them, are a [coupling] of the axes and change nothing here.
"""

from dataclasses import dataclass, replace
from functools import partial
from itertools import pairwise
from typing import Final, Self

import numpy as np

from steptwin.host.common.arrays import FloatArray
from steptwin.host.common.errors import InputError
from steptwin.host.common.file_models import FileTable
from steptwin.host.common.findings import check_all
from steptwin.host.robots.joint import Joint, Unit
from steptwin.host.robots.kinematics.base import (
    Branch,
    Constraint,
    KeepsBranch,
    dimension,
    joint_constraints,
    nearest_turns,
    read_geometry,
    require_joints,
)
from steptwin.host.robots.kinematics.dh import Convention, DhTable
from steptwin.host.robots.kinematics.links import ArmPart, Role, line, point
from steptwin.host.robots.kinematics.serial.rows import rows_around, turned_onto
from steptwin.host.robots.poses import POSITION, SCARA, Task
from steptwin.host.robots.poses.base_frame import STATION, BaseFrame
from steptwin.host.robots.poses.rotations import wrapped_deg
from steptwin.host.robots.robot import Robot

LETTERS: Final = "XYZC"
ONLY: Final = "only"
"""The name of the one branch."""
FOLLOWING_MM: Final = 1e-3
"""Distance by which a coordinate without a slide may differ from 0."""
_HAND_PART: Final = 0.08
"""Drawn length of the tool's direction, as a fraction of the gantry's size."""


@dataclass(frozen=True, slots=True)
class CartesianGeometry(FileTable):
    """The axes of a gantry; raises InputError for invalid or repeated letters."""

    axes: str = dimension("the axes in their order: letters of X, Y, Z and C, which turns the tool", "XYZ", "XYZ")

    def __post_init__(self) -> None:
        check_all(partial(self._check_letters))

    def _check_letters(self) -> None:
        strange = [letter for letter in self.axes if letter not in LETTERS]
        if strange or not 1 <= len(self.axes) == len(set(self.axes)) or self.axes == "C":
            raise InputError(f"axes: {self.axes!r} is not 1 to 4 of the letters X, Y, Z and C, each once, with a slide")

    @property
    def joints(self) -> dict[str, Unit]:
        """The joints' names and units, in the order of their axes."""
        return {letter: Unit.DEG if letter == "C" else Unit.MM for letter in self.axes}

    @property
    def dh(self) -> DhTable:
        """DH table of the slides in series, followed by the rotary axis."""
        chain = sorted(self.axes, key=LETTERS.index)
        onto = [turned_onto(np.eye(3)[min(LETTERS.index(letter), 2)]) for letter in chain]
        between = [before.T @ behind for before, behind in pairwise(onto)]
        fixed = [onto[0], *between, onto[-1].T]
        return DhTable(Convention.MODIFIED, tuple(rows_around(fixed, {name: name != "C" for name in chain})))


@dataclass(frozen=True, slots=True, eq=False)
class Gantry(KeepsBranch):
    """The kinematics of a gantry; implements Kinematics.

    Attributes:
        limits: joints in axis order; their limits determine only whether a pose is reachable.
        axes: letters of the joints.
        dh: the slides as a DH table.
        base: position of the base in the station.
    """

    limits: tuple[Joint, ...]
    axes: str
    dh: DhTable
    base: BaseFrame = STATION

    def on(self, base: BaseFrame) -> Self:
        """Return the gantry with its base at a place in the station."""
        return replace(self, base=base, dh=replace(self.dh, base=base))

    @property
    def task(self) -> Task:
        """A position, with phi if the tool turns."""
        return SCARA if "C" in self.axes else POSITION

    @property
    def branches(self) -> tuple[str, ...]:
        """One: a pose has one position of the slides."""
        return (ONLY,)

    @property
    def slides(self) -> tuple[tuple[int, int], ...]:
        """No joint shifts an arm."""
        return ()

    @property
    def attitude_follows(self) -> bool:
        """False: a tool that does not turn has no attitude in its task."""
        return False

    @property
    def turning(self) -> int | None:
        """The rotary axis."""
        return self.axes.index("C") if "C" in self.axes else None

    def dh_variables(self, joints: FloatArray) -> dict[str, FloatArray]:
        """Return the joints by their names."""
        return {letter: joints[:, column] for column, letter in enumerate(self.axes)}

    @property
    def _columns(self) -> list[tuple[int, int]]:
        """The column of each slide, and the coordinate that it moves."""
        return [(column, LETTERS.index(letter)) for column, letter in enumerate(self.axes) if letter != "C"]

    def forward(self, joints: FloatArray) -> FloatArray:
        """Return poses of shape (n, task.width) for joints of shape (n, joints)."""
        place = np.zeros((len(joints), 3))
        for column, coordinate in self._columns:
            place[:, coordinate] = joints[:, column]
        place = self.base.in_station(place)
        if self.turning is None:
            return place
        return np.column_stack([place, wrapped_deg(joints[:, self.turning] + self.base.phi_deg)])

    def axis_mm(self, joints: FloatArray) -> tuple[float, float]:
        """Return x and y of the base's origin."""
        del joints
        return self.base.x_mm, self.base.y_mm

    def inverse(self, poses: FloatArray, near: FloatArray | None = None) -> tuple[Branch, ...]:
        """Return the one branch for poses of shape (n, task.width)."""
        return (self.solve(poses, ONLY, near),)

    def solve(self, poses: FloatArray, branch: str, near: FloatArray | None = None) -> Branch:
        """Return the one branch; C is in the turn within its limits nearest to `near`."""
        place = (poses[:, :3] - np.array([self.base.x_mm, self.base.y_mm, self.base.z_mm])) @ self._turn
        joints = np.empty((len(poses), len(self.axes)))
        for column, coordinate in self._columns:
            joints[:, column] = place[:, coordinate]
        if self.turning is not None:
            joints[:, self.turning] = wrapped_deg(poses[:, 3] - self.base.phi_deg)
        nearest_turns(self.limits, joints, near)
        missing = [coordinate for coordinate, letter in enumerate("XYZ") if letter not in self.axes]
        mechanism = tuple(_without_slide("xyz"[coordinate], place[:, coordinate]) for coordinate in missing)
        return Branch(branch, joints, mechanism or (_always(len(poses)),), joint_constraints(self.limits, joints))

    @property
    def _turn(self) -> FloatArray:
        return self.base.matrix[:3, :3]

    def singularities(self, joints: FloatArray) -> tuple[Constraint, ...]:
        """Return none."""
        del joints
        return ()

    def joint_velocities(self, joints: FloatArray, tool_velocities: FloatArray) -> FloatArray:
        """Return joint velocities for tool velocities of shape (n, task.rates)."""
        along = tool_velocities[:, :3] @ self._turn
        velocities = np.zeros_like(joints)
        for column, coordinate in self._columns:
            velocities[:, column] = along[:, coordinate]
        if self.turning is not None:
            velocities[:, self.turning] = tool_velocities[:, 3]
        return velocities

    def links(self, joints: FloatArray) -> tuple[ArmPart, ...]:
        """Return the beam of each slide at its present position, and the tool down to its tip."""
        at = [np.zeros(len(joints)) for _ in range(3)]
        ends = [(0.0, 0.0)] * 3
        for column, coordinate in self._columns:
            ends[coordinate] = self.limits[column].lower, self.limits[column].upper
        size_mm = max(high - low for low, high in ends)
        at[2] = at[2] + ends[2][1]  # beams lie at the height of the raised tool
        parts: list[ArmPart] = []
        for column, coordinate in self._columns:
            first, last = (point(*at), point(*at))
            first[:, coordinate], last[:, coordinate] = ends[coordinate]
            at[coordinate] = joints[:, column]
            role = Role.LINK if parts else Role.GUIDE  # what the first slide carries moves
            parts.append(line(f"beam {self.axes[column]}", role, first, last))
        tip = point(*at)
        turn_rad = np.deg2rad(joints[:, self.turning]) if self.turning is not None else np.zeros(len(joints))
        ahead = _HAND_PART * size_mm * point(np.cos(turn_rad), np.sin(turn_rad), 0.0)
        above = tip + point(0.0, 0.0, _HAND_PART * size_mm)
        hand = [line("hand", Role.HAND, tip, tip + ahead)] if self.turning is not None else []
        parts += [*hand, line("tool", Role.TOOL, above, tip)]
        return tuple(replace(part, points_mm=self.base.in_station(part.points_mm)) for part in parts)


def _without_slide(name: str, values: FloatArray) -> Constraint:
    """Return the constraint that a coordinate without a slide is 0."""

    def explain(i: int) -> str:
        return f"{name} {values[i]:.4f} mm in the base's frame: the tool has no slide along {name}, it is at 0 there"

    return Constraint(name, "mm", values, -FOLLOWING_MM, FOLLOWING_MM, np.abs(values) <= FOLLOWING_MM, explain)


def _always(count: int) -> Constraint:
    """Return a constraint that every pose keeps."""
    return Constraint("gantry", "", np.zeros(count), 0.0, 0.0, np.ones(count, np.bool_))


def gantry(robot: Robot) -> Gantry:
    """Return a robot's kinematics; raise InputError if its axes or joints are not this mechanism's."""
    geometry = read_geometry(CartesianGeometry, robot)
    require_joints(robot, geometry.joints)
    return Gantry(robot.joints, geometry.axes, geometry.dh)
