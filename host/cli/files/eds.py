"""`steptwin eds`: print the device description for CANopen tools."""

from steptwin.host.cli.app import command
from steptwin.host.cli.output import print_text


@command("", "> axis.eds")
def eds() -> None:
    """Print the axis nodes' electronic data sheet (CiA 306)."""
    from steptwin.protocol.eds import render_eds

    print_text(render_eds())
