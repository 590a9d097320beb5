"""A paper as data: its figures, tables and equations, each with the paper's values and what the twin has beside them.

The data of each paper is in its TOML file, read by `paper_file`. Nothing is computed here: what is ours is a function
of the paper's study, which holds what the items share; `evaluated` calls it.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from enum import StrEnum
from typing import TYPE_CHECKING, Any, NamedTuple

from steptwin.host.common.arrays import FloatArray

if TYPE_CHECKING:
    from steptwin.host.studies.papers.study import Runs, Study

Look = Callable[[Any], Any]
"""A function of a study that returns a number, the rows of a table, a picture's panels or a figure."""
Rows = list[list[str]]
"""The rows of a table of the page."""
Figures = Mapping[str, float]
"""Numbers of a study by name, which carries the unit."""


class Source(StrEnum):
    """How a number of the paper is known: stated in it, following from what it states, or read off a figure."""

    STATED = "stated"
    FOLLOWS = "follows"
    READ_OFF = "read off"


class Basis(StrEnum):
    """What a number of ours is compared with: the three are counted apart, since only results prove anything new."""

    DIMENSION = "dimension"
    RESULT = "result"
    CHECK = "self-check"
    ALONE = "alone"


@dataclass(frozen=True, slots=True)
class Value:
    """A number of ours, and what it has to be.

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
        source: how the paper's number is known; None as `place` is empty.
    """

    kind: Basis
    what: str
    ours: Look
    unit: str = ""
    expected: float | None = None
    tolerance: float = 0.0
    decimals: int = 0
    place: str = ""
    source: Source | None = None


class Computed(NamedTuple):
    """A misprinted formula as printed, NaN where it has no value; as corrected; and what it has to be, without it."""

    printed: float
    corrected: float
    truth: float


@dataclass(frozen=True, slots=True)
class Formula:
    """A misprinted formula, to be computed as printed and as corrected.

    Attributes:
        what: quantity that it computes, and where.
        compute: function that returns it as `Computed`.
        truth_from: where the truth is from.
        unit: its unit; empty for a plain number.
        decimals: digits behind the point that are shown.
        tolerance: largest difference from the truth that the corrected formula may have, and the printed one has not.
    """

    what: str
    compute: Look
    truth_from: str
    unit: str = ""
    decimals: int = 3
    tolerance: float = 1e-6


@dataclass(frozen=True, slots=True)
class Erratum:
    """A misprint or a contradiction: its place, what is printed, what is right, how it was found, and both computed."""

    place: str
    printed: str
    right: str
    found: str
    formulas: tuple[Formula, ...] = ()


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
class Listing:
    """A table of ours, such as the paper prints one or should: the first `text_columns` columns are texts."""

    title: str
    columns: tuple[str, ...]
    rows: Look
    text_columns: int = 1


@dataclass(frozen=True, slots=True, eq=False)
class Curve:
    """A line in a panel: its name in the legend, and x and y, of shape (n,); `broken` and `broad` are styles of it."""

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


class PictureKind(StrEnum):
    """What draws a picture: curves, a figure of the study's own, a run's or the workspace's as other commands draw."""

    PLOT = "plot"
    SKETCH = "sketch"
    RUN = "run"
    WORKSPACE = "workspace"


@dataclass(frozen=True, slots=True)
class Picture:
    """A picture that answers a figure of the paper.

    Attributes:
        place: the paper's figure, or section, with its number: it begins the picture's title.
        name: last part of its file's name.
        caption: what it shows.
        kind: what draws it.
        look: function that returns a plot's panels or a sketch's figure.
        job: job of a run's picture.
        view: which picture of a run, as `steptwin plot` names it, or of a workspace: `cloud` or `sections`.
        columns: number of panels of a plot in a row.
    """

    place: str
    name: str
    caption: str
    kind: PictureKind
    look: Look | None = None
    job: str = ""
    view: str = ""
    columns: int = 2


@dataclass(frozen=True, slots=True)
class Item:
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
    values: tuple[Value, ...] = ()
    errata: tuple[Erratum, ...] = ()
    left_open: tuple[Gap, ...] = ()
    lost: tuple[Gap, ...] = ()
    listings: tuple[Listing, ...] = ()
    pictures: tuple[Picture, ...] = ()


@dataclass(frozen=True, slots=True)
class Paper:
    """A paper and its robot.

    Attributes:
        robot: name of the robot.
        citation: authors, title, journal and year, as far as they are known.
        study: function that makes what the items' functions take, from the runs of the robot's jobs.
        items: the paper's parts, in its order.
    """

    robot: str
    citation: str
    study: "Callable[[Runs], Study]"
    items: tuple[Item, ...]

    @property
    def errata(self) -> tuple[Erratum, ...]:
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
