"""From a joint of a robot's file to what its axis is told before it moves."""

from math import ceil

from steptwin.host.client import AxisSettings
from steptwin.host.robots.board_settings import BoardSettings
from steptwin.host.robots.joint import Joint
from steptwin.protocol.objects import UNITS_PER_FULL_STEP


def axis_settings(joint: Joint, board: BoardSettings) -> AxisSettings:
    """An axis may go as fast as its driver can; it stops with the joint's own deceleration."""
    transmission = joint.transmission
    return AxisSettings(
        microsteps=transmission.microsteps,
        steplen_ns=board.steplen_ns,
        stepspace_ns=board.stepspace_ns,
        dirsetup_ns=board.dirsetup_ns,
        dirhold_ns=board.dirhold_ns,
        velocity_max_units_per_s=ceil(board.step_rate_max_hz * UNITS_PER_FULL_STEP / transmission.microsteps),
        deceleration_units_per_s2=ceil(joint.acceleration_max * transmission.wire_units_per_unit),
    )
