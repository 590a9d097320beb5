"""The digital outputs of a live board by the names in the robot's file."""

from steptwin.host.common.bad_input import unknown
from steptwin.host.common.errors import InputError
from steptwin.host.operate.output_commands import wired_outputs
from steptwin.host.operate.session import Session
from steptwin.protocol import od


def read_outputs(session: Session) -> dict[str, bool]:
    """Which output is on; raises BusError if a node does not answer."""
    session.require_idle("outputs")
    levels = {}
    for name, (axis, bit) in wired_outputs(session.robot).items():
        node = session.machine.axes[axis]
        levels[name] = bool(node.read(od.DIGITAL_OUTPUTS) & node.read(od.DIGITAL_OUTPUTS_MASK) & bit)
    return levels


def switch_output(session: Session, name: str, *, on: bool) -> dict[str, bool]:
    """Switch one output and read all; InputError if there is none of that name."""
    wired = wired_outputs(session.robot)
    if name not in wired:
        raise no_such_output(session.robot.name, name, list(wired))
    session.require_idle("outputs")
    axis, bit = wired[name]
    session.machine.axes[axis].switch_output(bit, on=on)
    return read_outputs(session)


def no_such_output(robot: str, name: str, names: list[str]) -> InputError:
    """The error for a name that does not exist."""
    return unknown(f"output of {robot}", name, names)
