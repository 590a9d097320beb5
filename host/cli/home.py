"""`steptwin home ROBOT --connect ...`: let a live machine find out, or tell it, where it is."""

from typing import Annotated

import typer

from steptwin.host.cli.app import app
from steptwin.host.cli.arguments import AsJson, RobotFile, RobotName, joint_values, one_robot
from steptwin.host.cli.axis_states import print_axis_states
from steptwin.host.cli.connection import Bitrate, Channel, Connect, Interface, opened_session
from steptwin.host.cli.progress import progress_bar
from steptwin.host.common.errors import InputError


@app.command()
def home(
    robot: RobotName = None,
    robot_file: RobotFile = None,
    together: Annotated[
        bool, typer.Option("--together", help="All joints at once; by default one after the other, as in the file.")
    ] = False,
    stay: Annotated[
        bool, typer.Option("--stay", help="Stay at the switches; by default the machine moves to its home position.")
    ] = False,
    here: Annotated[
        str | None,
        typer.Option(metavar="'Q1 Q2 ...'", help="No motion: the machine stands there, in mm and degrees."),
    ] = None,
    connect: Connect = None,
    interface: Interface = None,
    channel: Channel = None,
    bitrate: Bitrate = None,
    as_json: AsJson = False,
) -> None:
    """Home a live machine by its switches, as the robot's file says, and move it to its home position."""
    from steptwin.host.operate.homing import declare, home

    loaded = one_robot(robot, robot_file)
    if here is not None and (together or stay):
        raise InputError("--here: goes without --together and --stay, since nothing moves")
    standing = None if here is None else joint_values(here.split(), loaded.joint_names, "--here")
    with opened_session(loaded, connect, interface, channel, bitrate) as session:
        if standing is not None:
            states = declare(session, standing)
        else:
            with progress_bar(f"{loaded.name} home") as progress:
                states = home(session, together=together, stay=stay, progress=progress)
    print_axis_states(loaded, states, as_json=as_json)
