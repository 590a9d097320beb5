"""Build a robot's arm as bodies that its motors turn."""

from collections.abc import Sequence
from math import pi, radians
from typing import Final

import numpy as np

from steptwin.features.motors.rotors.arm import BASE, Arm, Body
from steptwin.features.motors.rotors.following import FollowingSliders
from steptwin.host.common.arrays import FloatArray
from steptwin.host.robots.joint import Unit
from steptwin.host.robots.kinematics import make_kinematics
from steptwin.host.robots.kinematics.dh import Convention, DhRow, DhTable, TwoSliders
from steptwin.host.robots.motor import JointLink
from steptwin.host.robots.robot import Robot

_SI: Final = {Unit.MM: 1e-3, Unit.DEG: pi / 180.0}
"""m in a mm, rad in a degree."""


def arm_of(robot: Robot, payload_kg: float) -> Arm:
    """Return the arm with a payload at the tool's tip."""
    kinematics = make_kinematics(robot)
    links = {joint.name: joint.link or JointLink(0.0) for joint in robot.joints}
    if kinematics.dh.sliders is not None:
        return _with_sliders(robot, kinematics.dh, kinematics.dh.sliders, links, payload_kg)
    if not kinematics.task.width:
        return _bare_axes(robot, links, payload_kg)
    bodies, names, signs = _chain(kinematics.dh, robot.joint_names, links, payload_kg)
    slopes = np.zeros((len(bodies), len(robot.axes)))
    by_rotor = joints_by_rotor(robot)
    for body, (name, sign) in enumerate(zip(names, signs, strict=True)):
        joint = robot.index_of(name)
        slopes[body] = sign * _SI[robot.joints[joint].unit] * by_rotor[joint]
    return Arm(bodies, slopes, np.zeros(len(bodies)))


def joints_by_rotor(robot: Robot) -> FloatArray:
    """Return the joints' travel, in mm and degrees, for each rad of each rotor, shape (joints, axes)."""
    travel = np.array([joint.transmission.travel_per_rev for joint in robot.axes]) / (2.0 * pi)
    return np.asarray(robot.coupling.to_joints(np.diag(travel)).T)


def _chain(
    table: DhTable, order: Sequence[str], links: dict[str, JointLink], payload_kg: float
) -> tuple[tuple[Body, ...], list[str], list[int]]:
    """Return the bodies of a DH table, and the variable and sign of each body's joint.

    A body's frame has z along its joint and x towards the next joint: in both conventions the frame after the row's
    screw.
    """
    placed: list[tuple[FloatArray, bool, str, int]] = []
    since = np.eye(4)
    for row in table.rows:
        link = _link_of(row)
        if table.convention is Convention.MODIFIED:
            since = since @ link
        since = since @ _screw(row.theta_deg.constant, row.d_mm.constant)
        # A row may turn and slide at once; the joint that comes first in the robot carries the other.
        moving = [parameter for parameter in (row.d_mm, row.theta_deg) if parameter.variable]
        for parameter in sorted(moving, key=lambda parameter: order.index(parameter.variable)):
            placed.append((since, parameter is row.d_mm, parameter.variable, parameter.sign))
            since = np.eye(4)
        if table.convention is Convention.STANDARD:
            since = since @ link
    bodies = tuple(
        _body(index - 1, slides, fixed, links.get(name, JointLink(0.0)))
        for index, (fixed, slides, name, _) in enumerate(placed)
    )
    last = _with_point_mass(bodies[-1], payload_kg, since[:3, 3])
    return (*bodies[:-1], last), [name for _, _, name, _ in placed], [sign for *_, sign in placed]


def _link_of(row: DhRow) -> FloatArray:
    c, s = np.cos(radians(row.alpha_deg)), np.sin(radians(row.alpha_deg))
    return np.array([[1.0, 0.0, 0.0, 1e-3 * row.a_mm], [0.0, c, -s, 0.0], [0.0, s, c, 0.0], [0.0, 0.0, 0.0, 1.0]])


def _screw(theta_deg: float, d_mm: float) -> FloatArray:
    c, s = np.cos(radians(theta_deg)), np.sin(radians(theta_deg))
    return np.array([[c, -s, 0.0, 0.0], [s, c, 0.0, 0.0], [0.0, 0.0, 1.0, 1e-3 * d_mm], [0.0, 0.0, 0.0, 1.0]])


def _body(parent: int, slides: bool, fixed: FloatArray, link: JointLink) -> Body:
    return Body(
        parent=parent if parent >= 0 else BASE,
        slides=slides,
        fixed=fixed,
        mass_kg=link.mass_kg,
        centre_m=1e-3 * np.array(link.centre_mm),
        inertia_kgm2=np.diag(link.inertia_kgm2),
    )


def _with_point_mass(body: Body, mass_kg: float, at_m: FloatArray) -> Body:
    """Return a body with a point mass fixed to it (parallel axes theorem)."""
    total_kg = body.mass_kg + mass_kg
    if mass_kg == 0.0:
        return body
    centre_m = (body.mass_kg * body.centre_m + mass_kg * at_m) / total_kg
    inertia = (
        body.inertia_kgm2 + _of_point(body.mass_kg, body.centre_m - centre_m) + _of_point(mass_kg, at_m - centre_m)
    )
    return Body(body.parent, body.slides, body.fixed, total_kg, centre_m, inertia)


def _of_point(mass_kg: float, arm_m: FloatArray) -> FloatArray:
    return np.asarray(mass_kg * (arm_m @ arm_m * np.eye(3) - np.outer(arm_m, arm_m)))


# --- joints without a tool: each is on the base, with its axis upright, or level if it slides


def _bare_axes(robot: Robot, links: dict[str, JointLink], payload_kg: float) -> Arm:
    """Return the bodies of joints that do not carry each other; the payload is on the first one."""
    along_x = np.array([[0.0, 0.0, 1.0, 0.0], [0.0, 1.0, 0.0, 0.0], [-1.0, 0.0, 0.0, 0.0], [0.0, 0.0, 0.0, 1.0]])
    bodies = []
    for joint in robot.joints:
        slides = joint.unit is Unit.MM
        bodies.append(_body(BASE, slides, along_x if slides else np.eye(4), links[joint.name]))
    bodies[0] = _with_point_mass(bodies[0], payload_kg, np.zeros(3))
    si = np.array([_SI[joint.unit] for joint in robot.joints])
    return Arm(tuple(bodies), si[:, np.newaxis] * joints_by_rotor(robot), np.zeros(len(bodies)))


# --- a chain with two variables that follow two sliders


def _with_sliders(
    robot: Robot, table: DhTable, pair: TwoSliders, links: dict[str, JointLink], payload_kg: float
) -> Arm:
    chain, names, _ = _chain(table, table.variables, links, payload_kg)
    by_rotor = joints_by_rotor(robot)
    sliders = tuple(
        _body(names.index(pair.carrier), slides=True, fixed=_upright(radius_mm), link=links[name])
        for name, radius_mm in ((pair.left, pair.middle_mm - pair.half_mm), (pair.right, pair.middle_mm + pair.half_mm))
    )
    names = [*names, pair.left, pair.right]
    slopes = np.zeros((len(names), len(robot.axes)))
    for body, name in enumerate(names):
        if name in robot.joint_names:
            joint = robot.index_of(name)
            slopes[body] = _SI[robot.joints[joint].unit] * by_rotor[joint]
    left, right, across, up = (names.index(name) for name in (pair.left, pair.right, pair.across, pair.up))
    following = FollowingSliders(left, right, across, up, 1e-3 * pair.half_mm, 1e-3 * pair.link_mm)
    return Arm((*chain, *sliders), slopes, np.zeros(len(names)), following)


def _upright(radius_mm: float) -> FloatArray:
    """Return the frame of a slide along the waist's axis, at a radius towards the arm."""
    frame = np.eye(4)
    frame[0, 3] = 1e-3 * radius_mm
    return frame
