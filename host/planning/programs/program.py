"""A program: named positions, named sequences of steps, and the steps themselves."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

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
        start: position at which it begins; None for the robot's home position.
        positions: positions by name, with those of the file that it names; None for one that is wrong.
        positions_for: name of the robot for which the file's positions were saved; None if there is none.
        sequences: sequences of steps by name, for `call`.
        steps: the steps.
        folder: folder from which the paths in it count.
        starts: False if the position at which it begins is wrong.
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
