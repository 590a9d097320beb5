"""The warehouse robot and its shelf, for tests."""

from typing import Final

from steptwin.host.robots import load_robot
from steptwin.host.robots.robot import Robot
from steptwin.host.robots.shelf import Shelf


def shelf_of(robot: Robot) -> Shelf:
    """Return the shelf of a robot that has one."""
    assert robot.shelf is not None
    return robot.shelf


ROBOT: Final = load_robot("warehouse-scara")
SHELF: Final = shelf_of(ROBOT)
