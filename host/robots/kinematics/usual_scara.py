"""The kind `scara`: usual SCARAs with options: lift first, last or none; tool that turns or not, up or down.

The joints are numbered along the chain and named d for a lift, th for a rotary joint, as in textbooks:


    lift first    d1 th2 th3 th4        lift last    th1 th2 d3 th4        no lift    th1 th2 th3

The last one is missing if the tool does not turn. The DH tables follow J. J. Craig, "Introduction to Robotics",
section 3.4; a tool that points down is turned by 180 degrees about x, after which its joint counts the other way.
"""

from dataclasses import dataclass
from enum import StrEnum
from functools import partial
from typing import Final

from steptwin.host.common.errors import InputError
from steptwin.host.common.file_models import FileTable
from steptwin.host.common.file_values import Positive, check_limits
from steptwin.host.common.findings import check_all
from steptwin.host.robots.joint import Unit
from steptwin.host.robots.kinematics.base import dimension, read_geometry, require_joints
from steptwin.host.robots.kinematics.dh import Convention, DhParameter, DhRow, DhTable
from steptwin.host.robots.kinematics.scara import Planar2R, Scara
from steptwin.host.robots.robot import Robot


class Lift(StrEnum):
    """Position of the lift in the chain."""

    FIRST = "first"
    LAST = "last"
    NONE = "none"


class Vertical(StrEnum):
    """A direction along the vertical."""

    UP = "up"
    DOWN = "down"


@dataclass(frozen=True, slots=True)
class ScaraGeometry(FileTable):
    """Options and dimensions of a usual SCARA; raises InputError for impossible dimensions."""

    l1_mm: Positive = dimension("first link, from shoulder to elbow", 200.0)
    l2_mm: Positive = dimension("second link, from elbow to wrist", 150.0)
    lift: Lift = dimension("place of the lift in the chain: first, last or none", Lift.LAST, Lift.LAST)
    lift_positive: Vertical = dimension("direction in which the lift counts: up or down", Vertical.DOWN, Vertical.UP)
    tool_rotation: bool = dimension("true if the tool turns about the vertical", True, True)
    tool: Vertical = dimension("direction in which the tool points: up or down", Vertical.DOWN, Vertical.DOWN)
    heading_deg: float = dimension("direction of the stretched arm with all joints at 0, from the x axis", 0.0, 0.0)
    base_mm: float = dimension("height of the first link above z = 0, with the lift at 0", 0.0, 0.0)
    offset_mm: float = dimension("height of the second link above the first, negative below it", 0.0, 0.0)
    drop_mm: float = dimension("tip of the tool below the second link, negative above it", 0.0, 0.0)
    tool_mm: float = dimension("tip of the tool beside the wrist's axis, for a tool that turns", 0.0, 0.0)

    def __post_init__(self) -> None:
        check_all(partial(check_limits, self), self._check_tool)

    def _check_tool(self) -> None:
        if self.tool_mm and not self.tool_rotation:
            raise InputError(
                f"tool_mm: {self.tool_mm:g} mm beside the axis of a wrist that does not turn:"
                f" l2_mm = {self.l2_mm + self.tool_mm:g} is the same arm"
            )

    @property
    def height_mm(self) -> float:
        """Height of the tool's tip with the lift at 0."""
        return self.base_mm + self.offset_mm - self.drop_mm

    @property
    def joints(self) -> dict[str, Unit]:
        """The joints' names and units, along the chain."""
        return chain(self.lift, tool_rotation=self.tool_rotation)

    @property
    def dh(self) -> DhTable:
        """The DH table, with the joints' names as variables."""
        joints = list(self.joints)
        lift_sign, tool_sign = _SIGNS[self.lift_positive], _SIGNS[self.tool]
        base, heading = self.base_mm, self.heading_deg
        rows = []
        if self.lift is Lift.FIRST:
            rows.append(DhRow(0.0, 0.0, DhParameter(base, joints.pop(0), lift_sign), DhParameter(heading)))
            base, heading = 0.0, 0.0
        rows.append(DhRow(0.0, 0.0, DhParameter(base), DhParameter(heading, joints.pop(0))))
        rows.append(DhRow(0.0, self.l1_mm, DhParameter(self.offset_mm), DhParameter(variable=joints.pop(0))))
        to_wrist = self.l2_mm
        if self.lift is Lift.LAST:
            rows.append(DhRow(0.0, to_wrist, DhParameter(0.0, joints.pop(0), lift_sign), DhParameter()))
            to_wrist = 0.0
        turning = DhParameter(variable=joints.pop(0)) if joints else DhParameter()
        rows.append(DhRow(180.0 if self.tool is Vertical.DOWN else 0.0, to_wrist, DhParameter(), turning))
        rows.append(DhRow(0.0, self.tool_mm, DhParameter(-tool_sign * self.drop_mm), DhParameter()))
        return DhTable(Convention.MODIFIED, tuple(rows))


_CHAINS: Final = {Lift.FIRST: ["d", "th", "th"], Lift.LAST: ["th", "th", "d"], Lift.NONE: ["th", "th"]}
"""The joints before the tool's, d for a lift, th for a rotary joint."""


def chain(lift: Lift, *, tool_rotation: bool = True) -> dict[str, Unit]:
    """Return the names and units of a SCARA's joints, along the chain."""
    prefixes = _CHAINS[lift] + ["th"] * tool_rotation
    units = {"d": Unit.MM, "th": Unit.DEG}
    return {f"{prefix}{number}": units[prefix] for number, prefix in enumerate(prefixes, start=1)}


_SIGNS: Final = {Vertical.UP: 1, Vertical.DOWN: -1}


def usual_scara(robot: Robot) -> Scara:
    """Return a robot's kinematics; raise InputError if its dimensions or joints are not this mechanism's."""
    geometry = read_geometry(ScaraGeometry, robot)
    return scara_of(robot, geometry, geometry.dh)


def scara_of(robot: Robot, geometry: ScaraGeometry, dh: DhTable) -> Scara:
    """Return the kinematics of a SCARA with these dimensions and this DH table; raise InputError if joints differ."""
    require_joints(robot, geometry.joints)
    names = tuple(geometry.joints)
    first = 1 if geometry.lift is Lift.FIRST else 0
    lift = None if geometry.lift is Lift.NONE else _CHAINS[geometry.lift].index("d")
    return Scara(
        limits=robot.joints,
        dh=dh,
        arm=Planar2R(geometry.l1_mm, geometry.l2_mm),
        lift=lift,
        shoulder=first,
        elbow=first + 1,
        wrist=len(names) - 1 if geometry.tool_rotation else None,
        height_mm=geometry.height_mm,
        heading_deg=geometry.heading_deg,
        lift_sign=_SIGNS[geometry.lift_positive],
        wrist_sign=_SIGNS[geometry.tool],
        tool_mm=geometry.tool_mm,
        base_mm=geometry.base_mm,
        offset_mm=geometry.offset_mm,
    )
