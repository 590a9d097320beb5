"""Convert a joint's homing in a robot's file to the homing settings of its axis."""

from math import ceil, floor

from steptwin.host.client import HomingSettings
from steptwin.host.robots.homing import JointHoming
from steptwin.host.robots.joint import Joint
from steptwin.protocol.homing_methods import HOMING_METHODS
from steptwin.protocol.objects import UNITS_PER_FULL_STEP

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
    """Return the axis' position of the step at which the edge is seen; the joint's is 0 if home is where it stands.

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
