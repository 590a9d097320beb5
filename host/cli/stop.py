"""`steptwin stop ROBOT --connect ...`: stop all axes of a live board at once."""

from steptwin.host.cli.app import app
from steptwin.host.cli.arguments import AsJson, RobotFile, RobotName, one_robot
from steptwin.host.cli.axis_states import print_axis_states
from steptwin.host.cli.connection import Bitrate, Channel, Connect, Interface, opened_session


@app.command()
def stop(
    robot: RobotName = None,
    robot_file: RobotFile = None,
    connect: Connect = None,
    interface: Interface = None,
    channel: Channel = None,
    bitrate: Bitrate = None,
    as_json: AsJson = False,
) -> None:
    """Stop all axes of a live board at once, by their quick stop; they go on holding their positions."""
    from steptwin.host.operate.recovering import stop

    loaded = one_robot(robot, robot_file)
    with opened_session(loaded, connect, interface, channel, bitrate) as session:
        states = stop(session)
    print_axis_states(loaded, states, as_json=as_json)
