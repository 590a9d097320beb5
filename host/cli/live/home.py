"""`steptwin home ROBOT --connect ...`: let a live machine find its position by switches, or tell it."""

from typing import Annotated

import typer

from steptwin.host.cli.app import command
from steptwin.host.cli.arguments import RobotName, joint_values
from steptwin.host.cli.live.connection import SessionOptions
from steptwin.host.cli.output import progress_bar
from steptwin.host.common.errors import InputError


@command("lab-scara --together --connect 127.0.0.1", "lab-scara --here '150 0 90 0' --connect 127.0.0.1")
def home(
    live: SessionOptions,
    robot: RobotName = None,
    together: Annotated[
        bool,
        typer.Option("--together", help="Home all joints at once; by default one by one, in the file's order."),
    ] = False,
    stay: Annotated[
        bool, typer.Option("--stay", help="Stay at the switches instead of moving to the home position.")
    ] = False,
    here: Annotated[
        str | None,
        typer.Option(metavar="'Q1 Q2 ...'", help="Move nothing: declare that the joints stand here (mm, degrees)."),
    ] = None,
) -> None:
    """Home a live machine by its switches, then move it to its home position."""
    from steptwin.host.operate.homing import declare, home_robot

    loaded = live.robot(robot)
    if here is not None and (together or stay):
        raise InputError("--here: moves nothing, so --together and --stay do not go with it")
    without = [joint.name for joint in loaded.joints if joint.homing is None]
    if here is None and without:
        raise InputError(f"{without[0]}: the robot's file has no homing for it; say where it stands by --here")
    standing = None if here is None else joint_values(here.split(), loaded.joint_names, "--here")
    with live.session(loaded) as session:
        if standing is not None:
            states = declare(session, standing)
        else:
            with progress_bar(f"{loaded.name} home") as progress:
                states = home_robot(session, together=together, stay=stay, progress=progress)
    live.tell_states(loaded, states)
