"""Homing a live machine by its switches, or telling it where it stands."""

from steptwin.host.client import Progress
from steptwin.host.common.errors import InputError
from steptwin.host.operate.homing_settings import homing_settings
from steptwin.host.operate.moving import check_goal, move_within
from steptwin.host.operate.recovering import AxisState, axis_states
from steptwin.host.operate.session import Session


def home_robot(
    session: Session,
    *,
    together: bool = False,
    stay: bool = False,
    progress: Progress = lambda _: None,
) -> list[AxisState]:
    """Home all joints that have a homing in the robot's file, then move to the robot's home position.

    Args:
        session: the machine.
        together: all joints at once instead of one after the other.
        stay: leave the axes where homing ends.
        progress: told which part of the joints is homed.

    Raises:
        InputError: a joint has no homing, or somebody else moves the machine.
        DeviceFaultError: a homing failed, a drive is in fault or was stopped.
        BusError: no answer.
    """
    settings = tuple(homing_settings(joint) for joint in session.robot.joints)
    for joint, how in zip(session.robot.joints, settings, strict=True):
        if how is None:
            raise InputError(f"{joint.name}: the robot's file has no homing for it; declare where it stands instead")
    with session.in_charge("home", known=False) as machine:
        machine.home_axes(settings, progress, together=together)
        if not stay:
            move_within(session, session.demanded_units(), session.units(list(session.robot.home)))
        return axis_states(session)


def declare(session: Session, joints: list[float]) -> list[AxisState]:
    """Tell the standing machine where it is, in mm and degrees; raises as `home` does, or for a joint off limits."""
    check_goal(session.robot, joints)
    with session.in_charge("home", known=False) as machine:
        machine.preset(session.units(joints))
        return axis_states(session)
