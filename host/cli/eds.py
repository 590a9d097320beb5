"""`steptwin eds`: print the device description for CANopen tools."""

import typer

from steptwin.host.cli.app import command


@command("", "> axis.eds")
def eds() -> None:
    """Print the axis nodes' electronic data sheet (CiA 306)."""
    from steptwin.protocol.eds import render_eds

    typer.echo(render_eds(), nl=False)
