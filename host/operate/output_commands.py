"""From names in a robot's file to the digital outputs of its axes."""

from steptwin.host.client import OutputCommand
from steptwin.host.planning.trajectory import Trajectory
from steptwin.host.robots.robot import Robot
from steptwin.protocol.cia402 import DigitalOutput


def wired_outputs(robot: Robot) -> dict[str, tuple[int, DigitalOutput]]:
    """The axis and the bit of every output that something is wired to."""
    bits = tuple(DigitalOutput)
    return {
        name: (robot.joint_names.index(output.joint), bits[output.out - 1]) for name, output in robot.outputs.items()
    }


def output_commands(robot: Robot, trajectory: Trajectory) -> tuple[OutputCommand, ...]:
    """What a trajectory switches on its way."""
    wired = wired_outputs(robot)
    return tuple(
        OutputCommand(*wired[switching.output], switching.on, switching.from_s) for switching in trajectory.switchings
    )
