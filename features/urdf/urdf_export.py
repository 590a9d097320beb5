"""Write a robot of the kind `chain` as a URDF: its joints with their frames, axes, limits and speeds, for ROS tools.

Each joint moves a link of its own; a last fixed joint carries the link `tool0`, the tool's frame. Frames of a chain
stay as they are; DH parameters become the frames of their table. A URDF cannot have transmissions, microsteps,
switches, the driver, or the place of the base in the station.
"""

from collections.abc import Iterable
from dataclasses import dataclass
from math import radians
from typing import Final
from xml.etree.ElementTree import Comment, Element, SubElement, indent, tostring

import numpy as np

from steptwin.features.urdf.urdf_chain import frame_of
from steptwin.host.common.arrays import FloatArray
from steptwin.host.common.errors import InputError
from steptwin.host.robots.joint import Joint, Unit
from steptwin.host.robots.kinematics.base import read_geometry
from steptwin.host.robots.kinematics.dh import Convention, DhTable
from steptwin.host.robots.kinematics.kinds import kind_named
from steptwin.host.robots.kinematics.serial.chain_geometry import ChainGeometry, Notation
from steptwin.host.robots.kinematics.serial.rows import FixedFrame
from steptwin.host.robots.robot import Robot

TIP: Final = "tool0"
"""Link of the tool's frame; ROS-Industrial's name."""
_BASE: Final = "base_link"
_HERE: Final = FixedFrame()
_MM_PER_M: Final = 1000.0


@dataclass(frozen=True, slots=True)
class _Placed:
    """A joint's axis, and its frame in that of the joint before."""

    name: str
    frame: FixedFrame
    axis: tuple[float, float, float]


def urdf_of(robot: Robot) -> str:
    """Return the text of a URDF; raise InputError for a robot of another kind than `chain`."""
    if kind_named(robot.kinematics).geometry is not ChainGeometry:
        raise InputError(
            f"{robot.name}: is a {robot.kinematics!r}: only robots of the kind 'chain' are written as URDF"
        )
    geometry = read_geometry(ChainGeometry, robot)
    base, placed, tool = _of_frames(geometry) if geometry.notation is Notation.URDF else _of_rows(geometry.dh)
    root = Element("robot", name=robot.name)
    root.append(Comment(" effort is unknown: 0 stands for it "))
    carrier = _BASE
    SubElement(root, "link", name=carrier)
    if base != _HERE:
        _joint(root, f"{_BASE}-base_frame", "fixed", (carrier, "base_frame"), base)
        carrier = "base_frame"
    joints = {joint.name: joint for joint in robot.joints}
    for i, each in enumerate(placed, start=1):
        _moving(root, each, (carrier, f"link{i}"), joints[each.name])
        carrier = f"link{i}"
    _joint(root, f"{carrier}-{TIP}", "fixed", (carrier, TIP), tool)
    indent(root)
    return f'<?xml version="1.0"?>\n{tostring(root, encoding="unicode")}\n'


def _of_frames(geometry: ChainGeometry) -> tuple[FixedFrame, list[_Placed], FixedFrame]:
    placed = [
        _Placed(name, FixedFrame(joint.xyz_mm, joint.rpy_deg), _unit_axis(joint.axis)) for name, joint in geometry.chain
    ]
    return geometry.base, placed, geometry.tool


def _unit_axis(axis: tuple[float, float, float]) -> tuple[float, float, float]:
    x, y, z = (np.array(axis) / np.linalg.norm(axis)).tolist()
    return x, y, z


def _of_rows(table: DhTable) -> tuple[FixedFrame, list[_Placed], FixedFrame]:
    """Return the frames of a DH table's rows; each joint's axis is z."""
    placed: list[_Placed] = []
    since = np.eye(4)
    for row in table.rows:
        along_x = _screw(row.a_mm, row.alpha_deg, 0.0, 0.0)
        along_z = _screw(0.0, 0.0, row.d_mm.constant, row.theta_deg.constant)
        name = row.d_mm.variable or row.theta_deg.variable
        if table.convention is Convention.MODIFIED:
            since = since @ along_x
        since = since @ along_z
        if name:
            placed.append(_Placed(name, frame_of(since), (0.0, 0.0, 1.0)))
            since = np.eye(4)
        if table.convention is Convention.STANDARD:
            since = since @ along_x
    return _HERE, placed, frame_of(since)


def _screw(x_mm: float, alpha_deg: float, z_mm: float, theta_deg: float) -> FloatArray:
    """Return a screw motion along and about x or z, shape (4, 4)."""
    return FixedFrame((x_mm, 0.0, z_mm), (alpha_deg, 0.0, theta_deg)).matrix


def _moving(root: Element, placed: _Placed, links: tuple[str, str], joint: Joint) -> None:
    slides = joint.unit is Unit.MM
    element = _joint(root, placed.name, "prismatic" if slides else "revolute", links, placed.frame)
    SubElement(element, "axis", xyz=_spaced(placed.axis))
    lower, upper, speed = (
        value / _MM_PER_M if slides else radians(value) for value in (joint.lower, joint.upper, joint.speed_max)
    )
    SubElement(element, "limit", lower=repr(lower), upper=repr(upper), effort="0", velocity=repr(speed))


def _joint(root: Element, name: str, kind: str, links: tuple[str, str], frame: FixedFrame) -> Element:
    """Add a joint and the link that it carries; `links` are its parent and its child."""
    parent, child = links
    SubElement(root, "link", name=child)
    element = SubElement(root, "joint", name=name, type=kind)
    SubElement(element, "parent", link=parent)
    SubElement(element, "child", link=child)
    xyz_m, rpy_rad = ([value / _MM_PER_M for value in frame.xyz_mm], map(radians, frame.rpy_deg))
    SubElement(element, "origin", xyz=_spaced(xyz_m), rpy=_spaced(rpy_rad))
    return element


def _spaced(values: Iterable[float]) -> str:
    """Return numbers with all digits, for exact reading."""
    return " ".join(map(repr, values))
