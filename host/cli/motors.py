"""`steptwin motors DIR`: turn the motors by a stored run, and tell whether they keep step."""

from pathlib import Path
from typing import Annotated

import typer

from steptwin.host.cli.app import command
from steptwin.host.cli.arguments import AsJson
from steptwin.host.cli.motor_report import (
    check_motors,
    margins_of,
    motors_of,
    print_margins,
    print_motors,
    with_load,
)
from steptwin.host.cli.output import print_json
from steptwin.host.cli.report import EXIT_NOT_VERIFIED
from steptwin.host.common.bad_input import prefixed


@command("out/drawer-pull", "out/store --payload 1.5 --supply 12")
def motors(
    folder: Annotated[Path, typer.Argument(metavar="DIR", help="Folder written by `steptwin run --out`.")],
    payload: Annotated[
        str | None, typer.Option(metavar="KG", help="Mass at the tool instead of the robot file's.")
    ] = None,
    supply: Annotated[
        str | None, typer.Option(metavar="V", help="Supply of the drivers instead of the robot file's.")
    ] = None,
    current: Annotated[
        str | None, typer.Option(metavar="A", help="Phase current at full torque instead of the run's.")
    ] = None,
    margin: Annotated[
        bool,
        typer.Option(
            "--margin", help="Search the lowest current, the largest payload and the fastest motion that keep step."
        ),
    ] = False,
    as_json: AsJson = False,
) -> None:
    """Turn the rotors of a stored run by its phase currents, with the arm's masses; exit code 1 if one slips.

    The drivers count steps whether a rotor follows or not: this tells what the motors would really do.
    """
    from steptwin.host.record.folder import read_run

    run = read_run(folder)
    with prefixed(f"{folder}: "):
        check_motors(run.robot)
    robot = with_load(run.robot, payload, supply)
    ran = motors_of(robot, run.comparison, current)
    margins = margins_of(ran, run.comparison) if margin else None
    if as_json:
        found = {"motors": ran.verdict.to_dict()} | ({} if margins is None else {"margins": margins.to_dict()})
        print_json({"robot": robot.name, "job": run.report.document["job"], **found})
    else:
        print_motors(ran.verdict)
        if margins is not None:
            print_margins(margins)
    if not ran.verdict.kept_step:
        raise typer.Exit(EXIT_NOT_VERIFIED)
