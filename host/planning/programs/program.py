"""A program: named positions, named sequences of steps, and the steps themselves."""

from collections.abc import Mapping
from dataclasses import dataclass

from steptwin.host.planning.programs.positions import Position, Target
from steptwin.host.planning.programs.steps import Step


@dataclass(frozen=True, slots=True)
class Repeat:
    """Steps that are made several times."""

    times: int
    steps: tuple["AnyStep", ...]


@dataclass(frozen=True, slots=True)
class Call:
    """The steps of a named sequence."""

    sequence: str


AnyStep = Step | Repeat | Call


@dataclass(frozen=True, slots=True)
class Program:
    """A program as its file describes it.

    Attributes:
        title: one line that says what it does; may be empty.
        robot: name of the robot for which it was written; None if it does not say.
        start: position at which it begins; None for the robot's home position.
        positions: positions by name, with those of the file that it names.
        positions_for: name of the robot for which the file's positions were saved; None if there is none.
        sequences: sequences of steps by name, for `call`.
        steps: the steps.
    """

    title: str
    robot: str | None
    start: Target | None
    positions: Mapping[str, Position]
    positions_for: str | None
    sequences: Mapping[str, tuple[AnyStep, ...]]
    steps: tuple[AnyStep, ...]
