"""Share the parts of all pictures: style, headings, the choice of axes, and thinning of long series.

Figures are made without pyplot, which needs a window system and keeps global state.
"""

import warnings
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.axis import Axis
from matplotlib.figure import Figure
from matplotlib.text import Text

from steptwin.host.common.arrays import FloatArray
from steptwin.host.common.whole_file import whole_file
from steptwin.host.record.path_error import heading
from steptwin.host.verify import Comparison, RunInfo
from steptwin.host.verify.deviation import critical_instants
from steptwin.protocol.timer import COUNTS_PER_SECOND


@dataclass(frozen=True, slots=True)
class PlotMoment:
    """An instant in motion time and the span shown around it, half of the span on each side."""

    at_s: float
    span_s: float

    @property
    def from_s(self) -> float:
        """Beginning of the part."""
        return self.at_s - self.span_s / 2.0

    @property
    def to_s(self) -> float:
        """End of the part."""
        return self.at_s + self.span_s / 2.0

    @property
    def label(self) -> str:
        """Label of the axis of `shown_ms`."""
        return around(self.at_s, decimals=6)

    def shown_ms(self, times_s: FloatArray) -> FloatArray:
        """Return motion times in milliseconds relative to the instant."""
        shown: FloatArray = 1e3 * (times_s - self.at_s)
        return shown


@dataclass(frozen=True, slots=True)
class PlotView:
    """The part of a run that a user asks for; None leaves the choice to the picture.

    Attributes:
        at_s: middle of a close-up.
        span_s: its width.
        frames: whether the picture in space has the frames of base, joints and tool.
    """

    at_s: float | None = None
    span_s: float | None = None
    frames: bool = False

    def moment(self, comparison: Comparison, intervals: int) -> PlotMoment:
        """Return the part to show: by default around the fastest pulses, `intervals` of their intervals long.

        Pulses count whether the driver accepts them or not. At an instant that the user asks for, the axis that is
        fastest there decides the span, which is never longer than the whole motion.
        """
        duration_s = comparison.expected.trajectory.duration_s
        if self.at_s is None:
            interval_s, at_s = _fastest(comparison)
        else:
            interval_s, at_s = _shortest_at(comparison, self.at_s), self.at_s
        return PlotMoment(at_s, min(intervals * interval_s, duration_s) if self.span_s is None else self.span_s)


def around(at_s: float, decimals: int = 4) -> str:
    """Return the label of an axis of time that zooms in on an instant and shows milliseconds from it."""
    return f"around t = {at_s:.{decimals}f} s, in ms"


def interval_around(times_s: FloatArray, at_s: float) -> float | None:
    """Return the length of the interval around an instant; None before the first time and after the last."""
    after = int(np.searchsorted(times_s, at_s))
    return float(times_s[after] - times_s[after - 1]) if 0 < after < times_s.size else None


def pulse_times(comparison: Comparison, axis: int) -> FloatArray:
    """Return when STEP rose, from the motion's start on, whether the driver counted the pulse or not."""
    rises = comparison.evidence.axes[axis].clk_rise_counts - comparison.evidence.start_counts
    times_s: FloatArray = rises[rises >= 0] / COUNTS_PER_SECOND
    return times_s


def _fastest(comparison: Comparison) -> tuple[float, float]:
    """Return the shortest interval of any axis and its middle; the whole motion if no axis has an interval."""
    duration_s = comparison.expected.trajectory.duration_s
    found = [_shortest(comparison, i) for i in range(len(comparison.axis_names))]
    return min((one for one in found if one), default=(duration_s, duration_s / 2.0))


def _shortest_at(comparison: Comparison, at_s: float) -> float:
    """Return the shortest interval of all axes at an instant; the whole motion if no axis has an interval."""
    times = [pulse_times(comparison, i) for i in range(len(comparison.axis_names))]
    intervals_s = [_interval_s(time_s, at_s) for time_s in times if time_s.size > 1]
    return min(intervals_s, default=comparison.expected.trajectory.duration_s)


def _shortest(comparison: Comparison, axis: int) -> tuple[float, float] | None:
    """Return one axis' shortest interval between pulses without a change of DIR, and its middle."""
    times_s = pulse_times(comparison, axis)
    turns_s = (comparison.evidence.axes[axis].dir_edge_counts - comparison.evidence.start_counts) / COUNTS_PER_SECOND
    same_way = np.flatnonzero(np.diff(np.searchsorted(turns_s, times_s)) == 0)
    if same_way.size == 0:
        return None
    intervals_s = np.diff(times_s)
    first = int(same_way[np.argmin(intervals_s[same_way])])
    return float(intervals_s[first]), float(times_s[first : first + 2].mean())


def _interval_s(times_s: FloatArray, at_s: float) -> float:
    """Return the interval between the two pulses around an instant, or the nearest interval."""
    first = int(np.clip(np.searchsorted(times_s, at_s) - 1, 0, times_s.size - 2))
    return float(times_s[first + 1] - times_s[first])


DOTS_PER_INCH = 120
WIDTH_INCHES = 10.0
HEADING_INCHES = 0.9
SAMPLES = 2001
"""Number of instants when planned curves are drawn."""
COLUMNS = 700
"""Number of columns of an envelope: about the width of a wide plot in pixels."""

PLANNED = "0.72"
"""Colour of planned curves: light grey; drawn broad, so that counted curves remain visible on them in print."""
COUNTED = "#0b3c6f"
"""Colour of counted curves: dark blue, nearly black in greyscale."""
LIMIT = "#a02010"

NO_MOTION = "no joint moves"

STYLE: Any = {  # Any: matplotlib spells out every key as a literal type in some versions and none in others
    "axes.axisbelow": True,
    "axes.grid": True,
    "axes.spines.right": False,
    "axes.spines.top": False,
    "axes.titlesize": 10,
    "axes.labelsize": 9,
    "figure.titlesize": 12,
    "font.family": "DejaVu Sans",
    "font.size": 9,
    "grid.color": "0.9",
    "legend.fontsize": 8,
    "legend.frameon": False,
    "lines.linewidth": 1.0,
    "svg.hashsalt": "steptwin",  # without it an SVG file's identifiers differ each time
}


def new_figure(run: RunInfo, what: str, height_inches: float) -> Figure:
    """Return an empty figure whose heading names the run and the picture, and says that the run is simulated."""
    figure = Figure(figsize=(WIDTH_INCHES, height_inches + HEADING_INCHES), layout="constrained")
    figure.suptitle(heading(run, what), x=0.01, ha="left", weight="bold")
    return figure


def plain_texts(artist: Artist) -> None:
    """Let texts appear as they stand: names from files, such as `$x^$`, are no formulas; only tick labels hold some."""
    if isinstance(artist, Text):
        artist.set_parse_math(False)
    for child in [artist.label, artist.offsetText] if isinstance(artist, Axis) else artist.get_children():
        plain_texts(child)


def save_figure(figure: Figure, path: Path, metadata: Mapping[str, Any]) -> None:
    """Write a picture."""
    plain_texts(figure)
    layout = figure.get_layout_engine()
    if layout and path.suffix == ".png":  # else `savefig` would draw it twice, once only to lay it out
        figure.set_dpi(DOTS_PER_INCH)
        layout.execute(figure)
        figure.set_layout_engine(None)
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", message="Glyph .* missing from font")  # drawn as an empty box
        with whole_file(path) as file:
            figure.savefig(file, format=path.suffix[1:], dpi=DOTS_PER_INCH, metadata=dict(metadata))


def rows_of_axes(figure: Figure, rows: int, columns: int = 1, **options: Any) -> list[list[Axes]]:
    """Return a grid of axes with a common x axis; with 0 rows, one row that says that no joint moves."""
    grid = figure.subplots(max(rows, 1), columns, squeeze=False, **({"sharex": True} | options))
    if rows == 0:
        write_inside(grid[0, 0], NO_MOTION)
    return [list(row) for row in grid]


def rows_of_joints(
    comparison: Comparison, run: RunInfo, what: str, row_inches: float, columns: int = 1, **options: Any
) -> tuple[Figure, list[list[Axes]], list[int]]:
    """Return a figure with a row of axes for each moving joint and a note of the others; the rows; these joints."""
    moving = moving_axes(comparison)
    figure = new_figure(run, what, row_inches * max(len(moving), 1))
    note_still_axes(figure, comparison, moving)
    return figure, rows_of_axes(figure, len(moving), columns, **options), moving


def write_inside(axes: Axes, text: str, **options: Any) -> None:
    """Write a text into the middle of axes that show nothing else."""
    axes.text(0.5, 0.5, text, transform=axes.transAxes, ha="center", va="center", **options)


def moving_axes(comparison: Comparison) -> list[int]:
    """Return the axes that should have made a pulse or made one."""
    return [
        i
        for i, evidence in enumerate(comparison.evidence.axes)
        if len(comparison.ideal[i].signs) or len(evidence.clk_rise_counts)
    ]


def note_still_axes(figure: Figure, comparison: Comparison, moving: Sequence[int]) -> None:
    """Write below the picture which joints it leaves out and where they stand."""
    positions = comparison.expected.trajectory.positions(np.zeros(1))[0]
    joint_of, units = comparison.expected.coupling.joint_of, comparison.expected.joint_units
    still = [
        f"{name} at {positions[joint_of(i)]:g} {units[joint_of(i)]}"
        for i, name in enumerate(comparison.axis_names)
        if i not in moving
    ]
    if still:
        figure.supxlabel(f"Not shown, because without motion: {', '.join(still)}", size=8, x=0.01, ha="left")


def planned_instants(comparison: Comparison) -> FloatArray:
    """Return evenly spaced instants over the whole motion."""
    return np.linspace(0.0, comparison.expected.trajectory.duration_s, SAMPLES)


def drawn_instants(comparison: Comparison) -> FloatArray:
    """Return every instant when an error may be largest, and enough others to draw the curve between."""
    return np.union1d(critical_instants(comparison), planned_instants(comparison))


def envelope(t_s: FloatArray, values: FloatArray, end_s: float) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Reduce a dense series for drawing to one instant, least and greatest value for each column of a picture.

    A line through thousands of edges would show patterns of the picture's own raster instead. Each column includes the
    neighbours on both sides, so that the curve between two instants is drawn too.
    """
    borders_s = np.linspace(0.0, end_s, COLUMNS + 1)
    first = np.maximum(np.searchsorted(t_s, borders_s[:-1]) - 1, 0)
    last = np.minimum(np.searchsorted(t_s, borders_s[1:], side="right"), len(t_s) - 1)
    parts = [values[..., a : b + 1] for a, b in zip(first, last, strict=True)]
    lows, highs = (np.array([extreme(part) for part in parts]) for extreme in (np.min, np.max))
    return (borders_s[:-1] + borders_s[1:]) / 2.0, lows, highs


def thinned(t_s: FloatArray, values: FloatArray, groups: int = 4000) -> tuple[FloatArray, FloatArray]:
    """Reduce a series for drawing to the extremes of each group of neighbours: no peak is lost."""
    size = len(values) // groups
    if size < 4:
        return t_s, values
    whole = values[: size * groups].reshape(groups, size)
    extremes = np.sort([whole.argmin(axis=1), whole.argmax(axis=1)], axis=0).T
    index = (extremes + size * np.arange(groups)[:, None]).ravel()
    index = np.concatenate([index, np.arange(size * groups, len(values))])
    return t_s[index], values[index]
