"""Write a picture of a page, small enough for a repository."""

from collections.abc import Callable
from io import BytesIO
from pathlib import Path
from typing import Final

import matplotlib as mpl
from matplotlib.figure import Figure
from PIL import Image

from steptwin.features.motors.sizing.motor_pictures import PICTURES as MOTOR_PICTURES
from steptwin.features.motors.turning import MotorRun
from steptwin.host.record.plots import DEFAULT_VIEW, PICTURES, PlotView, draw_picture
from steptwin.host.record.plots.canvas import SHEET_STYLE, STYLE, plain_texts
from steptwin.host.record.plots.shown_run import ShownRun
from steptwin.host.twin.embedded.outcome import Outcome
from steptwin.host.verify import RunInfo

_DOTS_PER_INCH: Final = 100
_PIXELS: Final = 1000
"""Width of a run's picture."""


def write_picture(path: Path, draw: Callable[[], Figure]) -> None:
    """Write a small PNG."""
    with mpl.rc_context(STYLE):
        figure = draw()
        figure.align_ylabels()
        path.write_bytes(small_png(figure))


def write_run_picture(path: Path, name: str, outcome: Outcome, view: PlotView = DEFAULT_VIEW) -> None:
    """Write one of the pictures of a run."""
    shown = ShownRun(outcome.comparison, outcome.to_dict(), view)
    _write(path, draw_picture(PICTURES[name], outcome.report.run, shown))


def write_motor_picture(path: Path, name: str, run: RunInfo, ran: MotorRun) -> None:
    """Write one of the pictures of a run's motors."""
    _write(path, draw_picture(MOTOR_PICTURES[name], run, ran))


def _write(path: Path, figure: Figure) -> None:
    plain_texts(figure)
    with mpl.rc_context(SHEET_STYLE):
        path.write_bytes(small_png(figure, _PIXELS / figure.get_figwidth()))


def small_png(figure: Figure, dots: float = _DOTS_PER_INCH) -> bytes:
    """Return a PNG with a palette, a third of matplotlib's size; the octree method keeps colours of few pixels."""
    drawn, reduced = BytesIO(), BytesIO()
    figure.savefig(drawn, format="png", dpi=dots)
    pixels = Image.open(drawn).convert("RGB")
    pixels = pixels.quantize(method=Image.Quantize.FASTOCTREE, dither=Image.Dither.NONE)
    pixels.save(reduced, format="PNG", optimize=True)
    return reduced.getvalue()
