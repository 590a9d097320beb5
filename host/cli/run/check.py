"""`steptwin check FILE`: say everything that is wrong in a file of your own, or what it amounts to."""

import re
from collections.abc import Callable, Mapping
from dataclasses import MISSING
from functools import partial
from pathlib import Path
from typing import Final

import typer

from steptwin.host.cli.app import command
from steptwin.host.cli.arguments import AnswerOptions, CheckedFile
from steptwin.host.cli.options import argument
from steptwin.host.cli.output import say
from steptwin.host.cli.run.check_campaign import check_campaign, check_scenario
from steptwin.host.cli.run.check_program import check_program
from steptwin.host.cli.run.check_robot import check_robot
from steptwin.host.common.bad_input import prefixed
from steptwin.host.common.errors import InputError
from steptwin.host.common.file_limits import CAMPAIGN_BYTES_MAX, PROGRAM_BYTES_MAX, check_size
from steptwin.host.common.findings import Findings
from steptwin.host.common.own_files import read_text
from steptwin.host.common.tables import toml_table


@command("my-arm.toml", "docs/programs/teaching-scara.toml")
def check(
    answer: AnswerOptions,
    file: str = argument("FILE", "A robot, a program, a scenario of faults or a campaign, in TOML.", MISSING),
    robot: str | None = argument("ROBOT", "The robot for a program that does not name it, or for a scenario."),
) -> None:
    """Say everything that is wrong in a file at once; otherwise print what it amounts to.

    Of a robot: joints, ranges, steps and highest speeds, and how far the tool reaches. Of a program: its steps, with
    durations and peaks in percent of the joints' limits. Of a scenario: its faults, with the random times drawn. Of a
    campaign: motions and scenarios, with the number of runs that are to have them. A file with something wrong ends
    with exit code 2.
    """
    from steptwin.host.planning.trajectory_file import is_trajectory_file

    if is_trajectory_file(file):
        raise InputError(
            f"{file}: is a trajectory: `steptwin run ROBOT {file}` says what is wrong before anything moves"
        )
    with prefixed(f"{file}: "):
        text = read_text(file, CAMPAIGN_BYTES_MAX)
        if not _OF_A_CAMPAIGN.search(text):
            check_size(len(text), PROGRAM_BYTES_MAX)
        table = toml_table(text)
        kind = next((kind for kind, keys in _KINDS.items() if any(key in table for key in keys)), None)
        if kind is None:
            telling = ", ".join(key for keys in _KINDS.values() for key in keys)
            raise InputError(f"has none of {telling}: it is no {' and no '.join(_KINDS)}")
    findings = Findings()
    checks: Mapping[str, _Check] = {
        "program": partial(check_program, Path(file).parent),
        "scenario": check_scenario,
        "campaign": partial(check_campaign, file),
        "robot": check_robot,
    }
    checked = checks[kind](text, robot, findings)
    wrong = findings.messages
    if wrong and not answer.as_json:
        say(*(f"{file}: {message}" for message in (*wrong, *checked.advice)), err=True)
    else:
        answer.tell({"file": file, "kind": kind, "findings": wrong, **checked.document}, *checked.words)
    if wrong:
        raise typer.Exit(InputError.exit_code)


_Check = Callable[[str, str | None, Findings], CheckedFile]
"""Checks a text; the robot is that of a program that does not name its own."""

_OF_A_CAMPAIGN: Final = re.compile(r"^\s*\[\[(scenario|motion)\b", re.MULTILINE)
"""What only campaigns have, which may be longer than other files."""

_KINDS: Final[Mapping[str, tuple[str, ...]]] = {
    "program": ("step", "steps", "sequences"),
    "scenario": ("fault",),
    "campaign": ("runs", "motion", "scenario"),
    "robot": ("kinematics", "joints", "board"),
}
"""Kinds of files, each with the keys by which it is known: any of them."""
