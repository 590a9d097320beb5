"""A paper as data: its figures, tables and equations, each with the paper's values and the functions that compute ours.

Nothing is computed here. Every function takes the paper's study, S, which holds what its items share; `evaluated` calls
them.
"""

from collections.abc import Callable
from dataclasses import dataclass
from enum import StrEnum
from typing import TYPE_CHECKING, Final, Generic, TypeVar

from steptwin.host.common.arrays import FloatArray
from steptwin.host.studies.papers.runs import Runs
from steptwin.host.twin.embedded.outcome import Outcome

if TYPE_CHECKING:
    from matplotlib.figure import Figure

S = TypeVar("S")

READ_OFF: Final = "read off"
STATED: Final = "stated"
FOLLOWS: Final = "follows"
"""How a number of the paper is known: stated in it, following from what it states, or read off a figure."""


class Basis(StrEnum):
    """What a number of ours is compared with: the three are counted apart, since only results prove anything new."""

    DIMENSION = "dimension"
    RESULT = "result"
    CHECK = "self-check"
    ALONE = "alone"


@dataclass(frozen=True, slots=True)
class Value(Generic[S]):
    """A number of ours, and what it has to be; made by `dimension`, `result`, `self_check` and `alone`.

    Attributes:
        kind: a dimension that the robot's file takes over from the paper, a result of the paper beside the twin's, a
            check of ours against ourselves, or a number that stands alone.
        what: quantity in a few words.
        unit: its unit; empty for a plain number.
        expected: the paper's number, or what a self-check has to give; None for a number that stands alone.
        ours: function that computes ours.
        tolerance: largest difference with which the two agree.
        decimals: digits behind the point that are shown; the tolerance is not below their last one.
        place: where the paper has its number; empty for self-checks and numbers that stand alone.
        source: how the paper's number is known: STATED, FOLLOWS or READ_OFF; empty as `place` is.
    """

    kind: Basis
    what: str
    unit: str
    expected: float | None
    ours: Callable[[S], float]
    tolerance: float = 0.0
    decimals: int = 0
    place: str = ""
    source: str = ""


def dimension(place: str, what: str, unit: str, paper: float, ours: Callable[[S], float]) -> Value[S]:
    """Return a number that the robot's file takes over from the paper, which has to be the same."""
    return Value(Basis.DIMENSION, what, unit, paper, ours, place=place, source=STATED)


def result(
    place: str, what: str, unit: str, paper: float, ours: Callable[[S], float], tolerance: float = 0.0,
    decimals: int = 0, source: str = STATED,
) -> Value[S]:  # fmt: skip
    """Return a result of the paper beside the twin's own; never computed by us on the paper's side."""
    return Value(Basis.RESULT, what, unit, paper, ours, tolerance, decimals, place, source)


def self_check(
    what: str, unit: str, expected: float, ours: Callable[[S], float], tolerance: float = 0.0, decimals: int = 0
) -> Value[S]:
    """Return a number of ours with what it has to be, of which the paper says nothing: a round trip, an identity."""
    return Value(Basis.CHECK, what, unit, expected, ours, tolerance, decimals)


def alone(what: str, unit: str, ours: Callable[[S], float], decimals: int = 0) -> Value[S]:
    """Return a number of ours with nothing to compare it with."""
    return Value(Basis.ALONE, what, unit, None, ours, decimals=decimals)


@dataclass(frozen=True, slots=True)
class Formula(Generic[S]):
    """A misprinted formula, computed as printed and as corrected.

    Attributes:
        what: quantity that it computes, and where.
        unit: its unit; empty for a plain number.
        printed: function that computes the formula as printed; NaN where it has no value.
        corrected: function that computes it as corrected.
        truth: function that computes what it has to be, without the formula.
        truth_from: where the truth is from.
        decimals: digits behind the point that are shown.
        tolerance: largest difference from the truth that the corrected formula may have, and the printed one has not.
    """

    what: str
    unit: str
    printed: Callable[[S], float]
    corrected: Callable[[S], float]
    truth: Callable[[S], float]
    truth_from: str
    decimals: int = 3
    tolerance: float = 1e-6


@dataclass(frozen=True, slots=True)
class Erratum(Generic[S]):
    """A misprint or a contradiction: its place, what is printed, what is right, how it was found, and both computed."""

    place: str
    printed: str
    right: str
    found: str
    formulas: tuple[Formula[S], ...] = ()


@dataclass(frozen=True, slots=True)
class Gap:
    """What is not there: where it belongs, what it is, and what is done here instead.

    It is no mistake of the paper, but either left open by it or lost in our copy of it.
    """

    place: str
    what: str
    instead: str


class Coverage(StrEnum):
    """Whether an item of the paper is here."""

    YES = "yes"
    PARTLY = "partly"
    NO = "no"


@dataclass(frozen=True, slots=True)
class Part:
    """An item of the paper that a reader may look for: a section, table, equation, figure or statement.

    Attributes:
        place: where the paper has it, with the paper's own number.
        what: what it is.
        how: where the twin has it: a command, a table, a picture.
        answer: whether it is here.
        why: what is missing, and why; empty if nothing is.
    """

    place: str
    what: str
    how: str
    answer: Coverage = Coverage.YES
    why: str = ""


@dataclass(frozen=True, slots=True)
class Listing(Generic[S]):
    """A table of ours, such as the paper prints one or should: the first `text_columns` columns are texts."""

    title: str
    columns: tuple[str, ...]
    rows: Callable[[S], list[list[str]]]
    text_columns: int = 1


@dataclass(frozen=True, slots=True, eq=False)
class Curve:
    """A line in a panel: its name in the legend, and x and y, of shape (n,); `dotted` marks points, `broken` lines."""

    name: str
    x: FloatArray
    y: FloatArray
    style: str = "line"


@dataclass(frozen=True, slots=True, eq=False)
class Panel:
    """Curves with common axes; `true_to_scale` if both axes are lengths of one space."""

    title: str
    x_label: str
    y_label: str
    curves: tuple[Curve, ...]
    true_to_scale: bool = False


@dataclass(frozen=True, slots=True)
class Plot(Generic[S]):
    """A picture of curves that the paper's figure shows.

    Attributes:
        place: the paper's figure, or section, with its number: it begins the picture's title.
        name: last part of its file's name.
        caption: what it shows.
        panels: function that computes its panels, drawn in rows of `columns`.
        columns: number of panels in a row.
    """

    place: str
    name: str
    caption: str
    panels: Callable[[S], tuple[Panel, ...]]
    columns: int = 2


@dataclass(frozen=True, slots=True)
class RunPicture:
    """A picture of a job's run, as `steptwin plot` draws it: the paper's place, the job, the kind, the caption."""

    place: str
    job: str
    kind: str
    caption: str

    @property
    def name(self) -> str:
        """Last part of its file's name."""
        return f"{self.job}-{self.kind}"


@dataclass(frozen=True, slots=True)
class WorkspacePicture:
    """A picture of the robot's workspace, as `steptwin workspace` draws it: in sections, or as a cloud in space."""

    place: str
    name: str
    caption: str
    in_space: bool = False


@dataclass(frozen=True, slots=True)
class Sketch(Generic[S]):
    """A picture that is drawn by a function of the study, from the robot's own frames and bodies.

    Attributes:
        place: the paper's figure with its number: it begins the picture's title.
        name: last part of its file's name.
        caption: what it shows.
        draw: function that draws it, given the study; its figure has no title of its own.
    """

    place: str
    name: str
    caption: str
    draw: Callable[[S], "Figure"]


Picture = Plot[S] | RunPicture | WorkspacePicture | Sketch[S]


@dataclass(frozen=True, slots=True)
class Item(Generic[S]):
    """A section of the page: parts of the paper that belong together.

    Attributes:
        place: where they are in the paper, with its numbers: the section's title begins with it.
        title: what they are about.
        text: what is done here, in Markdown.
        parts: the parts of the paper, each of which the list at the page's beginning answers.
        values: numbers of ours, beside the paper's.
        errata: the paper's misprints and contradictions.
        left_open: what the paper leaves open.
        lost: what our copy lacks.
        listings: our tables.
        pictures: our pictures.
    """

    place: str
    title: str
    text: str = ""
    parts: tuple[Part, ...] = ()
    values: tuple[Value[S], ...] = ()
    errata: tuple[Erratum[S], ...] = ()
    left_open: tuple[Gap, ...] = ()
    lost: tuple[Gap, ...] = ()
    listings: tuple[Listing[S], ...] = ()
    pictures: tuple[Picture[S], ...] = ()


@dataclass(frozen=True, slots=True)
class Paper(Generic[S]):
    """A paper and its robot.

    Attributes:
        robot: name of the robot.
        citation: authors, title, journal and year, as far as they are known.
        study: function that makes what the items' functions take, from the runs of the robot's jobs.
        items: the paper's parts, in its order.
    """

    robot: str
    citation: str
    study: Callable[[Runs], S]
    items: tuple[Item[S], ...]

    @property
    def errata(self) -> tuple[Erratum[S], ...]:
        """The misprints and contradictions of all items."""
        return tuple(erratum for item in self.items for erratum in item.errata)

    @property
    def parts(self) -> tuple[Part, ...]:
        """The parts of all items."""
        return tuple(part for item in self.items for part in item.parts)

    @property
    def left_open(self) -> tuple[Gap, ...]:
        """What the paper leaves open."""
        return tuple(gap for item in self.items for gap in item.left_open)

    @property
    def lost(self) -> tuple[Gap, ...]:
        """What our copy lacks."""
        return tuple(gap for item in self.items for gap in item.lost)


def run_listing(job: str, outcome: Callable[[S], Outcome]) -> Listing[S]:
    """Return the table of a run: a row for each axis, then the tool and the verdict."""
    return Listing(
        f"The run of `{job}` on the emulated board",
        ("axis", "steps at start", "at end", "pulses", "peak steps/s", "error max, steps"),
        lambda study: _rows(outcome(study)),
    )


def tool_values(outcome: Callable[[S], Outcome]) -> tuple[Value[S], ...]:
    """Return the largest error of the tool by the driver's counts, and the verdict; no paper has them."""
    return (
        alone(
            "tool off the plan by the counted steps, max",
            "mm",
            lambda study: outcome(study).report.tool.position_error_mm_max,
            4,
        ),
        self_check("checks of the run that failed", "", 0.0, lambda study: len(outcome(study).report.reasons)),
    )


def _rows(outcome: Outcome) -> list[list[str]]:
    return [
        [
            axis.name,
            str(axis.steps_start),
            str(axis.steps_end),
            str(axis.pulses),
            f"{axis.peak_rate_hz:.1f}" if axis.pulses else "-",
            f"{axis.position_error_steps_max:.4f}" if axis.pulses else "-",
        ]
        for axis in outcome.report.axes
    ]
