"""Give an emulated board what a commissioned board has in its flash: its robot's name and the settings of its axes.

So a program that configures nothing finds an axis that makes the robot's steps. `steptwin run` begins with a new board
instead, which has its factory defaults, and writes every setting.
"""

from collections.abc import Sequence

from steptwin.host.operate.setting_up import axis_settings
from steptwin.host.robots.joint import Joint
from steptwin.host.robots.robot import Robot
from steptwin.protocol import od
from steptwin.protocol.dictionary import FlashPage
from steptwin.protocol.robot_name import stored_name


def commissioned_flash(robot: Robot, joints: Sequence[Joint]) -> list[FlashPage]:
    """Return the flash pages of a board that drives these joints of a robot, as if its settings had been stored."""
    texts = {od.ROBOT_NAME: stored_name(robot.name)}
    return [FlashPage(dict(axis_settings(joint, robot.board).objects()), dict(texts)) for joint in joints]
