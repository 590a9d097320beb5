"""Give an emulated board what a commissioned board has in its flash: the name of the robot that it belongs to."""

from steptwin.host.robots.robot import Robot
from steptwin.protocol import od
from steptwin.protocol.dictionary import FlashPage
from steptwin.protocol.robot_name import stored_name


def commissioned_flash(robot: Robot, axes: int) -> list[FlashPage]:
    """Return the flash pages of a robot's board with this number of axes."""
    return [FlashPage(texts={od.ROBOT_NAME: stored_name(robot.name)}) for _ in range(axes)]
