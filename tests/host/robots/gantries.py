"""A gantry whose beam Y has a motor at each end, with an A4988 for each."""

from typing import Final

from steptwin.host.robots.reader import parse_robot
from steptwin.host.robots.robot import Robot

STEPS_PER_MM: Final = 200 * 16 / 40
UNITS_PER_MM: Final = 200 * 16384 / 40
SWITCH_MM: Final = -2.0
SKEW_MAX_MM: Final = 3.0
SECOND: Final = f'[joints.Y.second_motor]\nname = "Y2"\nskew_max = {SKEW_MAX_MM}\n'
"""The table that gives Y its second motor."""
_SLIDE: Final = """
[joints.{name}]
unit = "mm"
lower = 0.0
upper = {upper}
speed_max = 100.0
acceleration_max = 500.0
full_steps_per_rev = 200
microsteps = 16
travel_per_turn = 40.0

[joints.{name}.switches]
negative_limit = {switch}

[joints.{name}.homing]
method = 17
search_speed = 20.0
zero_speed = 2.0
acceleration = 200.0
"""
_GANTRY: Final = """
name = "gantry"
title = "a gantry with a motor at each end of its beam"

[kinematics]
kind = "cartesian"
axes = "XY"

[board]
bitrate = 1000000
driver_profile = "a4988"
steplen_ns = 4000
stepspace_ns = 4000
dirsetup_ns = 500
dirhold_ns = 500
step_rate_max_hz = 20000

[home]
X = 200.0
Y = 150.0
"""


def gantry_text(second: str = SECOND) -> str:
    """Return the robot file; `second` is the table of Y's second motor, and what else stands there."""
    slides = (_SLIDE.format(name=name, upper=upper, switch=SWITCH_MM) for name, upper in (("X", 400.0), ("Y", 300.0)))
    return "\n".join((_GANTRY, *slides, second))


COREXY: Final = "\n[coupling]\nX = { X = 1.0, Y = 1.0 }\nY = { X = -1.0, Y = 1.0 }\n"
"""Two belts: both motors move both slides."""


def belts_text(coupling: str = COREXY) -> str:
    """Return the file of a machine with one motor for each slide, both of which move both slides by belts."""
    fast = "axis_speed_max = 200.0\naxis_acceleration_max = 1000.0\nspeed_max"
    return gantry_text("").replace("speed_max", fast) + coupling


def gantry_robot(second: str = SECOND) -> Robot:
    return parse_robot(gantry_text(second), "gantry.toml")
