"""Check that the arm keeps clear of boxes on a straight move in joint space.

The arm's parts are capsules: the lines of the links with half a thickness around them. The levers of the joints bound
the motion of any point of the arm. So the arm can advance until that bound equals the distance to the nearest box, and
is then examined again. No contact between two examinations is missed, however thin the box is.

Source of the method: B. Mirtich, "Impulse-based dynamic simulation of rigid body systems", 1996, section 2.3.2,
conservative advancement.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from steptwin.features.shelf import shelf_of
from steptwin.host.common.arrays import FloatArray
from steptwin.host.common.errors import InputError
from steptwin.host.common.planning_time import check_planning_time
from steptwin.host.planning.motions.joint_move import fastest_law
from steptwin.host.robots.box import Box
from steptwin.host.robots.kinematics import Scara, make_kinematics
from steptwin.host.robots.kinematics.links import solid_parts
from steptwin.host.robots.robot import Robot

MARGIN_MM: Final = 1.0
"""Distance that must remain free: above the error of ramps in whole milliseconds, and the least advance of a step."""

_NUDGE: Final = 1e-4
"""Fraction of the travel by which each joint moves alone to find the joint that brings the arm to a box."""


@dataclass(frozen=True, slots=True)
class TooNear:
    """First place of a move where the arm comes too near to a box.

    Attributes:
        part_of_way: from 0 at the start to 1 at the goal.
        joint: name of the joint that moves the arm there most; even at the start itself.
        position: position of that joint.
        unit: its unit.
        link: part of the arm.
        box: name of the box.
        at_mm: x, y and z of the point on the part's middle line that is nearest to the box.
    """

    part_of_way: float
    joint: str
    position: float
    unit: str
    link: str
    box: str
    at_mm: tuple[float, float, float]


@dataclass(frozen=True, slots=True)
class _Nearest:
    """The nearest pair of part and box: names, distance of the surfaces, and place on the part's line."""

    free_mm: float
    link: str
    piece: int
    along: float
    box: str


def obstacles_of(robot: Robot) -> dict[str, Box]:
    """Return the boxes on the robot's shelf that the arm must keep clear of, by name."""
    shelf = shelf_of(robot)
    return {name: robot.boxes[name] for name in shelf.obstacles} if shelf else {}


def first_contact(robot: Robot, start: Sequence[float], goal: Sequence[float]) -> TooNear | None:
    """Return the first place where the arm comes nearer than MARGIN_MM to an obstacle of its shelf; None without one.

    Joint positions are in mm and degrees; the move between them is straight in joint space.

    Raises:
        InputError: the robot has obstacles, but the shape of its arm is not known well enough.
    """
    obstacles = obstacles_of(robot)
    if not obstacles:
        return None
    arm = _Arm.of(robot, obstacles)
    begin, way = np.array(start, dtype=float), np.subtract(goal, start).astype(float)
    reach_mm = float(np.abs(way) @ arm.levers_mm)
    part = 0.0
    while True:
        check_planning_time()
        nearest = arm.nearest(begin + part * way)
        if nearest.free_mm < MARGIN_MM:
            return arm.contact(robot, nearest, begin, way, part)
        if part >= 1.0 or part * reach_mm + nearest.free_mm > reach_mm + MARGIN_MM:
            return None
        part = min(part + (nearest.free_mm - MARGIN_MM / 2) / reach_mm, 1.0)


def check_travel(robot: Robot, start: Sequence[float], goal: Sequence[float]) -> None:
    """Raise InputError, with place and remedy, if a move is not clear; otherwise as `first_contact`."""
    contact = first_contact(robot, start, goal)
    if contact is None:
        return
    first = clear_orders(robot, start, goal)
    clear = f"moving {first} first, then the others, is clear" if first else "move the arm away from the shelf first"
    x_mm, y_mm, z_mm = contact.at_mm
    part = contact.part_of_way
    at_s = fastest_law(robot, np.subtract(goal, start)).time_of(part) if part else 0.0
    raise InputError(
        f"{contact.joint} at {contact.position:.4f} {contact.unit}, {at_s:.3f} s on the way to the start, brings"
        f" the {contact.link} to {contact.box}, at x {x_mm:.1f}, y {y_mm:.1f}, z {z_mm:.1f} mm; {clear}"
    )


@dataclass(frozen=True, slots=True)
class _Arm:
    """A robot's arm among boxes.

    Attributes:
        kinematics: the mechanism.
        obstacles: the boxes, by name.
        levers_mm: shape (joints,), largest motion of any point of the arm for a mm or a degree of each joint.
        levers_mm: shape (joints,), greatest way of any point of the arm for a mm or a degree of each joint.
    """

    kinematics: Scara
    obstacles: Mapping[str, Box]
    radius_mm: float
    levers_mm: FloatArray

    @classmethod
    def of(cls, robot: Robot, obstacles: Mapping[str, Box]) -> "_Arm":
        kinematics, shelf = make_kinematics(robot), shelf_of(robot)
        if not isinstance(kinematics, Scara) or shelf is None:
            raise InputError(f"shelf.obstacles: a {robot.kinematics} cannot be kept clear of boxes; leave them out")
        return cls(kinematics, obstacles, shelf.arm_radius_mm, kinematics.levers_mm)

    def _pieces_mm(self, joints: FloatArray) -> list[tuple[str, FloatArray]]:
        """Return the name and the corners, shape (points, 3), of each part."""
        return [(link.name, link.points_mm[0]) for link in solid_parts(self.kinematics, joints[np.newaxis])]

    def nearest(self, joints: FloatArray) -> _Nearest:
        """Return the nearest pair of part and box at joints of shape (joints,)."""
        found = []
        for link, points_mm in self._pieces_mm(joints):
            for piece in range(len(points_mm) - 1):
                ends_mm = points_mm[piece].tolist(), points_mm[piece + 1].tolist()
                for name, box in self.obstacles.items():
                    distance_mm, along = box.nearest_on_line(*ends_mm)
                    found.append(_Nearest(distance_mm - self.radius_mm, link, piece, along, name))
        return min(found, key=lambda each: each.free_mm)

    def contact(self, robot: Robot, nearest: _Nearest, begin: FloatArray, way: FloatArray, part: float) -> TooNear:
        """Return a contact with the joint that moves the place of contact most."""
        joints = begin + part * way
        at_mm = self._point_mm(joints, nearest)
        moved_mm = [
            float(np.linalg.norm(self._point_mm(joints + _NUDGE * way * one, nearest) - at_mm))
            for one in np.eye(len(joints))
        ]
        moves_most = int(np.argmax(moved_mm))
        joint, position = robot.joints[moves_most], float(joints[moves_most])
        x_mm, y_mm, z_mm = at_mm.tolist()
        return TooNear(part, joint.name, position, str(joint.unit), nearest.link, nearest.box, (x_mm, y_mm, z_mm))

    def _point_mm(self, joints: FloatArray, nearest: _Nearest) -> FloatArray:
        points_mm = dict(self._pieces_mm(joints))[nearest.link]
        first_mm, second_mm = points_mm[nearest.piece], points_mm[nearest.piece + 1]
        return np.asarray(first_mm + nearest.along * (second_mm - first_mm))


def clear_orders(robot: Robot, start: Sequence[float], goal: Sequence[float]) -> str:
    """Return the joints to move first for a clear move, as in `sx sz first`; empty if neither order is clear."""
    slides = {column for column, _ in make_kinematics(robot).slides}
    if not slides:
        return ""
    arm = set(range(len(robot.joints))) - slides
    for first in (slides, arm):
        between = [goal[i] if i in first else start[i] for i in range(len(robot.joints))]
        if first_contact(robot, start, between) is None and first_contact(robot, between, goal) is None:
            return " ".join(robot.joint_names[i] for i in sorted(first))
    return ""
