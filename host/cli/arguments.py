"""Arguments and options that several commands share, and the reading of their texts."""

import re
from collections.abc import Collection, Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from steptwin.host.common import numbers
from steptwin.host.common.bad_input import prefixed, unknown
from steptwin.host.common.errors import InputError, StepTwinError

if TYPE_CHECKING:
    from steptwin.host.planning.programs.positions import Position
    from steptwin.host.robots.robot import Robot


@contextmanager
def naming_options(*parameters: str, **options: str) -> Iterator[None]:
    """Replace parameters by options in every error from inside, as `with_options` does."""
    try:
        yield
    except StepTwinError as error:
        raise type(error)(with_options(str(error), *parameters, **options)) from error


def with_options(message: str, *parameters: str, **options: str) -> str:
    """Replace parameters by options in a message: `port=80` becomes `--port 80`.

    Args:
        message: the message.
        parameters: those whose option has the same name, such as `allow_remote` for `--allow-remote`.
        options: the option of each other parameter.
    """
    names = {name: f"--{name.replace('_', '-')}" for name in parameters} | options
    named = re.compile(rf"\b({'|'.join(names)})=(True\b)?")

    def option(found: re.Match[str]) -> str:
        return names[found[1]] + ("" if found[2] else " ")

    return named.sub(option, message)


RobotName = Annotated[
    str | None,
    typer.Argument(metavar="ROBOT", help="Name of a robot (`steptwin robots` lists them), or path of a .toml file."),
]
RobotFile = Annotated[
    str | None, typer.Option("--robot-file", metavar="FILE", help="Robot file of your own, instead of ROBOT.")
]
RobotAndJoints = Annotated[
    list[str] | None,
    typer.Argument(metavar="ROBOT Q1 Q2 ...", help="The robot, and its joints' positions in mm and degrees."),
]
AsJson = Annotated[bool, typer.Option("--json", help="Print one JSON document; the rest on stderr.")]


@dataclass(frozen=True, slots=True)
class RobotOptions:
    """The robot of a command without further words, and the form of its answer."""

    robot: RobotName = None
    robot_file: RobotFile = None
    as_json: AsJson = False

    def load(self) -> "Robot":
        """Return the robot; raises as `one_robot`."""
        return one_robot(self.robot, self.robot_file)


def robot_and_rest(words: list[str], robot_file: str | None) -> "tuple[Robot, list[str]]":
    """Return the robot of a command line and the words after it: without a file, the first word names the robot.

    Raises:
        InputError: no robot is given, or its file is wrong.
    """
    from steptwin.host.robots import load_robot, load_robot_file

    if robot_file is not None:
        return load_robot_file(robot_file), words
    if not words:
        raise InputError("ROBOT is missing: a robot's name, or --robot-file FILE")
    return load_robot(words[0]), words[1:]


def robot_and_joints(words: list[str], robot_file: str | None) -> "tuple[Robot, list[float]]":
    """Return the robot of a command line and the positions of all its joints; raises as `robot_and_rest` does."""
    robot, rest = robot_and_rest(words, robot_file)
    return robot, joint_values(rest, robot.joint_names, f"joints of {robot.name}")


def one_robot(name: str | None, robot_file: str | None) -> "Robot":
    """Return the robot of a command without further words; raises as `robot_and_rest` does, or if two are given."""
    robot, rest = robot_and_rest([] if name is None else [name], robot_file)
    if rest:
        raise InputError(f"ROBOT '{rest[0]}' and --robot-file {robot_file}: give only one of them")
    return robot


def joint_values(texts: list[str], names: tuple[str, ...], what: str) -> list[float]:
    """Return joint positions, in mm and degrees, from the command line.

    Raises:
        InputError: a text is not a number, or there are too few or too many.
    """
    values = [finite_number(text, what) for text in texts]
    check_one_each(values, names, what)
    return values


def check_one_each(values: Collection[object], names: tuple[str, ...], what: str) -> None:
    """Raise InputError unless there are as many values as joints."""
    if len(values) != len(names):
        raise InputError(f"{what}: {len(values)} values for the {len(names)} joints {' '.join(names)}")


def finite_number(text: str, what: str) -> float:
    """Return a finite number up to 1e9 in size; InputError for anything else."""
    with prefixed(f"{what}: "):
        return numbers.finite_number(text)


def positive_number(text: str, what: str) -> float:
    """Return a number above 0 and up to 1e9; InputError for anything else."""
    value = finite_number(text, what)
    if not value > 0:
        raise InputError(f"{what}: {value:g} is not above 0")
    return value


def check_percent(percent: float, option: str) -> None:
    """Raise InputError for a speed above 0 and below 1 percent, which was probably meant as a part of 1."""
    if 0 < percent < 1:
        part = f"{percent:g} % of the speed; for {percent:g} of it write {option} {100 * percent:g}"
        raise InputError(f"{option} {percent:g}: is {part}; the least is 1")


Replace = Annotated[bool, typer.Option("--replace", help="Replace files that exist.")]


def keep_files(paths: Iterable[Path], *, replace: bool) -> None:
    """Raise InputError, with a free name, if a command would replace a file unasked; call it before the work.

    A pipe or a device holds nothing that could be lost.
    """
    for path in paths:
        if path.is_file() and not replace:
            raise InputError(f"{path}: exists: take another name, or --replace")


def out_folder(out: str | None, files: Iterable[str] = ()) -> Path | None:
    """Make the folder of --out before anything runs; return None without the option.

    Raises:
        InputError: the folder cannot be made or written to, or a folder is in the way of one of the files.
    """
    from steptwin.host.record.folder import prepare_folder

    with naming_options("out"):
        return None if out is None else prepare_folder(out, files)


def run_folder(out: str | None) -> Path | None:
    """Make the folder of --out for the files of a run, as `out_folder`; it must hold no live board's recording."""
    from steptwin.host.record.folder import keep_recording, run_files

    if out is None:
        return None
    with naming_options("out"):
        keep_recording(out)
    return out_folder(out, run_files())


def chosen_names(option: str, texts: list[str], choices: Iterable[str]) -> list[str]:
    """Return the names given by an option that takes NAME,... and may be repeated, in the order given.

    Raises:
        InputError: a name is unknown or given twice.
    """
    names = list(choices)
    chosen = [name.strip() for text in texts for name in text.split(",")]
    for i, name in enumerate(chosen):
        if name not in names:
            raise unknown(option, name, names)
        if name in chosen[:i]:
            raise InputError(f"{option} {name}: is given twice")
    return chosen


PositionsFile = Annotated[
    str | None,
    typer.Option(
        "--file", metavar="FILE", help="File of saved positions; by default ROBOT-positions.toml in the working folder."
    ),
]


def positions_path(robot: "Robot", file: str | None) -> str:
    """Return the file of a robot's positions."""
    from steptwin.host.planning.programs.positions import default_file

    return default_file(robot) if file is None else file


def saved_position(robot: "Robot", name: str | None, file: str | None) -> "Position | None":
    """Return the position that --to and --file name; None without --to. Raises InputError if there is none."""
    from steptwin.host.planning.programs.positions import find_position, read_positions

    if name is None:
        if file is not None:
            raise InputError(f"--file {file}: is for --to NAME")
        return None
    path = positions_path(robot, file)
    return find_position(read_positions(path, robot), name, path)
