"""From a joint of a robot's file to what its axis is told for homing."""

from math import ceil, floor

from steptwin.host.client import HomingSettings
from steptwin.host.robots.homing import JointHoming
from steptwin.host.robots.joint import Joint
from steptwin.protocol.objects import UNITS_PER_FULL_STEP

_OPENS = {17: 1, 18: -1, 19: -1, 21: 1, 23: -1, 26: 1, 27: 1, 30: -1}
"""The methods whose switch opens at the edge, and in which direction the axis moves then.

A switch is closed on the step at its edge: it is seen to close there, and to open one step farther.
"""
_TIMEOUT_MARGIN = 2.0
_LATENCY_S = 0.05
"""More than a stop waits for: a profile's segment in execution lasts up to 31 ms."""


def homing_settings(joint: Joint) -> HomingSettings | None:
    """How a joint's axis is homed; None if its file does not say."""
    homing = joint.homing
    if homing is None:
        return None
    units = joint.transmission.wire_units_per_unit
    edge = joint.switches.edge(homing.method)
    beyond_units = _OPENS.get(homing.method, 0) * UNITS_PER_FULL_STEP // joint.transmission.microsteps
    return HomingSettings(
        method=homing.method,
        search_units_per_s=floor(homing.search_speed * units),
        zero_units_per_s=max(1, floor(homing.zero_speed * units)),
        acceleration_units_per_s2=floor(homing.acceleration * units),
        offset_units=0 if edge is None else joint.to_units(edge) + beyond_units,
        timeout_ms=ceil(1000 * _TIMEOUT_MARGIN * _longest_s(joint, homing)),
    )


def _longest_s(joint: Joint, homing: JointHoming) -> float:
    """A bound on a homing's duration: the travel to and fro and over the switch, then a braking distance slowly."""
    switches, speed = joint.switches, homing.search_speed
    bottom = joint.lower if switches.negative_limit is None else switches.negative_limit
    top = joint.upper if switches.positive_limit is None else switches.positive_limit
    braking = speed * speed / homing.acceleration + speed * _LATENCY_S
    ramps_s = 10 * (speed / homing.acceleration + _LATENCY_S)
    return 3 * (top - bottom) / speed + braking / homing.zero_speed + ramps_s
