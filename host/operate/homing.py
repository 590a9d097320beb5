"""Home a live machine by its switches, or declare where it stands."""

from functools import partial

from steptwin.host.client import HomingSettings, Progress
from steptwin.host.common.errors import InputError
from steptwin.host.operate.homing_settings import homing_settings
from steptwin.host.operate.moving import check_goal, move_within
from steptwin.host.operate.recovering import AxisState, axis_states
from steptwin.host.operate.session import Session


def home_robot(
    session: Session, *, together: bool = False, stay: bool = False, progress: Progress = lambda _: None
) -> list[AxisState]:
    """Home the joints as the robot's file says, one after the other or all together, then move to its home position.

    An axis that is coupled to other joints is homed after these, because its home depends on where they stand.

    With `stay` the axes stay where homing ends. `progress` is called with the part of the joints that is homed.

    Raises:
        InputError: the file has no homing for a joint, or a program that claims no lease moves the machine.
        DeviceFaultError: a homing failed, or a drive is in fault or was stopped.
        BusError: another program is in charge, or a node does not answer.
    """
    for joint in session.robot.joints:
        if joint.homing is None:
            raise InputError(f"{joint.name}: the robot's file has no homing for it; declare where it stands instead")
    with session.in_charge("home", known=False) as machine:
        homed, count = 0, len(session.robot.joints)
        for level in session.robot.coupling.homing_levels(count):
            part = partial(_part_of_all, progress, homed / count, len(level) / count)
            machine.home_axes(_level_settings(session, level), part, together=together)
            homed += len(level)
        if not stay:
            move_within(session, session.demanded_units(), session.units(list(session.robot.home)))
        return axis_states(session)


def _part_of_all(progress: Progress, before: float, weight: float, part: float) -> None:
    progress(before + weight * part)


def _level_settings(session: Session, level: list[int]) -> tuple[HomingSettings | None, ...]:
    """Return the settings of the axes to home now, from where the joints of the earlier levels stand; None for others.

    Each axis moves alone, so the joint of a later level turns along while its own motor stands.
    """
    robot = session.robot
    coupled = any(map(robot.coupling.couples, level))
    positions = session.positions(session.machine.positions_units()) if coupled else []
    settings: list[HomingSettings | None] = [None] * len(robot.joints)
    for axis in level:
        elements = robot.coupling.joints_of(axis)
        by_others = sum(element * positions[joint] for joint, element in elements.items() if joint != axis)
        settings[axis] = homing_settings(robot.joints[axis], elements[axis], by_others)
    return tuple(settings)


def declare(session: Session, joints: list[float]) -> list[AxisState]:
    """Declare where the standing machine is, in mm and degrees.

    Raises as `home_robot`, and InputError if a joint is outside its limits.
    """
    check_goal(session.robot, joints)
    with session.in_charge("home", known=False) as machine:
        machine.preset(session.units(joints))
        return axis_states(session)
