"""Convert the joint positions at which an emulated machine stands into steps of its motors."""

from collections.abc import Mapping, Sequence

import numpy as np

from steptwin.host.common.bad_input import unknown
from steptwin.host.common.errors import InputError
from steptwin.host.robots.robot import Robot
from steptwin.host.robots.transmission import Transmission
from steptwin.protocol.objects import UNITS_PER_FULL_STEP

Standing = Sequence[float] | Mapping[str, float]
"""Positions of all joints, or of some by name, in mm and degrees."""


def standing_joints(robot: Robot, stand_at: Standing | None) -> list[float]:
    """Return the positions of all joints, in mm and degrees; joints without a position stand at the robot's home.

    Raises:
        InputError: the number of positions is wrong, or the robot has no joint of that name.
    """
    at = dict(zip(robot.joint_names, robot.home, strict=True))
    if stand_at is None:
        return list(at.values())
    if not isinstance(stand_at, Mapping):
        if len(stand_at) != len(at):
            raise InputError(f"stand_at: {len(stand_at)} values for the {len(at)} joints {' '.join(at)}")
        return list(stand_at)
    for name, position in stand_at.items():
        if name not in at:
            raise unknown("stand_at: joint", name, at)
        at[name] = position
    return list(at.values())


def standing_steps(robot: Robot, joints: Sequence[float]) -> list[int]:
    """Return the step at which each motor stands, counted from the axis' zero; `joints` in mm and degrees."""
    units = robot.to_units(np.array(joints, dtype=float)).tolist()
    return [_steps(joint.transmission, int(each)) for joint, each in zip(robot.joints, units, strict=True)]


def steps_at(transmission: Transmission, position: float) -> int:
    """Return the step at an axis position, rounded to a wire unit first and then to a step, as the firmware's preset.

    Rounded at once, a position just below half a step could come out one step below the firmware's counter.
    """
    return _steps(transmission, transmission.to_units(position))


def _steps(transmission: Transmission, units: int) -> int:
    return (units * transmission.microsteps + UNITS_PER_FULL_STEP // 2) // UNITS_PER_FULL_STEP
