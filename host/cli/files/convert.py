"""`steptwin convert ROBOT FILE`: write the motions of another controller's program as a program."""

from dataclasses import MISSING
from pathlib import Path
from shlex import quote
from typing import Literal

from steptwin.host.cli.app import command
from steptwin.host.cli.arguments import Replace, RobotOptions, finite_number, keep_files
from steptwin.host.cli.options import argument, naming_options, option
from steptwin.host.cli.output import warn
from steptwin.host.common.errors import InputError
from steptwin.host.common.whole_file import write_whole


@command(
    "ar4-mk3 stack.ar4 --from ar4 --out stack.toml",
    "my-arm.toml dance.txt --from parol6 --out dance.toml",
)
def convert(
    which: RobotOptions,
    words: list[str] | None = argument("ROBOT FILE", "An arm of six joints, and the program for it."),
    language: Literal["ar4", "parol6"] = option(
        "KIND", "ar4: .ar4 of the AR4's HMI; parol6: .txt of the PAROL6's Commander.", "--from", default=MISSING
    ),
    out: Path = option("FILE", "File to write, whose name ends in .toml.", default=MISSING),
    line_speed: float = option(
        "MM/S", "Speed of straight moves that say a percentage or a time.", default="50", read=finite_number
    ),
    replace: Replace = False,
) -> None:
    """Write the motions of an AR4's or a PAROL6's program as a program of StepTwin: moves and pauses, step by step.

    Orientations are turned from the convention of the program that wrote them into one that says what it is. What is no
    motion, such as outputs, jumps and registers, stands as a comment where it stood. `check` tells whether the robot
    can make the steps.
    """
    from steptwin.host.planning.foreign import converted
    from steptwin.host.planning.programs import SUFFIX

    robot, file = which.robot_and_file(words, "FILE")
    if out.suffix != SUFFIX:
        raise InputError(f"--out {out}: does not end in {SUFFIX}: a program does")
    keep_files([out], replace=replace)
    with naming_options(line_speed_mm_s="--line-speed"):
        made = converted(file, language, robot, line_speed)
    write_whole(out, made.text)
    which.tell_of(
        robot,
        {"file": str(out), "steps": made.taken, "left_out": list(made.left_out), "own_speeds": made.own_speeds},
        f"{out}: {made.taken} steps of {file}",
        f"look at it with: steptwin check {quote(str(out))}",
    )
    if made.own_speeds:
        warn(f"{file}: {made.own_speeds} straight moves say no speed of the tool: they have {line_speed:g} mm/s")
    if made.left_out:
        warn(f"{file}: {len(made.left_out)} lines are left out and stand as comments, the first: {made.left_out[0]}")
