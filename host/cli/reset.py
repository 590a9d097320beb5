"""`steptwin reset ROBOT --connect ...`: reset the faults of a live board, start its nodes."""

from steptwin.host.cli.app import command
from steptwin.host.cli.arguments import AsJson, RobotFile, RobotName, one_robot
from steptwin.host.cli.axis_states import print_axis_states
from steptwin.host.cli.connection import Bitrate, Channel, Connect, Force, Interface, opened_session


@command("lab-scara --connect 127.0.0.1", "lab-scara --json --connect 127.0.0.1")
def reset(
    robot: RobotName = None,
    robot_file: RobotFile = None,
    connect: Connect = None,
    interface: Interface = None,
    channel: Channel = None,
    bitrate: Bitrate = None,
    force: Force = False,
    as_json: AsJson = False,
) -> None:
    """Reset the drives' faults, and start nodes that are stopped; the drives are off afterwards.

    Nodes that another master has stopped (NMT), or whose board has restarted, are started. Exit code 3: a cause
    persists.
    """
    from steptwin.host.operate.recovering import reset

    loaded = one_robot(robot, robot_file)
    with opened_session(loaded, connect, interface, channel, bitrate, force=force, waking=True) as session:
        states = reset(session)
    print_axis_states(loaded, states, as_json=as_json)
