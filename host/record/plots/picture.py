"""Describe, draw and write a picture. Only drawing imports matplotlib."""

from collections.abc import Iterable
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final, NamedTuple

from steptwin.host.verify import RunInfo

if TYPE_CHECKING:
    from matplotlib.figure import Figure


class Picture(NamedTuple):
    """A kind of picture: a row of a table, whose module is imported when it is drawn.

    Attributes:
        name: name of its file, and of the picture on the command line.
        title: title in its heading.
        module: module with its function `draw_NAME`, with `_` for `-`, which takes a Sheet and the subject.
        row_inches: height of a row of panels.
        columns: relative widths of the panels of a row.
        heads: title of each column.
        across: label with unit below each column.
        above_inches: space above each row.
        below_inches: space below each row.
        of_tool: True if it needs a tool.
        close_up: True if it shows the part of a run that a PlotView chooses.
    """

    name: str
    title: str
    module: str
    row_inches: float = 1.3
    columns: tuple[float, ...] = (1.0,)
    heads: tuple[str, ...] = ()
    across: tuple[str, ...] = ()
    above_inches: float = 0.14
    below_inches: float = 0.0
    of_tool: bool = False
    close_up: bool = False


@dataclass(frozen=True, slots=True)
class PlotView:
    """The part of a run to draw; None leaves the choice to the picture.

    Attributes:
        at_s: middle of a close-up.
        span_s: its width.
        frames: True to draw the frames of base, joints and tool in space.
    """

    at_s: float | None = None
    span_s: float | None = None
    frames: bool = False


DEFAULT_VIEW: Final = PlotView()
"""View that leaves the choice to each picture."""

PIXELS: Final = 1280
"""Width of a picture."""

_UNDATED: Final[dict[str, dict[str, None]]] = {"png": {}, "svg": {"Date": None}, "pdf": {"CreationDate": None}}
"""Metadata without a date, so that the same run gives the same bytes."""


def draw_picture(picture: Picture, run: RunInfo, subject: Any) -> "Figure":
    """Return the figure of a picture; `subject` is the argument of its function, such as a ShownRun."""
    from matplotlib import rc_context

    from steptwin.host.record.plots.canvas import SHEET_STYLE, Sheet

    sheet = Sheet(picture, run)
    with rc_context(SHEET_STYLE):
        getattr(import_module(picture.module), f"draw_{picture.name.replace('-', '_')}")(sheet, subject)
    return sheet.figure


def write_pictures(
    folder: Path, pictures: Iterable[Picture], run: RunInfo, subject: Any, form: str = "png"
) -> list[Path]:
    """Draw pictures into a folder, created if missing; return the paths of the files."""
    from matplotlib import rc_context

    from steptwin.host.record.plots.canvas import SHEET_STYLE, save_figure

    folder.mkdir(parents=True, exist_ok=True)
    paths = []
    for picture in pictures:
        figure, path = draw_picture(picture, run, subject), folder / f"{picture.name}.{form}"
        with rc_context(SHEET_STYLE):
            save_figure(figure, path, _UNDATED[form], PIXELS / figure.get_figwidth())
        paths.append(path)
    return paths
