"""`steptwin resume ROBOT --connect ...`: let a live board's trajectory go on."""

import typer

from steptwin.host.cli.app import app
from steptwin.host.cli.arguments import AsJson, RobotFile, RobotName, one_robot
from steptwin.host.cli.connection import Bitrate, Channel, Connect, Interface, opened_session
from steptwin.host.cli.output import print_json


@app.command()
def resume(
    robot: RobotName = None,
    robot_file: RobotFile = None,
    connect: Connect = None,
    interface: Interface = None,
    channel: Channel = None,
    bitrate: Bitrate = None,
    as_json: AsJson = False,
) -> None:
    """Let a halted trajectory of a live board go on."""
    loaded = one_robot(robot, robot_file)
    with opened_session(loaded, connect, interface, channel, bitrate) as session:
        session.require_present()
        session.machine.resume()
    if as_json:
        print_json({"robot": loaded.name, "halted": False})
    else:
        typer.echo("goes on")
