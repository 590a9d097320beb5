"""`steptwin eds`: the device description that CANopen tools want."""

import typer

from steptwin.host.cli.app import app


@app.command()
def eds() -> None:
    """Print the axis nodes' electronic data sheet (CiA 306)."""
    from steptwin.protocol.eds import render_eds

    typer.echo(render_eds(), nl=False)
