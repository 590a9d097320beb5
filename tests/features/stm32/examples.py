"""The examples of examples/stm32-image: images as they are in the repository, and their robot."""

from functools import cache
from pathlib import Path
from typing import Final

from steptwin.controller.motion.backend import python_kernel
from steptwin.features.stm32.options import Stm32Options
from steptwin.features.stm32.part import ImagePart
from steptwin.features.stm32.tools import ImageTools
from steptwin.host.robots import load_robot
from steptwin.host.robots.robot import Robot
from steptwin.host.twin.board_under_test import BoardUnderTest

EXAMPLES: Final = Path(__file__).parents[3] / "examples" / "stm32-image"
ROBOT: Final = EXAMPLES / "two-axes.toml"


@cache
def example_robot() -> Robot:
    """Return the robot of the examples."""
    return load_robot(str(ROBOT))


def example_board(name: str, *extras: object) -> tuple[BoardUnderTest, ImageTools]:
    """Return a board that runs an example in plain Python, 10 ms after power-up, and the example's tools."""
    robot = example_robot()
    image = Stm32Options(image=EXAMPLES / f"{name}.elf").fitted(robot, EXAMPLES, compiled=False)
    board = BoardUnderTest(robot, kernel=python_kernel(), extras=[image, *extras])
    part = board.parts["stm32"]
    assert isinstance(part, ImagePart)
    return board, part.tools(board.wait)
