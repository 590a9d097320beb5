"""`steptwin check FILE`: say everything that is wrong in a file of your own, or what it amounts to."""

from collections.abc import Callable, Mapping
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Final

import typer

from steptwin.host.cli.app import command
from steptwin.host.cli.arguments import AsJson
from steptwin.host.cli.check_robot import check_robot
from steptwin.host.cli.checked_file import CheckedFile
from steptwin.host.cli.output import print_json, print_table, say
from steptwin.host.common.bad_input import prefixed
from steptwin.host.common.errors import InputError
from steptwin.host.common.file_limits import PROGRAM_BYTES_MAX
from steptwin.host.common.findings import Findings
from steptwin.host.common.tables import toml_table
from steptwin.host.common.text_file import read_text

if TYPE_CHECKING:
    from steptwin.host.planning.peaks import Peak
    from steptwin.host.planning.programs import StepRow


@command("my-arm.toml", "docs/programs/teaching-scara.toml")
def check(
    file: Annotated[str, typer.Argument(metavar="FILE", help="A robot file or a program, in TOML.")],
    robot: Annotated[
        str | None, typer.Argument(metavar="ROBOT", help="The robot for a program that does not name it.")
    ] = None,
    as_json: AsJson = False,
) -> None:
    """Say everything that is wrong in a file at once; otherwise print what it amounts to.

    Of a robot: joints, ranges, steps and highest speeds, and how far the tool reaches. Of a program: its steps, with
    durations and peaks in percent of the joints' limits. A file with something wrong ends with exit code 2.
    """
    with prefixed(f"{file}: "):
        text = read_text(file, PROGRAM_BYTES_MAX)
        table = toml_table(text)
        kind = next((kind for kind, keys in _KINDS.items() if any(key in table for key in keys)), None)
        if kind is None:
            telling = ", ".join(key for keys in _KINDS.values() for key in keys)
            raise InputError(f"has none of {telling}: it is no {' and no '.join(_KINDS)}")
    findings = Findings()
    checks: Mapping[str, _Check] = {"program": partial(_check_program, Path(file).parent), "robot": check_robot}
    checked = checks[kind](text, robot, findings)
    if as_json:
        print_json({"file": file, "kind": kind, "findings": findings.messages, **checked.document})
    elif findings.messages:
        say(*(f"{file}: {message}" for message in findings.messages), err=True)
    else:
        checked.print()
    if findings.messages:
        raise typer.Exit(InputError.exit_code)


_Check = Callable[[str, str | None, Findings], CheckedFile]
"""Checks a text; the robot is that of a program that does not name its own."""

_KINDS: Final[Mapping[str, tuple[str, ...]]] = {
    "program": ("step", "steps", "sequences"),
    "robot": ("kinematics", "joints", "board"),
}
"""Kinds of files, each with the keys by which it is known: any of them."""


def _check_program(folder: Path, text: str, robot_name: str | None, findings: Findings) -> CheckedFile:
    from steptwin.host.planning.planner import plan
    from steptwin.host.planning.programs import compile_program, parse_program
    from steptwin.host.robots import load_robot

    program = parse_program(text, findings, folder)
    name = robot_name or program.robot
    if name is None:
        findings.messages.append("robot: is missing: name it in the file, or behind it")
    if name is None or findings.messages:
        return CheckedFile({})
    robot = load_robot(name)
    compiled = compile_program(program, robot, findings)
    if not findings.messages:
        with findings.collecting():
            plan(robot, compiled.trajectory)
    duration_s = compiled.trajectory.duration_s
    document = {"robot": robot.name, "duration_s": duration_s, "steps": [_step_document(row) for row in compiled.steps]}

    def print_steps() -> None:
        rows = [
            [row.number, row.text, f"{row.from_s:.3f}", f"{row.duration_s:.3f}", *map(_percent_text, _highest(row))]
            for row in compiled.steps
        ]
        print_table(["step", "what", "from s", "for s", "speed", "acceleration"], rows, text_columns=2)
        waits = ", and its waits for inputs" if compiled.trajectory.waits else ""
        say(f"{robot.name} {program.title or 'program'}: {len(rows)} steps in {duration_s:.3f} s{waits}")

    return CheckedFile(document, print_steps)


def _step_document(row: "StepRow") -> dict[str, Any]:
    speed, acceleration = _highest(row)
    return {
        "number": row.number,
        "text": row.text,
        "from_s": row.from_s,
        "duration_s": row.duration_s,
        "speed_percent": speed.percent if speed else 0.0,
        "acceleration_percent": acceleration.percent if acceleration else 0.0,
    }


def _highest(row: "StepRow") -> "tuple[Peak | None, Peak | None]":
    """Return the peaks of speed and acceleration that are nearest to their limits; None in a step without motion."""
    from steptwin.host.planning.peaks import Quantity

    speeds = [peak for peak in row.peaks if peak.quantity in (Quantity.SPEED, Quantity.AXIS_SPEED)]
    of_acceleration = (Quantity.ACCELERATION, Quantity.AXIS_ACCELERATION)
    accelerations = [peak for peak in row.peaks if peak.quantity in of_acceleration]
    return _nearest_to_limit(speeds), _nearest_to_limit(accelerations)


def _nearest_to_limit(peaks: "list[Peak]") -> "Peak | None":
    return max(peaks, key=lambda peak: peak.percent, default=None)


def _percent_text(peak: "Peak | None") -> str:
    return f"{peak.percent:.0f} % {peak.joint}" if peak is not None and peak.value else "-"
