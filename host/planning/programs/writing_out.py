"""Write a program's repetitions and calls out: its steps in the order in which they are made."""

from collections.abc import Iterator
from typing import NamedTuple

from steptwin.host.planning.programs.program import AnyStep, Call, Program, Repeat, WrongStep
from steptwin.host.planning.programs.steps import Step


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
