"""Write a picture of a page, small enough for a repository."""

from collections.abc import Callable
from io import BytesIO
from pathlib import Path
from typing import Final

import matplotlib as mpl
from matplotlib.figure import Figure
from PIL import Image

from steptwin.host.record.plots.canvas import STYLE

_DOTS_PER_INCH: Final = 100


def write_picture(path: Path, draw: Callable[[], Figure]) -> None:
    """Write a small PNG."""
    with mpl.rc_context(STYLE):
        figure = draw()
        figure.align_ylabels()
        path.write_bytes(small_png(figure))


def small_png(figure: Figure) -> bytes:
    """Return a PNG with a palette, a third of matplotlib's size; the octree method keeps colours of few pixels."""
    drawn, reduced = BytesIO(), BytesIO()
    figure.savefig(drawn, format="png", dpi=_DOTS_PER_INCH)
    pixels = Image.open(drawn).convert("RGB")
    pixels = pixels.quantize(method=Image.Quantize.FASTOCTREE, dither=Image.Dither.NONE)
    pixels.save(reduced, format="PNG", optimize=True)
    return reduced.getvalue()
