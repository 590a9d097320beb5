"""`steptwin calibrate ROBOT FILE`: find a machine's real DH parameters from measured positions of its tool."""

import json
from dataclasses import asdict
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from steptwin.host.cli.app import command
from steptwin.host.cli.arguments import AsJson, Replace, RobotFile, keep_files, out_folder, robot_and_rest
from steptwin.host.cli.output import fixed, number_of, print_json, print_table, say
from steptwin.host.common.bad_input import prefixed
from steptwin.host.common.errors import InputError
from steptwin.host.common.whole_file import whole_file

if TYPE_CHECKING:
    from steptwin.host.robots.robot import Robot
    from steptwin.host.studies.calibration import Identification, Parameter

_ROBOT, _FIGURES, _PICTURE = _FILES = ("robot.toml", "calibration.json", "residuals.png")
"""The files in the folder of --out."""


@command("calibration-scara measured.csv", "my-arm.toml measured.csv --out out/calibration")
def calibrate(
    words: Annotated[
        list[str] | None,
        typer.Argument(
            metavar="ROBOT FILE",
            help="The robot, and a CSV file of measurements with the header JOINT,...,x,y,z, in mm and degrees.",
        ),
    ] = None,
    robot_file: RobotFile = None,
    out: Annotated[
        str | None,
        typer.Option(metavar="DIR", help="Folder to write the corrected robot file, figures and picture into."),
    ] = None,
    replace: Replace = False,
    as_json: AsJson = False,
) -> None:
    """Find the real DH parameters of a machine from where its tool was measured, and what cannot be found from that.

    Each line of the file is a pose: where the joints stood, and where the tool was, in the robot's world frame. The
    errors found go to the robot file in the folder, under [dh_errors]: `fk`, `check` and the reports of runs with this
    file tell where the tool really is. `measure` simulates such a file.
    """
    from steptwin.host.robots.kinematics.chain import Chain
    from steptwin.host.studies.calibration import corrected_text, identify_errors, read_measurements

    loaded, rest = robot_and_rest(words or [], robot_file)
    if len(rest) != 1:
        raise InputError(f"one FILE of measurements is needed after the robot, not {' '.join(rest) or 'nothing'}")
    if out is not None:
        keep_files((Path(out) / name for name in _FILES), replace=replace)
    chain, measurements = Chain.of(loaded), read_measurements(rest[0], loaded)
    with prefixed(f"{rest[0]}: "):
        found = identify_errors(chain, measurements)
    folder = out_folder(out, _FILES)
    document = _document(loaded, found)
    pictures = False
    if folder is not None:
        text = corrected_text(loaded, found.chain.link_errors, f"found by a calibration of {len(measurements)} poses")
        _write(folder / _ROBOT, text)
        _write(folder / _FIGURES, json.dumps(document, indent=2) + "\n")
        pictures = _write_picture(folder / _PICTURE, loaded, found)
    if as_json:
        print_json(document)
    else:
        _print(found, document)
    if folder is not None:
        what = "figures and picture" if pictures else "figures"
        say(f"corrected robot file, {what} are in {folder}/", err=as_json)
        if not pictures:
            say("no picture: matplotlib is not installed (pip install 'steptwin[plot]')", err=True)


def _document(robot: "Robot", found: "Identification") -> dict[str, Any]:
    from steptwin.host.studies.calibration import largest_mm, rms_mm

    return {
        "robot": robot.name,
        "poses": len(found.measurements),
        "repeated": found.measurements.repeats,
        "rank": found.rank,
        "condition": found.condition,
        "noise_mm": found.noise_mm,
        "residual_before_mm": {"rms": rms_mm(found.before_mm), "max": largest_mm(found.before_mm)},
        "residual_after_mm": {"rms": rms_mm(found.after_mm), "max": largest_mm(found.after_mm)},
        "worst_line": found.worst_line,
        "parameters": [
            asdict(parameter) | {"acts_as": {name: share for share, name in parameter.acts_as}}
            for parameter in found.parameters
        ],
    }


def _write(path: Path, text: str) -> None:
    with whole_file(path) as file:
        file.write(text.encode())


def _write_picture(path: Path, robot: "Robot", found: "Identification") -> bool:
    """Draw the residuals; return False if matplotlib is not installed."""
    if not find_spec("matplotlib"):
        return False
    from steptwin.host.studies.calibration.residuals import write_residuals

    write_residuals(path, robot.name, found)
    return True


def _print(found: "Identification", document: dict[str, Any]) -> None:
    from steptwin.host.robots.link_errors import unit_of

    rows = [
        [p.name, unit_of(p.name), fixed(p.before), fixed(p.found), fixed(3 * (p.deviation or 0.0))]
        for p in found.parameters
        if p.identified
    ]
    print_table(["parameter", "unit", "before", "found", "3 sigma"], rows, text_columns=2)
    others = [parameter for parameter in found.parameters if not parameter.identified]
    if others:
        say("not told apart by these poses, and left as they are:", *(f"  {_why(other)}" for other in others))
    before, after = document["residual_before_mm"], document["residual_after_mm"]
    say(
        f"rank {found.rank} of {len(found.parameters)} parameters, condition {found.condition:.3g},"
        f" from {document['poses']} poses{_repeats(found)}",
        f"residual before: {before['rms']:.4f} mm rms, {before['max']:.4f} mm max",
        f"residual after: {after['rms']:.4f} mm rms, {after['max']:.4f} mm max, at line {document['worst_line']};"
        f" {found.noise_mm:.4f} mm in each coordinate",
    )


def _repeats(found: "Identification") -> str:
    repeats = found.measurements.repeats
    return f" ({number_of(repeats, 'measurement')} of a repeated pose: each pose counts once)" if repeats else ""


def _why(parameter: "Parameter") -> str:
    if not parameter.acts_as:
        return f"{parameter.name} does not move the tool's position"
    terms = " + ".join(name if f"{share:.3g}" == "1" else f"{share:.3g} {name}" for share, name in parameter.acts_as)
    return f"{parameter.name} acts as {terms.replace('+ -', '- ')}"
