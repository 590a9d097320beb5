"""`steptwin stop ROBOT --connect ...`: stop all axes of a live board together."""

from steptwin.host.cli.app import command
from steptwin.host.cli.arguments import AsJson, RobotFile, RobotName, one_robot
from steptwin.host.cli.connection import Bitrate, Channel, Connect, Interface, stop_axes


@command("lab-scara --connect 127.0.0.1", "lab-scara -i socketcan -c can0")
def stop(
    robot: RobotName = None,
    robot_file: RobotFile = None,
    connect: Connect = None,
    interface: Interface = None,
    channel: Channel = None,
    bitrate: Bitrate = None,
    as_json: AsJson = False,
) -> None:
    """Stop all axes together by a quick stop; they hold their positions afterwards."""
    from steptwin.host.operate.recovering import stop

    stop_axes(one_robot(robot, robot_file), stop, connect, interface, channel, bitrate, as_json=as_json)
