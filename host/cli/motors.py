"""`steptwin motors DIR`: turn the motors by a stored run, and tell whether they keep step."""

from pathlib import Path
from typing import Annotated

import typer

from steptwin.host.cli.app import command
from steptwin.host.cli.arguments import AsJson
from steptwin.host.cli.motor_report import check_motors, motors_of, print_motors, with_load
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
    verdict = motors_of(robot, run.comparison, current)
    if as_json:
        print_json({"robot": robot.name, "job": run.report.document["job"], "motors": verdict.to_dict()})
    else:
        print_motors(verdict)
    if not verdict.kept_step:
        raise typer.Exit(EXIT_NOT_VERIFIED)
