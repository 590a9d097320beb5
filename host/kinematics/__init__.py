"""Kinematics: from joints to tool poses and back, one class for each kind of mechanism."""

from collections.abc import Callable
from typing import Final

from host.inputs import unknown
from host.kinematics.base import Branch, Constraint, Kinematics
from host.kinematics.planar2r import Elbow, Planar2R
from host.kinematics.warehouse import WarehouseScara
from host.robot import Robot

__all__ = ["Branch", "Constraint", "Elbow", "Kinematics", "Planar2R", "WarehouseScara", "make_kinematics"]

_KINDS: Final[dict[str, Callable[[Robot], Kinematics]]] = {
    "warehouse-scara": WarehouseScara.of,
}


def make_kinematics(robot: Robot) -> Kinematics:
    """The kinematics of a robot.

    Raises:
        InputError: an unknown kind, or dimensions or joints that do not fit it; the message begins with the key.
    """
    if robot.kinematics not in _KINDS:
        raise unknown("kinematics.kind:", robot.kinematics, _KINDS)
    return _KINDS[robot.kinematics](robot)
