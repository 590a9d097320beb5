"""The kind `axes`: 1 to 8 joints without a tool, such as turntables, sliders, conveyors and test benches.

The joints have positions, but there is no pose: they cannot follow a path of a tool.
"""

from dataclasses import dataclass, replace
from typing import Final, NoReturn, Self

import numpy as np

from steptwin.host.common.arrays import FloatArray
from steptwin.host.common.errors import InputError
from steptwin.host.common.file_models import FileTable
from steptwin.host.robots.joint import Joint, Unit
from steptwin.host.robots.kinematics.base import Branch, Constraint, KeepsBranch, read_geometry
from steptwin.host.robots.kinematics.dh import Convention, DhTable
from steptwin.host.robots.kinematics.links import ArmPart, Role, line, point
from steptwin.host.robots.kinematics.serial.chain_geometry import check_joint_names
from steptwin.host.robots.poses import NO_TOOL, Task
from steptwin.host.robots.poses.base_frame import STATION, BaseFrame
from steptwin.host.robots.robot import Robot

_RADIUS_MM: Final = 100.0
"""Drawn length of a turntable's pointer. (A robot file does not describe the look of a machine.)"""
_APART_MM: Final = 250.0
"""Drawn distance between two joints, along y."""


@dataclass(frozen=True, slots=True)
class AxesGeometry(FileTable):
    """Geometry without dimensions: the joints are those of the robot file, independent of each other."""

    @property
    def joints(self) -> dict[str, Unit]:
        """No joints that the kind requires."""
        return {}

    @property
    def dh(self) -> DhTable:
        """A table without rows."""
        return DhTable(Convention.MODIFIED, ())


@dataclass(frozen=True, slots=True, eq=False)
class BareAxes(KeepsBranch):
    """The kinematics of joints without a tool; implements Kinematics.

    Attributes:
        name: name of the robot, for messages.
        limits: the joints in axis order.
        dh: a table without rows.
        base: position of the machine in the station, for pictures.
    """

    name: str
    limits: tuple[Joint, ...]
    dh: DhTable
    base: BaseFrame = STATION

    def on(self, base: BaseFrame) -> Self:
        """Return the machine at a position in the station."""
        return replace(self, base=base)

    @property
    def task(self) -> Task:
        """The task without coordinates."""
        return NO_TOOL

    @property
    def branches(self) -> tuple[str, ...]:
        """No branches."""
        return ()

    @property
    def slides(self) -> tuple[tuple[int, int], ...]:
        """No joint shifts an arm."""
        return ()

    @property
    def attitude_follows(self) -> bool:
        """False: there is no attitude."""
        return False

    @property
    def turning(self) -> None:
        """No joint turns a tool."""
        return None

    @property
    def has_closed_form(self) -> bool:
        """False: there is no inverse."""
        return False

    def dh_variables(self, joints: FloatArray) -> dict[str, FloatArray]:
        """Return nothing."""
        del joints
        return {}

    def forward(self, joints: FloatArray) -> FloatArray:
        """Return poses without columns, shape (n, 0)."""
        return np.empty((len(joints), 0))

    def axis_mm(self, joints: FloatArray) -> tuple[float, float]:
        """Return x and y of the base's origin."""
        del joints
        return self.base.x_mm, self.base.y_mm

    def links(self, joints: FloatArray) -> tuple[ArmPart, ...]:
        """Return a rail with its slide, or a post with its pointer, for each joint, side by side."""
        parts: list[ArmPart] = []
        for column, joint in enumerate(self.limits):
            y_mm, at = column * _APART_MM, joints[:, column]
            if joint.unit is Unit.MM:
                place = point(at, y_mm, 0.0)
                ends = (point(np.full(len(at), end), y_mm, 0.0) for end in (joint.lower, joint.upper))
                parts.append(line(f"rail {joint.name}", Role.GUIDE, *ends))
                parts.append(line(f"slide {joint.name}", Role.SLIDE, place, place + point(0.0, 0.0, _RADIUS_MM / 2)))
            else:
                foot, top = (point(np.zeros(len(at)), y_mm, z_mm) for z_mm in (0.0, _RADIUS_MM / 2))
                ahead = _RADIUS_MM * point(np.cos(np.deg2rad(at)), np.sin(np.deg2rad(at)), 0.0)
                parts.append(line(f"post {joint.name}", Role.GUIDE, foot, top))
                parts.append(line(f"pointer {joint.name}", Role.LINK, top, top + ahead))
        return tuple(replace(part, points_mm=self.base.in_station(part.points_mm)) for part in parts)

    def _refused(self) -> NoReturn:
        raise InputError(f"{self.name} has no tool: its joints have positions, but no pose")

    def inverse(self, poses: FloatArray, near: FloatArray | None = None) -> tuple[Branch, ...]:
        """Raise InputError: there is no tool."""
        del poses, near
        self._refused()

    def solve(self, poses: FloatArray, branch: str, near: FloatArray | None = None) -> Branch:
        """Raise InputError: there is no tool."""
        del poses, branch, near
        self._refused()

    def joint_velocities(self, joints: FloatArray, tool_velocities: FloatArray) -> FloatArray:
        """Raise InputError: there is no tool."""
        del joints, tool_velocities
        self._refused()

    def singularities(self, joints: FloatArray) -> tuple[Constraint, ...]:
        """Return none."""
        del joints
        return ()


def bare_axes(robot: Robot) -> BareAxes:
    """Return a robot's kinematics; raise InputError for joints with names of the tool's coordinates."""
    geometry = read_geometry(AxesGeometry, robot)
    check_joint_names("joints", robot.joint_names)
    return BareAxes(robot.name, robot.joints, geometry.dh)
