"""Changes of a robot's digital inputs, by their names in its file, as operations on an emulated board."""

from typing import NamedTuple

from steptwin.emulator.operations import SetInput
from steptwin.host.common.bad_input import unknown
from steptwin.host.operate.input_waiting import wired_inputs
from steptwin.host.robots.robot import Robot


class InputChange(NamedTuple):
    """An input changes its level `at_s` seconds of simulated time after the motion's start; at 0 it has it before."""

    name: str
    on: bool
    at_s: float


def set_input(robot: Robot, name: str, *, on: bool) -> SetInput:
    """Return the operation that sets a robot's input on its one board; raise InputError for an unknown name."""
    wired = wired_inputs(robot)
    if name not in wired:
        raise unknown(f"input of {robot.name}", name, wired)
    axis, which = wired[name]
    return SetInput(axis, which, on)
