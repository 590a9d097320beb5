"""A program: named positions, named sequences of steps, the steps, and its robot."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Any, Final, NamedTuple

from steptwin.host.common.bad_input import nearest, prefixed, unknown
from steptwin.host.common.errors import InputError
from steptwin.host.common.features import giving
from steptwin.host.common.file_values import OneOf, ReadBy, TableList, Within
from steptwin.host.common.findings import Part
from steptwin.host.common.own_files import is_file
from steptwin.host.planning.drives import AskedLimits
from steptwin.host.planning.programs.pallets import Cells, Pallet, cell_numbers
from steptwin.host.planning.programs.positions import Position, Target
from steptwin.host.planning.programs.steps import VERBS, Step, StepTable
from steptwin.host.robots import SUFFIX, load_robot, load_robot_file, robot_names
from steptwin.host.robots.robot import Robot

STEPS_MAX: Final = 5_000
"""Largest number of a program's steps, with repetitions and calls expanded."""


@dataclass(frozen=True, slots=True)
class Repeat(StepTable):
    """Steps that are made several times.

    Attributes:
        repeat: how many times.
        steps: the steps.
    """

    repeat: Annotated[int, Within(1, 10_000)]
    steps: "Steps"


def _read_pallets(value: object, _: object) -> tuple[str, ...]:
    names = [value] if isinstance(value, str) else value
    if not isinstance(names, list) or not names or not all(isinstance(name, str) for name in names):
        raise InputError("is the name of a pallet, or a list of names")
    return tuple(names)


def _pallets_schema() -> dict[str, Any]:
    return {"oneOf": [{"type": "string"}, {"type": "array", "items": {"type": "string"}, "minItems": 1}]}


@dataclass(frozen=True, slots=True)
class Each(StepTable):
    """Steps that are made for each cell of a pallet, or of several with as many cells at once.

    Attributes:
        each: name of the pallet, or names of pallets.
        steps: the steps.
        cells: the cells to visit, such as `3..7`; without it all.
    """

    each: Annotated[tuple[str, ...], ReadBy(_read_pallets, _pallets_schema)]
    steps: "Steps"
    cells: str | None = None


@dataclass(frozen=True, slots=True)
class Call(StepTable):
    """The steps of a named sequence.

    Attributes:
        call: name of the sequence.
    """

    call: str


@dataclass(frozen=True, slots=True)
class WrongStep:
    """A step with an error; it keeps its number.

    Attributes:
        moves: True if the position of the robot is unknown after it.
    """

    moves: bool

    @classmethod
    def if_wrong(cls, step: Any) -> Any:
        """Return a step that has been read, or what stands for it if it could not be read as a whole."""
        return cls(getattr(step, "moves", True)) if step is None or isinstance(step, Part) else step


def step_models() -> dict[str, Any]:
    """Return the models of all steps, also those of features, by their verbs."""
    of_features = {verb: model for _, given in giving("program_steps") for verb, model in given().items()}
    return {**VERBS, "call": Call, **of_features, "repeat": Repeat, "each": Each}


_OTHER_WORDS: Final = dict.fromkeys(("wait_s", "pause_s", "sleep", "delay", "dwell"), "pause")
"""Words that authors write for a verb."""

AnyStep = Annotated[Step | Repeat | Each | Call | WrongStep, OneOf("step", step_models, _OTHER_WORDS)]
Steps = Annotated[tuple[AnyStep, ...], TableList("step", STEPS_MAX, WrongStep.if_wrong)]


@dataclass(frozen=True, slots=True)
class Program:
    """A program as its file describes it.

    Attributes:
        title: one line that says what it does; may be empty.
        robot: name of its robot, or path of the robot's file; None if it is missing.
        start: start position; None for the robot's home position.
        positions: positions by name, with those of the named file; None for an invalid one.
        positions_for: name of the robot of the positions' file; None without one.
        sequences: sequences of steps by name, for `call`.
        steps: the steps.
        pallets: pallets by name; None for an invalid one.
        limits: limits of its fastest steps besides the joints'; None: none.
        expects: what features expect at the end, by their keys of the file.
        folder: folder where its relative paths begin.
        starts: False if the start position is invalid.
        has_all_names: False if positions or sequences are missing because they are invalid.
    """

    title: str
    robot: str | None
    start: Target | None
    positions: Mapping[str, Position | None]
    positions_for: str | None
    sequences: Mapping[str, tuple[AnyStep, ...]]
    steps: tuple[AnyStep, ...]
    pallets: Mapping[str, Pallet | None] = field(default_factory=dict)
    limits: AskedLimits | None = None
    expects: Mapping[str, Any] = field(default_factory=dict)
    folder: Path = Path()
    starts: bool = True
    has_all_names: bool = True


class Place(NamedTuple):
    """The place of a step in its program.

    Attributes:
        number: number of the step, after those of its repetitions and calls, as in `3.2`.
        passes: pass of each repetition, from 1 on, or cell of a pallet; repetitions with one pass do not count.
    """

    number: str
    passes: tuple[int | str, ...] = ()

    def __str__(self) -> str:
        return f"step {self.number}" + (f", {self.pass_word} {self.pass_text}" if self.passes else "")

    @property
    def pass_word(self) -> str:
        """Word for a pass."""
        return "cell" if any(isinstance(each, str) for each in self.passes) else "pass"

    @property
    def pass_text(self) -> str:
        """The passes as text, such as `2` or, for a repetition in a repetition, `2.1`; `2,1,1` for a cell."""
        return ".".join(map(str, self.passes))


class Written(NamedTuple):
    """A step at a place of the program, at cells of pallets."""

    place: Place
    step: Step | WrongStep
    cells: Cells


def written_out(program: Program) -> Iterator[Written]:
    """Yield the steps of a program with checked names, so no sequence calls itself."""
    return _written(program, program.steps, Place(""), {})


def _written(program: Program, steps: tuple[AnyStep, ...], above: Place, cells: Cells) -> Iterator[Written]:
    for index, step in enumerate(steps, 1):
        place = above._replace(number=f"{above.number}{index}")
        inner = above._replace(number=f"{place.number}.")
        match step:
            case Repeat(times, repeated):
                for number in range(1, times + 1):
                    passes = (*above.passes, number) if times > 1 else above.passes
                    yield from _written(program, repeated, inner._replace(passes=passes), cells)
            case Each(pallets, repeated):
                first = visited(program, step)
                for number in first:
                    pallet = program.pallets[pallets[0]]
                    passes = (*above.passes, pallet.labels[number] if pallet else "")
                    now = {**cells, **dict.fromkeys(pallets, number)}
                    yield from _written(program, repeated, inner._replace(passes=passes), now)
            case Call(name):
                yield from _written(program, program.sequences[name], inner, cells)
            case _:
                yield Written(place, step, cells)


def visited(program: Program, each: Each) -> range:
    """Return the numbers of the cells that `each` visits; raise InputError for cells or pallets that do not fit.

    The pallets must exist.
    """
    counts = {name: len(pallet.cells) for name in each.each if (pallet := program.pallets[name])}
    if len(set(counts.values())) > 1:
        words = " and ".join(f"{name} has {count}" for name, count in counts.items())
        raise InputError(f"each: pallets that are visited at once have as many cells: {words}")
    count = min(counts.values(), default=0)
    return range(count) if each.cells is None else cell_numbers(each.cells, each.each[0], count)


def load_own_robot(program: Program) -> Robot:
    """Return a program's robot; raise InputError if it names none, or an unknown or invalid one."""
    if program.robot is None:
        raise InputError("robot: is missing: name it in the file, or behind it")
    if program.robot.endswith(SUFFIX):
        with prefixed("robot: "):
            return _load_file(program, program.robot)
    if program.robot not in robot_names():
        if _is_beside(program):
            raise InputError(f"robot: {program.robot!r} is unknown: {_beside_words(program)}")
        raise unknown("robot:", program.robot, robot_names())
    return load_robot(program.robot)


def check_own_robot(program: Program, robot: Robot) -> None:
    """Raise InputError if a program or its file of positions is for another robot."""
    given = program.robot
    if given is not None and given != robot.name:
        if not given.endswith(SUFFIX):
            hint = f"; {_beside_words(program)}" if _is_beside(program) else ""
            raise InputError(f"robot: the program is for {given}, not for {robot.name}{hint}")
        own = load_own_robot(program)
        if own.name != robot.name:
            raise InputError(f"robot: the program is for {own.name} in {given}, not for {robot.name}")
    if program.positions_for not in (None, robot.name):
        raise InputError(f"positions_file: its positions are for {program.positions_for}, not for {robot.name}")


def _is_beside(program: Program) -> bool:
    return is_file(program.folder / f"{program.robot}{SUFFIX}")


def _beside_words(program: Program) -> str:
    return f"did you mean {program.robot}{SUFFIX}, the file beside it?"


def _load_file(program: Program, name: str) -> Robot:
    path = program.folder / name
    if not is_file(path):
        beside = [file.stem for file in path.parent.glob(f"*{SUFFIX}")] if path.parent.is_dir() else []
        near = [f"{name}{SUFFIX}" for name in nearest(path.stem, beside)]
        hint = f": did you mean {' or '.join(near)}?" if near else ", counted from the program's folder"
        raise InputError(f"{path}: there is no such file{hint}")
    return load_robot_file(path)
