"""Share the parts of all pictures: style, headings, the choice of axes, and thinning of long series.

Figures are made without pyplot, which needs a window system and keeps global state.
"""

import warnings
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.axis import Tick
from matplotlib.figure import Figure
from matplotlib.text import Text

from steptwin.host.common.arrays import FloatArray
from steptwin.host.common.whole_file import whole_file
from steptwin.host.record.heading import heading
from steptwin.host.verify import Comparison, RunInfo
from steptwin.host.verify.deviation import critical_instants

DOTS_PER_INCH = 120
WIDTH_INCHES = 10.0
HEADING_INCHES = 0.9
SAMPLES = 2001
"""Number of instants at which planned curves are drawn."""
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


def plain_texts(figure: Figure) -> None:
    """Let texts appear as they stand: names from files, such as `$x^$`, are no formulas; only tick labels hold some."""
    of_ticks = {label for tick in figure.findobj(Tick) for label in (tick.label1, tick.label2)}
    for text in figure.findobj(Text):
        if text not in of_ticks:
            text.set_parse_math(False)


def save_figure(figure: Figure, path: Path, metadata: Mapping[str, Any]) -> None:
    """Write a picture."""
    plain_texts(figure)
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
    still = [
        f"{name} at {positions[i]:g} {comparison.expected.joint_units[i]}"
        for i, name in enumerate(comparison.joint_names)
        if i not in moving
    ]
    if still:
        figure.supxlabel(f"Not shown, because without motion: {', '.join(still)}", size=8, x=0.01, ha="left")


def planned_instants(comparison: Comparison) -> FloatArray:
    """Return evenly spaced instants over the whole motion."""
    return np.linspace(0.0, comparison.expected.trajectory.duration_s, SAMPLES)


def drawn_instants(comparison: Comparison) -> FloatArray:
    """Return every instant at which an error may be largest, and enough others to draw the curve between."""
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
