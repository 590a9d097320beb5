"""A paper as data: its figures, tables and equations, each with the paper's values and the functions that compute ours.

Nothing is computed here. Every function takes the paper's study, S, which holds what its items share; `evaluated` calls
them.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Final, Generic, TypeVar

from steptwin.host.common.arrays import FloatArray
from steptwin.host.studies.papers.runs import Runs
from steptwin.host.twin.embedded.outcome import Outcome

S = TypeVar("S")

READ_OFF: Final = "read off"
STATED: Final = "stated"
DERIVED: Final = "derived"


@dataclass(frozen=True, slots=True)
class Value(Generic[S]):
    """A number of the paper beside ours.

    Attributes:
        what: quantity in a few words.
        unit: its unit; empty for a plain number.
        paper: the paper's value; None if it has none that could be compared.
        ours: function that computes ours.
        tolerance: largest difference with which the two agree.
        decimals: digits behind the point that are shown; the tolerance is not below their last one.
        source: how the paper's value is known: stated, derived from statements, or read off a figure.
    """

    what: str
    unit: str
    paper: float | None
    ours: Callable[[S], float]
    tolerance: float = 0.0
    decimals: int = 0
    source: str = STATED


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
    """A mistake in the paper: where it is, what is printed, what is right, how it was found, and both computed."""

    place: str
    printed: str
    right: str
    found: str
    formulas: tuple[Formula[S], ...] = ()


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
        name: last part of its file's name.
        caption: what it shows.
        panels: function that computes its panels, drawn in rows of `columns`.
        columns: number of panels in a row.
    """

    name: str
    caption: str
    panels: Callable[[S], tuple[Panel, ...]]
    columns: int = 2


@dataclass(frozen=True, slots=True)
class RunPicture:
    """A picture of the run of a job, as `steptwin plot` draws it: the job, the kind of picture, and its caption."""

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

    name: str
    caption: str
    in_space: bool = False


Picture = Plot[S] | RunPicture | WorkspacePicture


@dataclass(frozen=True, slots=True)
class Item(Generic[S]):
    """A figure, table, equation or statement of the paper, or several that belong together.

    Attributes:
        place: where it is in the paper.
        title: what it is about.
        text: what is done here, in Markdown.
        values: the paper's numbers beside ours.
        errata: its mistakes.
        listings: our tables.
        pictures: our pictures.
        not_comparable: why the paper's part cannot be compared, or not all of it; empty if it can.
    """

    place: str
    title: str
    text: str = ""
    values: tuple[Value[S], ...] = ()
    errata: tuple[Erratum[S], ...] = ()
    listings: tuple[Listing[S], ...] = ()
    pictures: tuple[Picture[S], ...] = ()
    not_comparable: str = ""


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
        """The mistakes of all items."""
        return tuple(erratum for item in self.items for erratum in item.errata)


def pulses_of(outcome: Outcome, joint: str) -> int:
    """Return the pulses of a joint's axis; raise KeyError for an unknown joint."""
    return {axis.name: axis.pulses for axis in outcome.report.axes}[joint]


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
        Value(
            "tool off the plan by the counted steps, max", "mm", None,
            lambda study: outcome(study).report.tool.position_error_mm_max, decimals=4,
        ),
        Value("checks of the run that failed", "", None, lambda study: len(outcome(study).report.reasons)),
    )  # fmt: skip


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
