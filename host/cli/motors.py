"""`steptwin motors DIR|ROBOT`: turn the motors by a stored run, or tell which motors would do for a robot."""

from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from steptwin.host.cli.app import command
from steptwin.host.cli.arguments import AsJson, RobotFile, one_robot
from steptwin.host.cli.motor_fits import tell_fits
from steptwin.host.cli.motor_report import (
    check_motors,
    margins_of,
    motors_of,
    print_margins,
    print_motors,
    warn_of_payloads,
    with_load,
    write_pictures,
)
from steptwin.host.cli.output import print_json, say
from steptwin.host.cli.report import EXIT_NOT_VERIFIED
from steptwin.host.common.bad_input import prefixed, unknown
from steptwin.host.common.errors import InputError

if TYPE_CHECKING:
    from steptwin.host.robots.robot import Robot


@command("out/store --payload 1.5 --margin", "lab-scara --supply 12")
def motors(
    subject: Annotated[
        str | None,
        typer.Argument(
            metavar="DIR|ROBOT", help="Folder written by `steptwin run --out`, or a robot or its .toml file."
        ),
    ] = None,
    robot_file: RobotFile = None,
    payload: Annotated[
        str | None, typer.Option(metavar="KG", help="Mass at the tool instead of the robot file's.")
    ] = None,
    supply: Annotated[
        str | None, typer.Option(metavar="V", help="Supply of the drivers instead of the robot file's.")
    ] = None,
    current: Annotated[
        str | None, typer.Option(metavar="A", help="Phase current at full torque instead of the run's or the robot's.")
    ] = None,
    margin: Annotated[
        bool,
        typer.Option(
            "--margin", help="Search the lowest current, the largest payload and the fastest motion that keep step."
        ),
    ] = False,
    out: Annotated[Path | None, typer.Option(metavar="DIR", help="Folder for pictures of a run's motors.")] = None,
    as_json: AsJson = False,
) -> None:
    """Turn the rotors of a stored run by its phase currents, with the arm's masses; exit code 1 if one slips.

    The drivers count steps whether a rotor follows or not: this tells what the motors would really do. Of a robot it
    tells, without a run, the motors' pull-out torques, and which motors would do at the joints' limits.
    """
    if robot_file is not None or subject is None or _is_robot(subject):
        for option, given in (("--margin", margin), ("--out", out is not None)):
            if given:
                raise InputError(f"{option}: is for the folder of a run, not for a robot")
        tell_fits(_described(one_robot(subject, robot_file), payload, supply), current, as_json=as_json)
        return
    _tell_run(Path(subject), payload, supply, current, out, margin=margin, as_json=as_json)


def _is_robot(subject: str) -> bool:
    """Return whether a word means a robot; raise InputError if it is nothing at all."""
    from steptwin.host.robots import robot_names

    if subject in robot_names() or subject.endswith(".toml"):
        return True
    if not Path(subject).exists() and Path(subject).name == subject:
        raise unknown("robot or folder of a run", subject, robot_names())
    return False


def _described(robot: "Robot", payload: str | None, supply: str | None) -> "Robot":
    check_motors(robot)
    return with_load(robot, payload, supply)


def _tell_run(
    folder: Path,
    payload: str | None,
    supply: str | None,
    current: str | None,
    out: Path | None,
    *,
    margin: bool,
    as_json: bool,
) -> None:
    from steptwin.host.record.folder import read_run

    if out is not None and not find_spec("matplotlib"):
        raise InputError("--out: matplotlib is not installed (pip install 'steptwin[plot]')")
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
        warn_of_payloads(run.report.document, ran.verdict.payload_kg)
        if margins is not None:
            print_margins(margins)
    if out is not None:
        write_pictures(out, ran, run.report.run)
        say(f"pictures of the motors are in {out}/", err=as_json)
    if not ran.verdict.kept_step:
        raise typer.Exit(EXIT_NOT_VERIFIED)
