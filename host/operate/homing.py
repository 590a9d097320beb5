"""Home a live machine by its switches, or declare its position."""

from collections.abc import Collection
from dataclasses import replace
from functools import partial
from math import ceil, floor

from steptwin.host.client import HomingSettings, Progress
from steptwin.host.client.axis_homing import HomingPair
from steptwin.host.common.errors import InputError
from steptwin.host.operate.moving import check_goal, move_within, units_at
from steptwin.host.operate.recovering import AxisState, axis_states
from steptwin.host.operate.session import Session
from steptwin.host.robots.joint import Joint, Transmission
from steptwin.host.robots.robot import Robot
from steptwin.host.robots.switches import JointHoming
from steptwin.protocol.homing_methods import HOMING_METHODS
from steptwin.protocol.od import UNITS_PER_FULL_STEP

_TIMEOUT_MARGIN = 2.0
_LATENCY_S = 0.05
"""Bound of the delay before a stop begins: the present profile segment lasts up to 31 ms."""


def homing_settings(
    joint: Joint, per_unit: float = 1.0, by_others: float = 0.0, drive: Transmission | None = None
) -> HomingSettings | None:
    """Return the homing settings of an axis that moves a joint; None if the robot file has no homing for the joint.

    Args:
        joint: the joint.
        per_unit: travel of a coupled axis per unit of the joint.
        by_others: part of a coupled axis' position that the other joints cause at their present positions.
        drive: transmission of the axis; None for the joint's own axis.
    """
    homing = joint.homing
    if homing is None:
        return None
    transmission = drive or joint.transmission
    units = abs(per_unit) * transmission.wire_units_per_unit
    return HomingSettings(
        method=homing.method,
        search_units_per_s=floor(homing.search_speed * units),
        zero_units_per_s=max(1, floor(homing.zero_speed * units)),
        acceleration_units_per_s2=floor(homing.acceleration * units),
        offset_units=_offset_units(joint, transmission, per_unit, by_others),
        timeout_ms=ceil(1000 * _TIMEOUT_MARGIN * _longest_s(joint, homing)),
    )


def _offset_units(joint: Joint, transmission: Transmission, per_unit: float, by_others: float) -> int:
    """Return the axis' position at the step of the edge; the joint's position is 0 if home is its present position.

    A switch is closed on the step at its edge: it closes at this step, and opens one step farther.
    """
    method = HOMING_METHODS[joint.homing.method] if joint.homing else None
    edge = joint.switches.edge(method) if method else None
    if method is None or edge is None:
        return transmission.to_units(by_others)
    step_units = UNITS_PER_FULL_STEP // transmission.microsteps
    direction = method.edge_direction if per_unit > 0 else -method.edge_direction
    return transmission.to_units(per_unit * edge + by_others) + (0 if method.closes else direction * step_units)


def _longest_s(joint: Joint, homing: JointHoming) -> float:
    """Return a bound of the homing time: three travels at search speed, all ramps, a braking distance at low speed."""
    switches, speed = joint.switches, homing.search_speed
    bottom = joint.lower if switches.negative_limit is None else switches.negative_limit
    top = joint.upper if switches.positive_limit is None else switches.positive_limit
    braking = speed * speed / homing.acceleration + speed * _LATENCY_S
    ramps_s = 10 * (speed / homing.acceleration + _LATENCY_S)
    return 3 * (top - bottom) / speed + braking / homing.zero_speed + ramps_s


def home_robot(
    session: Session,
    *,
    joints: Collection[str] | None = None,
    together: bool = False,
    stay: bool = False,
    progress: Progress = lambda _: None,
) -> list[AxisState]:
    """Home joints by the settings of the robot file, then move to the robot's home position.

    An axis that is coupled to other joints is homed after them, because its home depends on their positions.

    Args:
        session: the machine.
        joints: names of the joints to home; None for all.
        together: True to home all joints at the same time, False one after the other.
        stay: True to skip the move to the home position.
        progress: called with the fraction of the homed joints.

    Raises:
        InputError: a joint does not exist or has no homing in the file, or a program that has not claimed the machine
            moves it.
        DeviceFaultError: a homing has failed, a drive is in fault or was stopped, or a home depends on a joint that is
            not homed and has no position reference.
        BusError: another program is in charge, or a node does not answer.
    """
    robot = session.robot
    chosen = check_homing(robot, robot.joint_names if joints is None else joints)
    with session.charge("home", needs=_needed(robot, chosen)) as charge:
        machine = charge.enable()
        homed = 0
        for level in robot.coupling.homing_levels(len(robot.joints)):
            own = [joint for joint in level if joint in chosen]
            part = partial(_part_of_all, progress, homed / len(chosen), len(own) / len(chosen))
            settings, sets = _level_settings(session, own, chosen), _sets(robot, own)
            machine.home_axes(settings, part, together=together, sets=sets, pairs=_pairs(robot, own))
            homed += len(own)
        if not stay:
            goal = [home if axis in chosen else None for axis, home in enumerate(robot.home)]
            start_units = session.demanded_units()
            move_within(session, start_units, units_at(session, start_units, goal))
        return axis_states(session)


def check_homing(robot: Robot, names: Collection[str]) -> set[int]:
    """Return the joints of these names; raise InputError for no name, an unknown joint or one without homing."""
    if not names:
        raise InputError("home: names no joint")
    chosen = {robot.index_of(name) for name in names}
    for joint in sorted(chosen):
        if robot.joints[joint].homing is None:
            name = robot.joint_names[joint]
            raise InputError(f"{name}: the robot's file has no homing for it; declare where it stands instead")
    return chosen


def _needed(robot: Robot, chosen: set[int]) -> set[str]:
    """Return the axes that are not homed but need a position reference, because other homes depend on them."""
    coupling = robot.coupling
    joints = {other for joint in chosen for axis in coupling.homing_axes(joint) for other in coupling.joints_of(axis)}
    return {
        robot.axis_names[axis]
        for joint in joints - chosen
        for axis in coupling.axes_of(joint)
        if coupling.joint_of(axis) not in chosen - coupling.mutual(joint)
    }


def _part_of_all(progress: Progress, before: float, weight: float, part: float) -> None:
    progress(before + weight * part)


def _level_settings(session: Session, level: list[int], chosen: set[int]) -> tuple[HomingSettings | None, ...]:
    """Return the settings of the axes to home now, from the positions of earlier levels' joints; None for other axes.

    The motors of a joint move alone, or together with those of mutually dependent joints. A joint of a later level
    moves passively, while its own motor is at standstill. Mutually dependent joints have no position reference before
    all of the chosen ones are homed.
    """
    robot, coupling = session.robot, session.robot.coupling
    coupled = any(map(coupling.couples, level))
    positions = session.positions(session.machine.positions_units()) if coupled else []
    settings: list[HomingSettings | None] = [None] * len(robot.axes)
    for own in level:
        axes, partial_home = coupling.homing_axes(own), max(coupling.mutual(own) & chosen) != own
        for axis, per_unit in axes.items():
            others = {joint: element for joint, element in coupling.joints_of(axis).items() if joint != own}
            by_others = sum(element * positions[joint] for joint, element in others.items())
            alike = robot.joints[own] if coupling.joint_of(axis) != own else robot.axes[axis]
            made = homing_settings(alike, per_unit, by_others, robot.axes[axis].transmission)
            if made and len(axes) > 1:
                switch = axis if coupling.joint_of(axis) == own else own
                made = replace(made, switch_axis=switch, reversed=per_unit < 0, partial=partial_home)
            settings[axis] = made
    return tuple(settings)


def _sets(robot: Robot, joints: list[int]) -> list[list[int]]:
    """Return, for each joint, the axes that are homed together."""
    return [axes for joint in joints if len(axes := list(robot.coupling.homing_axes(joint))) > 1]


def _pairs(robot: Robot, joints: list[int]) -> list[HomingPair]:
    """Return the motor pairs of the joints that have two motors."""
    pairs = []
    for joint in joints:
        if motor := robot.joints[joint].second_motor:
            first, second = robot.coupling.motors_of(joint)
            units = abs(robot.coupling.own_element(joint)) * float(robot.wire_units_per_unit[joint])
            pairs.append(HomingPair(first, second, motor.skew_max, robot.joints[joint].unit, units))
    return pairs


def declare(session: Session, joints: list[float]) -> list[AxisState]:
    """Declare the positions of the joints at standstill, in mm and degrees.

    Raises as `home_robot`, and InputError if a joint is outside of its limits.
    """
    check_goal(session.robot, joints)
    with session.charge("home", needs=()) as charge:
        charge.enable().preset(session.units(joints))
        return axis_states(session)
