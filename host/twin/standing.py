"""Read the joint positions at which an emulated machine stands."""

from collections.abc import Mapping, Sequence

from steptwin.host.common.bad_input import unknown
from steptwin.host.common.errors import InputError
from steptwin.host.robots.robot import Robot

Standing = Sequence[float] | Mapping[str, float]
"""Positions of all joints, or of some by name, in mm and degrees."""


def standing_joints(robot: Robot, stand_at: Standing | None) -> list[float]:
    """Return the positions of all joints, in mm and degrees; those that are not given are the robot's home.

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
