"""`steptwin pause ROBOT --connect ...`: halt a live board's trajectory."""

import typer

from steptwin.host.cli.app import app
from steptwin.host.cli.arguments import AsJson, RobotFile, RobotName, one_robot
from steptwin.host.cli.connection import Bitrate, Channel, Connect, Interface, opened_session
from steptwin.host.cli.output import print_json


@app.command()
def pause(
    robot: RobotName = None,
    robot_file: RobotFile = None,
    connect: Connect = None,
    interface: Interface = None,
    channel: Channel = None,
    bitrate: Bitrate = None,
    as_json: AsJson = False,
) -> None:
    """Halt the trajectory that a live board runs, on its path; whoever streams it goes on feeding it."""
    loaded = one_robot(robot, robot_file)
    with opened_session(loaded, connect, interface, channel, bitrate) as session:
        session.require_present()
        halted = session.machine.pause()
    if as_json:
        print_json({"robot": loaded.name, "halted": halted})
    else:
        typer.echo("halted" if halted else "not halted: the trajectory came to its end first")
