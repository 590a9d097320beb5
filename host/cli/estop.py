"""`steptwin estop ROBOT --connect ...`: stop, then power off."""

from steptwin.host.cli.app import app
from steptwin.host.cli.arguments import AsJson, RobotFile, RobotName, one_robot
from steptwin.host.cli.axis_states import print_axis_states
from steptwin.host.cli.connection import Bitrate, Channel, Connect, Interface, opened_session


@app.command()
def estop(
    robot: RobotName = None,
    robot_file: RobotFile = None,
    connect: Connect = None,
    interface: Interface = None,
    channel: Channel = None,
    bitrate: Bitrate = None,
    as_json: AsJson = False,
) -> None:
    """Stop all axes at once, then switch their power off: stop category 1, by software. No substitute for a switch."""
    from steptwin.host.operate.recovering import emergency_stop

    loaded = one_robot(robot, robot_file)
    with opened_session(loaded, connect, interface, channel, bitrate) as session:
        states = emergency_stop(session)
    print_axis_states(loaded, states, as_json=as_json)
