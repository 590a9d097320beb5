"""`steptwin outputs ROBOT [NAME on|off] --connect ...`: list or switch a live board's digital outputs."""

from typing import Annotated

import typer

from steptwin.host.cli.app import command
from steptwin.host.cli.live.connection import SessionOptions
from steptwin.host.cli.output import print_json, print_table
from steptwin.host.common.choices import LEVELS
from steptwin.host.common.errors import InputError


@command("teaching-scara --connect 127.0.0.1", "teaching-scara gripper on --connect 127.0.0.1")
def outputs(
    live: SessionOptions,
    words: Annotated[
        list[str] | None,
        typer.Argument(metavar="ROBOT [NAME on|off]", help="The robot, and an output by its name in the robot's file."),
    ] = None,
) -> None:
    """List the digital outputs by their names in the robot's file, or switch one."""
    from steptwin.host.operate.inputs_outputs import no_such_output, read_outputs, switch_output

    loaded, rest = live.robot_and_rest(words)
    if rest and (len(rest) != 2 or rest[1] not in LEVELS):
        raise InputError(f"after the robot: nothing, or NAME and on or off, not {' '.join(rest)}")
    if rest and rest[0] not in loaded.outputs:
        raise no_such_output(loaded.name, rest[0], list(loaded.outputs))
    with live.session(loaded) as session:
        levels = switch_output(session, rest[0], on=LEVELS[rest[1]]) if rest else read_outputs(session)
    if live.as_json:
        print_json({"robot": loaded.name, "outputs": levels})
        return
    rows = [
        [name, output.joint, f"OUT{output.out}", "on" if levels[name] else "off"]
        for name, output in loaded.outputs.items()
    ]
    print_table(["output", "axis", "number", "is"], rows, text_columns=4)
