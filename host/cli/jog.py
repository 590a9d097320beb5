"""`steptwin jog ROBOT JOINT SPEED --connect ...`: move one axis of a live board by hand."""

from dataclasses import asdict
from typing import Annotated

import typer

from steptwin.host.cli.app import command
from steptwin.host.cli.arguments import AsJson, RobotFile, finite_number, robot_and_rest
from steptwin.host.cli.connection import Bitrate, Channel, Connect, Force, Interface, opened_session
from steptwin.host.cli.output import print_json, say
from steptwin.host.common.errors import InputError


@command("lab-scara th2 -10 --seconds 2 --connect 127.0.0.1", "lab-scara d1 5 -i socketcan -c can0", negatives=True)
def jog(
    words: Annotated[
        list[str] | None,
        typer.Argument(
            metavar="ROBOT JOINT SPEED", help="The robot, one of its joints, and a signed speed in mm/s or deg/s."
        ),
    ] = None,
    robot_file: RobotFile = None,
    seconds: Annotated[float | None, typer.Option(metavar="S", help="Time to move; by default until Ctrl-C.")] = None,
    connect: Connect = None,
    interface: Interface = None,
    channel: Channel = None,
    bitrate: Bitrate = None,
    force: Force = False,
    as_json: AsJson = False,
) -> None:
    """Move one joint at a speed, until Ctrl-C.

    A joint that knows its position stops at its limits; another one moves until a limit switch stops it, in fault.
    """
    from steptwin.host.operate.jogging import check_jog, jog

    loaded, rest = robot_and_rest(words or [], robot_file)
    if len(rest) != 2:
        raise InputError(f"JOINT and SPEED are needed after the robot, not {' '.join(rest) or 'nothing'}")
    speed = finite_number(rest[1], "SPEED")
    check_jog(loaded, rest[0], speed)
    if seconds is not None and not 0 < seconds < float("inf"):
        raise InputError(f"--seconds {seconds:g}: is not above 0 and finite")
    with opened_session(loaded, connect, interface, channel, bitrate, force=force) as session:
        jogged = jog(session, rest[0], speed, seconds)
    if as_json:
        print_json({"robot": loaded.name, **asdict(jogged)})
        return
    unit = loaded.joint(jogged.joint).unit
    at_limit = ", at the end of its travel" if jogged.at_limit else ""
    say(f"{jogged.joint}: from {jogged.start:.4f} to {jogged.end:.4f} {unit}{at_limit}")
