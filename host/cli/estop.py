"""`steptwin estop ROBOT --connect ...`: stop all axes of a live board, then switch their power off."""

from steptwin.host.cli.app import command
from steptwin.host.cli.arguments import AsJson, RobotFile, RobotName, one_robot
from steptwin.host.cli.connection import Bitrate, Channel, Connect, Interface, stop_axes


@command("lab-scara --connect 127.0.0.1", "lab-scara -i socketcan -c can0")
def estop(
    robot: RobotName = None,
    robot_file: RobotFile = None,
    connect: Connect = None,
    interface: Interface = None,
    channel: Channel = None,
    bitrate: Bitrate = None,
    as_json: AsJson = False,
) -> None:
    """Stop all axes together, switch their power off and hold them until `steptwin reset`.

    This is stop category 1 of IEC 60204-1, in software: it does not replace an emergency stop switch.
    """
    from steptwin.host.operate.recovering import emergency_stop

    stop_axes(one_robot(robot, robot_file), emergency_stop, connect, interface, channel, bitrate, as_json=as_json)
