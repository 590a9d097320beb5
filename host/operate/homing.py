"""Home a live machine by its switches, or declare where it stands."""

from collections.abc import Collection
from functools import partial
from math import ceil, floor

from steptwin.host.client import HomingSettings, Progress
from steptwin.host.client.axis_homing import HomingPair
from steptwin.host.common.errors import InputError
from steptwin.host.operate.moving import check_goal, move_within, units_at
from steptwin.host.operate.recovering import AxisState, axis_states
from steptwin.host.operate.session import Session
from steptwin.host.robots.joint import Joint
from steptwin.host.robots.robot import Robot
from steptwin.host.robots.switches import JointHoming
from steptwin.protocol.homing_methods import HOMING_METHODS
from steptwin.protocol.od import UNITS_PER_FULL_STEP

_TIMEOUT_MARGIN = 2.0
_LATENCY_S = 0.05
"""Bound of the delay before a stop begins: the profile segment in execution lasts up to 31 ms."""


def homing_settings(joint: Joint, per_unit: float = 1.0, by_others: float = 0.0) -> HomingSettings | None:
    """Return the homing settings of a joint's axis; None if the robot's file has no homing for the joint.

    For a coupled axis, `per_unit` is its way for one unit of the joint's, and `by_others` the part of its position that
    the other joints make where they stand.
    """
    homing = joint.homing
    if homing is None:
        return None
    units = per_unit * joint.transmission.wire_units_per_unit
    return HomingSettings(
        method=homing.method,
        search_units_per_s=floor(homing.search_speed * units),
        zero_units_per_s=max(1, floor(homing.zero_speed * units)),
        acceleration_units_per_s2=floor(homing.acceleration * units),
        offset_units=_offset_units(joint, homing.method, per_unit, by_others),
        timeout_ms=ceil(1000 * _TIMEOUT_MARGIN * _longest_s(joint, homing)),
    )


def _offset_units(joint: Joint, number: int, per_unit: float, by_others: float) -> int:
    """Return the axis' position of the step where the edge is seen; the joint's is 0 if home is where it stands.

    A switch is closed on the step at its edge: it is seen to close there, and to open one step farther.
    """
    method = HOMING_METHODS[number]
    edge = joint.switches.edge(method) if method else None
    if method is None or edge is None:
        return joint.transmission.to_units(by_others)
    step_units = UNITS_PER_FULL_STEP // joint.transmission.microsteps
    return joint.transmission.to_units(per_unit * edge + by_others) + (
        0 if method.closes else method.edge_direction * step_units
    )


def _longest_s(joint: Joint, homing: JointHoming) -> float:
    """Return an upper bound: three travels at search speed, all ramps, and one braking distance at zero speed."""
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
    """Home the joints as the robot's file says, one after the other or all together, then move to its home position.

    `joints` names those to home, by default all; the others stay. An axis that is coupled to other joints is homed
    after these, because its home depends on where they stand.

    With `stay` the axes stay where homing ends. `progress` is called with the part of the joints that is homed.

    Raises:
        InputError: the file has no homing for a joint or there is no such joint, or a program that claims no charge
            moves the machine.
        DeviceFaultError: a homing failed, a drive is in fault or was stopped, or a joint that stays does not know its
            position although a home depends on it.
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
            machine.home_axes(_level_settings(session, own), part, together=together, pairs=_pairs(robot, own))
            homed += len(own)
        if not stay:
            goal = [home if axis in chosen else None for axis, home in enumerate(robot.home)]
            start_units = session.demanded_units()
            move_within(session, start_units, units_at(session, start_units, goal))
        return axis_states(session)


def check_homing(robot: Robot, names: Collection[str]) -> set[int]:
    """Return the joints of these names; raise InputError for none, an unknown one or one that cannot be homed."""
    if not names:
        raise InputError("home: names no joint")
    chosen = {robot.index_of(name) for name in names}
    for joint in sorted(chosen):
        if robot.joints[joint].homing is None:
            name = robot.joint_names[joint]
            raise InputError(f"{name}: the robot's file has no homing for it; declare where it stands instead")
    return chosen


def _needed(robot: Robot, chosen: set[int]) -> set[str]:
    """Return the axes that stay but must know their positions, because those of other axes' homes depend on them."""
    joints = {other for joint in chosen for other in robot.coupling.joints_of(joint)}
    axes = {axis for joint in joints - chosen for axis in robot.coupling.axes_of(joint)}
    return {robot.axis_names[axis] for axis in axes if robot.coupling.joint_of(axis) not in chosen}


def _part_of_all(progress: Progress, before: float, weight: float, part: float) -> None:
    progress(before + weight * part)


def _level_settings(session: Session, level: list[int]) -> tuple[HomingSettings | None, ...]:
    """Return the settings of the axes to home now, from where the joints of the earlier levels stand; None for others.

    The motors of one joint move alone, so the joint of a later level turns along while its own motor stands.
    """
    robot, coupling = session.robot, session.robot.coupling
    coupled = any(map(coupling.couples, level))
    positions = session.positions(session.machine.positions_units()) if coupled else []
    settings: list[HomingSettings | None] = [None] * len(robot.axes)
    for own in level:
        others = {joint: element for joint, element in coupling.joints_of(own).items() if joint != own}
        by_others = sum(element * positions[joint] for joint, element in others.items())
        for axis in coupling.motors_of(own):
            settings[axis] = homing_settings(robot.axes[axis], coupling.own_element(axis), by_others)
    return tuple(settings)


def _pairs(robot: Robot, joints: list[int]) -> list[HomingPair]:
    """Return the two motors of each of these joints that has two."""
    pairs = []
    for joint in joints:
        if motor := robot.joints[joint].second_motor:
            first, second = robot.coupling.motors_of(joint)
            units = abs(robot.coupling.own_element(joint)) * float(robot.wire_units_per_unit[joint])
            pairs.append(HomingPair(first, second, motor.skew_max, robot.joints[joint].unit, units))
    return pairs


def declare(session: Session, joints: list[float]) -> list[AxisState]:
    """Declare where the standing machine is, in mm and degrees.

    Raises as `home_robot`, and InputError if a joint is outside its limits.
    """
    check_goal(session.robot, joints)
    with session.charge("home", needs=()) as charge:
        charge.enable().preset(session.units(joints))
        return axis_states(session)
