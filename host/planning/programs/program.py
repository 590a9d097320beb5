"""A program: named positions, named sequences of steps, and the steps themselves."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Final, NamedTuple

from steptwin.host.planning.programs.positions import Position, Target
from steptwin.host.planning.programs.steps import Step

STEPS_MAX: Final = 5_000
"""Number of steps, with repetitions and calls written out, that a program may have."""


@dataclass(frozen=True, slots=True)
class Repeat:
    """Steps that are made several times."""

    times: int
    steps: tuple["AnyStep", ...]


@dataclass(frozen=True, slots=True)
class Call:
    """The steps of a named sequence."""

    sequence: str


@dataclass(frozen=True, slots=True)
class WrongStep:
    """A step about which there is a finding already; it keeps its number for the others.

    Attributes:
        moves: True if the position of the robot is unknown after it.
    """

    moves: bool


AnyStep = Step | Repeat | Call | WrongStep


@dataclass(frozen=True, slots=True)
class Program:
    """A program as its file describes it.

    Attributes:
        title: one line that says what it does; may be empty.
        robot: name of the robot for which it was written, or path of its file; None if it does not say.
        start: position where it begins; None for the robot's home position.
        positions: positions by name, with those of the file that it names; None for one that is wrong.
        positions_for: name of the robot for which the file's positions were saved; None if there is none.
        sequences: sequences of steps by name, for `call`.
        steps: the steps.
        folder: folder from which the paths in it count.
        starts: False if the position where it begins is wrong.
        has_all_names: False if positions or sequences are missing because they could not be read.
    """

    title: str
    robot: str | None
    start: Target | None
    positions: Mapping[str, Position | None]
    positions_for: str | None
    sequences: Mapping[str, tuple[AnyStep, ...]]
    steps: tuple[AnyStep, ...]
    folder: Path = Path()
    starts: bool = True
    has_all_names: bool = True


class Place(NamedTuple):
    """Where a step stands in its program.

    Attributes:
        number: number of the step, behind those of the repetitions and calls it is in, as in `3.2`.
        passes: the pass of each of these repetitions, from 1 on; those that are made once do not count.
    """

    number: str
    passes: tuple[int, ...] = ()

    def __str__(self) -> str:
        return f"step {self.number}" + (f", pass {self.pass_text}" if self.passes else "")

    @property
    def pass_text(self) -> str:
        """The passes as a text, such as `2` or, for a repetition in a repetition, `2.1`."""
        return ".".join(map(str, self.passes))


class Written(NamedTuple):
    """A step that is made at a place of the program."""

    place: Place
    step: Step | WrongStep


def written_out(program: Program) -> Iterator[Written]:
    """Yield the steps of a program whose names have been checked, so that no sequence calls itself."""
    return _written(program, program.steps, Place(""))


def _written(program: Program, steps: tuple[AnyStep, ...], above: Place) -> Iterator[Written]:
    for index, step in enumerate(steps, 1):
        place = above._replace(number=f"{above.number}{index}")
        inner = above._replace(number=f"{place.number}.")
        match step:
            case Repeat(times, repeated):
                for number in range(1, times + 1):
                    passes = (*above.passes, number) if times > 1 else above.passes
                    yield from _written(program, repeated, inner._replace(passes=passes))
            case Call(name):
                yield from _written(program, program.sequences[name], inner)
            case _:
                yield Written(place, step)
