"""Common parts of all pictures: style, sheets of panels at fixed places, and thinning of long series.

Figures are made without pyplot, which needs a window system and keeps global state.
"""

import textwrap
import warnings
from collections.abc import Iterable, Mapping, Sequence
from itertools import accumulate
from pathlib import Path
from typing import Any, Final, Literal

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.axis import Axis
from matplotlib.figure import Figure
from matplotlib.text import Text
from matplotlib.transforms import blended_transform_factory

from steptwin.host.common.arrays import FloatArray
from steptwin.host.common.whole_file import whole_file
from steptwin.host.record.path_error import heading
from steptwin.host.record.plots.picture import Picture
from steptwin.host.verify import RunInfo

DOTS_PER_INCH: Final = 120
WIDTH_INCHES: Final = 10.0
"""Width of a figure that is not a Sheet."""

COLUMNS: Final = 640
"""Number of columns of an envelope: about the width of a wide panel in pixels of a small screen."""

PLANNED: Final = "0.72"
"""Colour of planned curves: light grey; drawn broad, so that counted curves remain visible on them in print."""
COUNTED: Final = "#0b3c6f"
"""Colour of counted curves: dark blue, nearly black in greyscale."""
LIMIT: Final = "#a02010"

NO_MOTION: Final = "no joint moves"

STYLE: Any = {  # Any: some versions of matplotlib type every key as a literal, others do not
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
    "svg.hashsalt": "steptwin",  # otherwise an SVG file's identifiers differ each time
}

SHEET_STYLE: Any = STYLE | {  # large letters: on a telephone a sheet of 8 inches is 390 pixels wide
    "axes.titlesize": 12,
    "axes.labelsize": 11,
    "axes.titley": 1.0,  # otherwise matplotlib measures all labels to place the title above them
    "axes.formatter.useoffset": False,
    "figure.titlesize": 13,
    "font.size": 12,
    "legend.fontsize": 11,
    "legend.handlelength": 1.6,
    "legend.columnspacing": 1.4,
    "xtick.labelsize": 11,
    "ytick.labelsize": 11,
}

_SHEET_INCHES: Final = 8.0
_EDGE_INCHES: Final = 0.18
"""Margin between the sheet's edge and its texts."""
LEFT_INCHES: Final = 1.2
"""Margin on the left of a row's first panel, for name with unit and tick labels."""
_APART_INCHES: Final = 1.0
"""Space between two panels of a row, for the same."""
_TICKS_INCHES: Final = 0.74
"""Distance of a label from its panel: the width of seven digits."""
_HEADING_LINE_INCHES, _LINE_INCHES, _HEADS_INCHES, _BELOW_INCHES = 0.25, 0.2, 0.3, 0.6
_HEADING_CHARS, _CHARS = 68, 90
"""Letters in a line of the heading, and of other texts, on a sheet."""
_NAME_CHARS_AN_INCH: Final = 11
"""Letters of a panel's vertical label for each inch of the panel."""


class Sheet:
    """A picture in progress: panels in rows and columns at fixed places.

    Matplotlib's own layouts measure all texts before drawing, which takes as long as drawing.

    Attributes:
        figure: the figure.
        picture: the picture's row of its table.
        run: the run that the heading names.
        band: figure coordinates of the upper left corner of the band between heading and panels.
    """

    figure: Figure
    picture: Picture
    run: RunInfo
    band: tuple[float, float]

    def __init__(self, picture: Picture, run: RunInfo) -> None:
        self.figure, self.picture, self.run = Figure(), picture, run
        self.band = (0.0, 1.0)

    def entitle(self, what: str = "") -> int:
        """Write the heading: run, picture, and that the run is simulated. Return its number of lines."""
        lines = textwrap.wrap(heading(self.run, what or self.picture.title), _HEADING_CHARS, break_long_words=True)
        x, y = _EDGE_INCHES / self.figure.get_figwidth(), 1.0 - 0.12 / self.figure.get_figheight()
        self.figure.suptitle("\n".join(lines), x=x, y=y, ha="left", va="top", weight="bold", linespacing=1.2)
        return len(lines)

    def panels(
        self,
        rows: int,
        *,
        what: str = "",
        heads: Sequence[str] = (),
        note: str = "",
        band_lines: int = 0,
        heights_inches: Sequence[float] = (),
        left_inches: float = LEFT_INCHES,
        right_inches: float = _EDGE_INCHES,
        apart_inches: float = _APART_INCHES,
        share: Literal["all", "column", "none"] = "all",
    ) -> list[list[Axes]]:
        """Return rows of panels; for 0 rows, one panel with the text that no joint moves.

        Args:
            rows: number of rows.
            what: heading in place of the picture's title.
            heads: titles of the columns in place of the picture's.
            note: text below all panels.
            band_lines: number of lines of text, or of a legend, between heading and panels.
            heights_inches: heights of rows that differ from the picture's.
            left_inches: space on the left of the first column.
            right_inches: space on the right of the last column.
            apart_inches: space between columns.
            share: whether all panels have the same horizontal axis, or those of a column, or none.
        """
        picture, figure = self.picture, self.figure
        heights = list(heights_inches) or [picture.row_inches] * max(rows, 1)
        notes = textwrap.wrap(note, _CHARS)
        above, below = picture.above_inches, picture.below_inches
        # A title's number of lines does not depend on the figure's size, but the size depends on it.
        heading_inches = 0.2 + _HEADING_LINE_INCHES * self.entitle(what)
        top = heading_inches + _LINE_INCHES * 1.3 * band_lines + _HEADS_INCHES * any(picture.heads)
        lines_across = max((text.count("\n") for text in picture.across), default=0) + len(notes)
        bottom = max(_BELOW_INCHES - below, 0.12) + _LINE_INCHES * lines_across
        high = top + sum(heights) + len(heights) * (above + below) + bottom
        figure.set_size_inches(_SHEET_INCHES, high)
        self.entitle(what)
        self.band = (_EDGE_INCHES / _SHEET_INCHES, 1.0 - heading_inches / high)
        if notes:
            figure.supxlabel("\n".join(notes), size=10, x=self.band[0], y=0.08 / high, ha="left", va="bottom")
        shares = picture.columns
        room = _SHEET_INCHES - left_inches - right_inches - apart_inches * (len(shares) - 1)
        widths = [room * each / sum(shares) for each in shares]
        lefts = [left_inches + sum(widths[:i]) + i * apart_inches for i in range(len(widths))]
        ends = list(accumulate(height + above + below for height in heights))
        grid: list[list[Axes]] = []
        for n, (height, end) in enumerate(zip(heights, ends, strict=True)):
            y = high - top - end + below
            row: list[Axes] = []
            for column, (x, width) in enumerate(zip(lefts, widths, strict=True)):
                first = grid[0][0 if share == "all" else column] if grid else row[0] if row and share == "all" else None
                place = (x / _SHEET_INCHES, y / high, width / _SHEET_INCHES, height / high)
                axes = figure.add_axes(place, sharex=None if share == "none" else first)
                axes.locator_params(axis="x", nbins=max(2, int(width / 0.75)))
                axes.locator_params(axis="y", nbins=max(2, int(height / 0.36)))
                label_x = (x - _TICKS_INCHES) / _SHEET_INCHES
                axes.yaxis.set_label_coords(label_x, 0.5, blended_transform_factory(figure.transFigure, axes.transAxes))
                label_y = (y - 0.28) / high
                axes.xaxis.set_label_coords(0.5, label_y, blended_transform_factory(axes.transAxes, figure.transFigure))
                if share != "none" and n < len(heights) - 1:
                    axes.tick_params(labelbottom=False)
                row.append(axes)
            grid.append(row)
        for axes, text in zip(grid[0], heads or picture.heads, strict=False):
            axes.text(0.0, 1.0 + (above + 0.1) / heights[0], text, transform=axes.transAxes, weight="bold")
        for axes, text in zip(grid[-1], picture.across, strict=False):
            axes.set_xlabel(text)
        if rows == 0:
            write_inside(grid[0][0], NO_MOTION)
        return grid

    def write(self, text: str, below_inches: float = 0.0, **options: Any) -> None:
        """Write a text into the band between heading and panels, at a distance below its upper edge."""
        x, y = self.band
        y -= below_inches / self.figure.get_figheight()
        self.figure.text(x, y, text, va="top", linespacing=1.3, **options)

    def label(self, axes: Axes, name: str, unit: str) -> None:
        """Write name and unit on the left of a panel, in two lines if they are long."""
        height_inches = axes.get_position().height * self.figure.get_figheight()
        text = f"{name} [{unit}]"
        axes.set_ylabel(text if len(text) <= height_inches * _NAME_CHARS_AN_INCH else f"{name}\n[{unit}]")

    def legend(self, axes: Axes, columns: int) -> None:
        """Write the legend of a panel into the band between heading and panels."""
        x, y = self.band
        self.figure.legend(
            *axes.get_legend_handles_labels(),
            loc="upper left",
            bbox_to_anchor=(x, y),
            borderaxespad=0.0,
            borderpad=0.0,
            ncols=columns,
        )


def room_for(labels: Iterable[str]) -> float:
    """Return the inches that labels need on the left of a panel with lanes."""
    return 0.35 + 0.092 * max((len(line) for label in labels for line in label.split("\n")), default=0)


LANE_HIGH: Final = 0.8
"""Height of the drawing in a lane; the rest is space above it."""


def make_lanes(axes: Axes, labels: Sequence[str]) -> None:
    """Divide a panel into lanes of height 1 below each other, the first one above 0, and label them on the left.

    One panel with lanes is drawn several times faster than a panel for each of them.
    """
    axes.set_yticks([LANE_HIGH / 2 - lane for lane in range(len(labels))], labels)
    axes.tick_params(axis="y", length=0)
    axes.set_ylim(0.9 - max(len(labels), 1), 1.0)
    axes.grid(visible=False, axis="y")


def plain_texts(artist: Artist) -> None:
    """Show texts literally: names from files, such as `$x^$`, are not formulas; only tick labels have some."""
    if isinstance(artist, Text):
        artist.set_parse_math(False)
    for child in [artist.label, artist.offsetText] if isinstance(artist, Axis) else artist.get_children():
        plain_texts(child)


def save_figure(figure: Figure, path: Path, metadata: Mapping[str, Any], dots: float = DOTS_PER_INCH) -> None:
    """Write a picture with `dots` dots per inch."""
    plain_texts(figure)
    layout = figure.get_layout_engine()
    if layout and path.suffix == ".png":  # otherwise `savefig` would draw it twice, once only for the layout
        figure.set_dpi(dots)
        layout.execute(figure)
        figure.set_layout_engine(None)
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", message="Glyph .* missing from font")  # would be drawn as an empty box
        with whole_file(path) as file:
            figure.savefig(file, format=path.suffix[1:], dpi=dots, metadata=dict(metadata))


def write_inside(axes: Axes, text: str, **options: Any) -> None:
    """Write a text into the middle of axes that show nothing else."""
    axes.text(0.5, 0.5, text, transform=axes.transAxes, ha="center", va="center", **options)


def envelope(t_s: FloatArray, values: FloatArray, end_s: float) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Reduce a dense series for drawing to one instant, and least and greatest value, for each column of pixels.

    A line through thousands of edges would show patterns of the picture's own raster instead. Each column includes the
    neighbours on both sides, so that the curve between two instants is drawn too.

    Args:
        t_s: sorted instants, shape (n,).
        values: shape (n,), or (k, n) for several values at each instant.
        end_s: end of the last column; the first one begins at 0.
    """
    borders_s = np.linspace(0.0, end_s, COLUMNS + 1)
    first = np.maximum(np.searchsorted(t_s, borders_s[:-1]) - 1, 0)
    beyond = np.minimum(np.searchsorted(t_s, borders_s[1:], side="right"), len(t_s) - 1) + 1
    parts = np.column_stack([first, beyond]).ravel()
    lowest, highest = (extreme(np.atleast_2d(values), axis=0) for extreme in (np.min, np.max))
    # A part's end may be the series' own, where `reduceat` needs one more value.
    lows = np.minimum.reduceat(np.append(lowest, np.inf), parts)[::2]
    highs = np.maximum.reduceat(np.append(highest, -np.inf), parts)[::2]
    return (borders_s[:-1] + borders_s[1:]) / 2.0, lows, highs


def thinned(t_s: FloatArray, values: FloatArray, groups: int = 4000) -> tuple[FloatArray, FloatArray]:
    """Reduce a series for drawing to the extremes of each group of neighbours; all peaks remain."""
    size = len(values) // groups
    if size < 4:
        return t_s, values
    whole = values[: size * groups].reshape(groups, size)
    extremes = np.sort([whole.argmin(axis=1), whole.argmax(axis=1)], axis=0).T
    index = (extremes + size * np.arange(groups)[:, None]).ravel()
    index = np.concatenate([index, np.arange(size * groups, len(values))])
    return t_s[index], values[index]
