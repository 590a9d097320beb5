"""Home a live machine by its switches, or declare where it stands."""

from steptwin.host.client import Progress
from steptwin.host.common.errors import InputError
from steptwin.host.operate.homing_settings import homing_settings
from steptwin.host.operate.moving import check_goal, move_within
from steptwin.host.operate.recovering import AxisState, axis_states
from steptwin.host.operate.session import Session


def home_robot(
    session: Session, *, together: bool = False, stay: bool = False, progress: Progress = lambda _: None
) -> list[AxisState]:
    """Home the joints as the robot's file says, one after the other or all together, then move to its home position.

    With `stay` the axes stay where homing ends. `progress` is called with the part of the joints that is homed.

    Raises:
        InputError: the file has no homing for a joint, or a program that claims no lease moves the machine.
        DeviceFaultError: a homing failed, or a drive is in fault or was stopped.
        BusError: another program is in charge, or a node does not answer.
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
    """Declare where the standing machine is, in mm and degrees.

    Raises as `home_robot`, and InputError if a joint is outside its limits.
    """
    check_goal(session.robot, joints)
    with session.in_charge("home", known=False) as machine:
        machine.preset(session.units(joints))
        return axis_states(session)
