"""Switch digital outputs by their names in the robot's file: at once, or while a trajectory runs."""

from steptwin.host.client import OutputCommand
from steptwin.host.common.bad_input import unknown
from steptwin.host.common.errors import InputError
from steptwin.host.operate.session import Session
from steptwin.host.planning.trajectory import Trajectory
from steptwin.host.robots.robot import Robot
from steptwin.protocol import od
from steptwin.protocol.cia402 import DigitalOutput


def wired_outputs(robot: Robot) -> dict[str, tuple[int, DigitalOutput]]:
    """Return the axis and the bit of every output in the robot's file."""
    bits = tuple(DigitalOutput)
    return {
        name: (robot.joint_names.index(output.joint), bits[output.out - 1]) for name, output in robot.outputs.items()
    }


def output_commands(robot: Robot, trajectory: Trajectory) -> tuple[OutputCommand, ...]:
    """Return the commands for all outputs that a trajectory switches."""
    wired = wired_outputs(robot)
    return tuple(
        OutputCommand(*wired[switching.output], switching.on, switching.from_s) for switching in trajectory.switchings
    )


def read_outputs(session: Session) -> dict[str, bool]:
    """Read whether each output is on; raise InputError while a trajectory runs, BusError if a node does not answer."""
    session.require_idle("outputs")
    levels = {}
    for name, (axis, bit) in wired_outputs(session.robot).items():
        node = session.machine.axes[axis]
        levels[name] = bool(node.read(od.DIGITAL_OUTPUTS) & node.read(od.DIGITAL_OUTPUTS_MASK) & bit)
    return levels


def switch_output(session: Session, name: str, *, on: bool) -> dict[str, bool]:
    """Switch one output, then read all; raises as `read_outputs`, and InputError for an unknown name."""
    wired = wired_outputs(session.robot)
    if name not in wired:
        raise no_such_output(session.robot.name, name, list(wired))
    session.require_idle("outputs")
    axis, bit = wired[name]
    session.machine.axes[axis].switch_output(bit, on=on)
    return read_outputs(session)


def no_such_output(robot: str, name: str, names: list[str]) -> InputError:
    """Return the error for an output name that does not exist."""
    return unknown(f"output of {robot}", name, names)
