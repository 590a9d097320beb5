"""Arguments and options of several commands, the answer of a command, and the reading of texts.

A tool's orientation has several notations; their options carry the conventions in their names. An emulated machine has
options of its own, whose names appear in errors.
"""

from collections.abc import Callable, Collection, Iterable, Iterator
from contextlib import AbstractContextManager, contextmanager
from dataclasses import dataclass, field, fields, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Final

from steptwin.host.cli.options import argument, naming_options, option, switch, with_options
from steptwin.host.cli.output import print_json, say, say_no_pictures, warn
from steptwin.host.common import numbers
from steptwin.host.common.bad_input import prefixed, unknown
from steptwin.host.common.errors import InputError
from steptwin.host.common.features import giving
from steptwin.host.common.planning_time import PLANNING_S, PlanningTimeError, plan_within
from steptwin.host.twin.machine.machine_options import SPELLING, MachineOptions, read_extras

if TYPE_CHECKING:
    from steptwin.host.planning.programs.positions import Position
    from steptwin.host.robots.poses import Orientation
    from steptwin.host.robots.robot import Robot


RobotName = Annotated[
    str | None, argument("ROBOT", "Name of a robot (`steptwin robots` lists them), or path of a .toml file.")
]
RobotFile = Annotated[str | None, option("FILE", "Robot file of your own, instead of ROBOT.")]
RobotAndJoints = Annotated[
    list[str] | None, argument("ROBOT Q1 Q2 ...", "The robot, and its joints' positions in mm and degrees.")
]
AsJson = Annotated[bool, switch("Print one JSON document; the rest on stderr.", "--json")]
Replace = Annotated[bool, switch("Replace files that exist.")]
RunDir = Annotated[Path, argument("DIR", "Folder written by `steptwin run --out` or `steptwin serve --out`.")]
PlanDir = Annotated[Path | None, option("DIR", "For a live board's folder: folder of the run with its plan.", "--plan")]
PositionsFile = Annotated[
    str | None,
    option("FILE", "File of saved positions; by default ROBOT-positions.toml in the working folder.", "--file"),
]


@dataclass(frozen=True, slots=True, kw_only=True)
class AnswerOptions:
    """Form of a command's answer: text, or one JSON document on stdout and all else on stderr."""

    as_json: AsJson = False

    def tell(self, document: dict[str, Any], *words: str | Callable[[], None]) -> None:
        """Print the answer: the document, or lines and the output of functions."""
        if self.as_json:
            print_json(document)
            return
        for each in words:
            if isinstance(each, str):
                say(each)
            else:
                each()

    def add(self, *lines: str) -> None:
        """Print lines that do not belong to the document."""
        say(*lines, err=self.as_json)

    def add_files(self, what: str, folder: Path | str, *files: str, pictures: bool = True) -> None:
        """Print a folder's content, such as `page and pictures are`, with names; then why there are no pictures."""
        self.add(f"{what} in {folder}/{': ' if files else ''}{', '.join(files)}")
        if not pictures:
            say_no_pictures()


@dataclass(frozen=True, slots=True, kw_only=True)
class RobotOptions(AnswerOptions):
    """Options of a command about a robot: its file, and the form of the answer."""

    robot_file: RobotFile = None

    def robot_and_rest(self, words: list[str] | None) -> "tuple[Robot, list[str]]":
        """Return the robot and the remaining words of a command line: without a file, the first word is the robot.

        Raises:
            InputError: no robot is given, or its file is invalid.
        """
        from steptwin.host.robots import load_robot, load_robot_file

        if self.robot_file is not None:
            return load_robot_file(self.robot_file), words or []
        if not words:
            raise InputError("ROBOT is missing: a robot's name, or --robot-file FILE")
        return load_robot(words[0]), words[1:]

    def robot(self, name: str | None) -> "Robot":
        """Return the robot of a command without further words; raise as `robot_and_rest`, or if two are given."""
        robot, rest = self.robot_and_rest([] if name is None else [name])
        if rest:
            raise InputError(f"ROBOT '{rest[0]}' and --robot-file {self.robot_file}: give only one of them")
        return robot

    def robot_and_joints(self, words: list[str] | None) -> "tuple[Robot, list[float]]":
        """Return the robot and the positions of all its joints from a command line; raise as `robot_and_rest`."""
        robot, rest = self.robot_and_rest(words)
        return robot, joint_values(rest, robot.joint_names, f"joints of {robot.name}")

    def robot_and_file(self, words: list[str] | None, needed: str) -> "tuple[Robot, str]":
        """Return the robot and the one word after it from a command line; raise as `robot_and_rest`."""
        robot, rest = self.robot_and_rest(words)
        if len(rest) != 1:
            raise InputError(f"one {needed} is needed after the robot, not {' '.join(rest) or 'nothing'}")
        return robot, rest[0]

    def tell_of(self, robot: "Robot", document: dict[str, Any], *words: str | Callable[[], None]) -> None:
        """Print the answer as `tell`, with the robot's name first in the document."""
        self.tell({"robot": robot.name, **document}, *words)


def joint_values(texts: list[str], names: tuple[str, ...], what: str) -> list[float]:
    """Return joint positions from the command line, in mm and degrees.

    Raises:
        InputError: a text is not a number, or there are too few or too many.
    """
    values = [finite_number(text, what) for text in texts]
    check_one_each(values, names, what)
    return values


def check_one_each(values: Collection[object], names: tuple[str, ...], what: str) -> None:
    """Raise InputError unless there is one value for each joint."""
    if len(values) != len(names):
        raise InputError(f"{what}: {len(values)} values for the {len(names)} joints {' '.join(names)}")


def finite_number(text: str, what: str) -> float:
    """Return a finite number up to 1e9 in size; raise InputError for anything else."""
    with prefixed(f"{what}: "):
        return numbers.finite_number(text)


def positive_number(text: str, what: str) -> float:
    """Return a number above 0 and up to 1e9; raise InputError for anything else."""
    value = finite_number(text, what)
    if not value > 0:
        raise InputError(f"{what}: {value:g} is not above 0")
    return value


def check_percent(percent: float, option: str) -> None:
    """Raise InputError for a speed above 0 and below 1 percent, probably meant as a fraction."""
    if 0 < percent < 1:
        part = f"{percent:g} % of the speed; for {percent:g} of it write {option} {100 * percent:g}"
        raise InputError(f"{option} {percent:g}: is {part}; the least is 1")


def keep_files(paths: Iterable[Path], *, replace: bool) -> None:
    """Raise InputError, with a free name, if a file would be replaced without permission; call it before the work.

    Pipes and devices have no content to lose.
    """
    for path in paths:
        if path.is_file() and not replace:
            raise InputError(f"{path}: exists: take another name, or --replace")


def out_folder(out: str, files: Iterable[str] = ()) -> Path:
    """Create the folder of --out before the work.

    Raises:
        InputError: the folder cannot be created or written, or a folder has the name of one of the files.
    """
    from steptwin.host.record.folder import prepare_folder

    with naming_options("out"):
        return prepare_folder(out, files)


def run_folder(out: str) -> Path:
    """Create the folder of --out for the files of a run, as `out_folder`; it must not have a live board's recording."""
    from steptwin.host.record.folder import keep_recording, run_files

    with naming_options("out"):
        keep_recording(out)
    return out_folder(out, run_files())


def chosen_names(option: str, texts: list[str], choices: Iterable[str]) -> list[str]:
    """Return the names of a repeatable option NAME,..., in the given order.

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


def positions_path(robot: "Robot", file: str | None) -> str:
    """Return the path of the file with a robot's positions."""
    from steptwin.host.planning.programs.positions import default_file

    return default_file(robot) if file is None else file


def saved_position(robot: "Robot", name: str | None, file: str | None) -> "Position | None":
    """Return the position named by --to and --file; None without --to. Raise InputError if it does not exist."""
    from steptwin.host.planning.programs.positions import find_position, read_positions

    if name is None:
        if file is not None:
            raise InputError(f"--file {file}: is for --to NAME")
        return None
    path = positions_path(robot, file)
    return find_position(read_positions(path, robot), name, path)


@dataclass(frozen=True, slots=True)
class PlanningOptions:
    """Time limit of a command that plans."""

    plan_within: float | None = option(
        "SECONDS", f"Processor time that planning may take; by default {PLANNING_S:g}.", read=positive_number
    )

    @contextmanager
    def bounded(self) -> Iterator[None]:
        """Limit the planning time in the block."""
        try:
            with plan_within(self.plan_within or PLANNING_S):
                yield
        except PlanningTimeError as error:
            raise PlanningTimeError(with_options(str(error), "plan_within")) from error


@dataclass(frozen=True, slots=True)
class CheckedFile:
    """A checked file: results as a JSON document and as text, for `AnswerOptions.tell`; or nothing.

    Attributes:
        document: results.
        words: results as lines, or as functions that print more.
        advice: remedy for the errors.
    """

    document: dict[str, Any] = field(default_factory=dict)
    words: tuple[str | Callable[[], None], ...] = ()
    advice: tuple[str, ...] = ()


_KEYS: Final = {
    "rpy": "rpy_deg",
    "quaternion": "quaternion_xyzw",
    "rotvec": "rotvec_deg",
    "abc": "abc_deg",
    "direction": "direction",
}
"""Keys of files for the options."""


Numbers = tuple[float, ...]


def _numbers(text: str, name: str) -> Numbers:
    return tuple(finite_number(word, name) for word in text.replace(",", " ").split())


@dataclass(frozen=True, slots=True)
class OrientationOptions:
    """Orientation of a tool that turns in space; at most one option is given."""

    rpy: Numbers | None = option("'R P Y'", "Roll, pitch, yaw about the fixed x, y, z in deg: Rz Ry Rx.", read=_numbers)
    quaternion: Numbers | None = option("'X Y Z W'", "Unit quaternion, scalar last.", read=_numbers)
    rotvec: Numbers | None = option("'X Y Z'", "Axis, as long as the angle in deg.", read=_numbers)
    abc: Numbers | None = option("'A B C'", "KUKA's angles: yaw, pitch, roll in deg.", read=_numbers)
    direction: Numbers | None = option("'X Y Z'", "Where the tool points, for arms of five axes.", read=_numbers)

    def orientation(self) -> "Orientation | None":
        """Return the orientation; None without one. Raise InputError for two, or for invalid numbers."""
        from steptwin.host.robots.poses import Orientation

        given = {name: values for name in _KEYS if (values := getattr(self, name)) is not None}
        if not given:
            return None
        (name, values), *others = given.items()
        if others:
            raise InputError(f"--{others[0][0]}: beside --{name}; a pose has one orientation")
        with prefixed(f"--{name}: "):
            return Orientation(_KEYS[name], values)


def naming_machine_options(*parameters: str, **options: str) -> AbstractContextManager[None]:
    """Use the command line's option names in errors about the machine, and about further parameters."""
    classes = (MachineOptions, *(made() for _, made in giving("machine_options")))
    spelled = {
        field.name: f"--machine {field.metadata[SPELLING].key}="
        for made in classes
        for field in fields(made)
        if SPELLING in field.metadata
    }
    return naming_options(*parameters, **spelled, **options)


def check_start_positions(robot: "Robot", machine: MachineOptions) -> None:
    """Raise InputError if `stand-at` is given without a position for each joint."""
    if machine.stand_at is not None:
        check_one_each(machine.stand_at, robot.joint_names, "--machine stand-at")


def machine_for(robot: "Robot", machine: MachineOptions) -> MachineOptions:
    """Return the machine's options with their files read; warn of settings of the robot's file that do not apply.

    Raises:
        InputError: the number of joints is wrong, the drivers do not exist, or a file is invalid.
    """
    from steptwin.host.twin.machine.drivers import settings_left_out

    check_start_positions(robot, machine)
    extras = read_extras(machine.extras, robot)
    if keys := settings_left_out(robot, machine.driver_profile):
        usual = f"has its usual settings, not the robot's {', '.join(keys)}"
        warn(f"--machine driver-profile={machine.driver_profile}: {usual}")
    return replace(machine, extras=extras)
