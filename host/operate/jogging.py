"""Jog one joint at a speed, for a time or until Ctrl-C."""

from dataclasses import dataclass
from math import ceil, inf

from steptwin.host.client.axis import AxisClient
from steptwin.host.client.profile_motion import drive_at, follow, halt_axis, reports_zero_speed
from steptwin.host.common.bad_input import at_most, unknown
from steptwin.host.common.errors import InputError
from steptwin.host.operate.session import Session
from steptwin.host.operate.setting_up import clear_targets
from steptwin.host.robots.joint import Joint
from steptwin.host.robots.robot import Robot
from steptwin.protocol import od
from steptwin.protocol.cia402 import Status


@dataclass(frozen=True, slots=True)
class Jogged:
    """A finished jog: start and end in the joint's unit, and whether a software position limit ended it."""

    joint: str
    start: float
    end: float
    at_limit: bool


def check_jog(robot: Robot, name: str, speed: float) -> Joint:
    """Return the joint of this name; raise InputError if it does not exist or the speed is not within its limit."""
    if name not in robot.joint_names:
        raise unknown("joint", name, robot.joint_names)
    joint = robot.joint(name)
    if not 0 < abs(speed) <= joint.speed_max:
        limit = f"above 0 and up to {at_most(joint.speed_max)} {joint.unit}/s, with a sign"
        raise InputError(f"{name}: a speed of {speed:g} {joint.unit}/s is not {limit}")
    return joint


def jog(session: Session, name: str, speed: float, seconds: float | None) -> Jogged:
    """Move one joint at a speed until a time is over or the joint stands at its limit.

    All ramps have the joint's highest acceleration. An axis whose position is known keeps the joint's limits; any other
    axis has no limits. The speed is in mm/s or degrees/s; its sign is the direction. The time includes the ramp up.
    Without a time the joint moves until KeyboardInterrupt, which then ends the jog by a ramp and is not raised further.

    Raises:
        InputError, DeviceFaultError, BusError: as `move`, but the position may be unknown.
    """
    joint = check_jog(session.robot, name, speed)
    axis = session.machine.axes[session.robot.joints.index(joint)]
    per_unit = joint.transmission.wire_units_per_unit
    with session.in_charge("jog", known=False):
        start_units = axis.read(od.POSITION_ACTUAL)
        _set_limits(axis, joint)
        velocity = round(speed * per_unit) or (1 if speed > 0 else -1)
        drive_at(axis, velocity, ceil(joint.acceleration_max * per_unit))
        until_s = session.link.now_s() + (inf if seconds is None else seconds)
        try:
            follow(session.link, [axis], lambda: session.link.now_s() >= until_s or _at_limit(axis))
        except KeyboardInterrupt:
            if seconds is not None:
                raise
        at_limit = _at_limit(axis)
        halt_axis(session.link, axis)
        clear_targets([axis])
        end_units = axis.read(od.POSITION_ACTUAL)
    return Jogged(name, start_units / per_unit, end_units / per_unit, at_limit)


def _set_limits(axis: AxisClient, joint: Joint) -> None:
    if not axis.read(od.STATUSWORD) & Status.POSITION_KNOWN:
        return
    per_unit = joint.transmission.wire_units_per_unit
    axis.ensure(od.POSITION_LIMIT_MIN, ceil(joint.lower * per_unit))
    axis.ensure(od.POSITION_LIMIT_MAX, int(joint.upper * per_unit // 1))


def _at_limit(axis: AxisClient) -> bool:
    status = axis.drive_status
    return status is not None and reports_zero_speed(axis) and bool(status.statusword & Status.INTERNAL_LIMIT)
