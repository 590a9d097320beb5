"""Draw the pictures of docs/robots.md: three for each run, small enough for a repository."""

from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Final

import matplotlib as mpl
from matplotlib.figure import Figure

from docs.generate.page import PICTURE_KINDS, picture
from docs.generate.pieces import DOCS
from steptwin.host.papers.drawing import small_png
from steptwin.host.papers.runs import Runs
from steptwin.host.record.plots import DEFAULT_VIEW, PICTURES
from steptwin.host.record.plots.canvas import STYLE

_DRAWN: Final = dict(zip(PICTURE_KINDS, ("tool-path", "joints", "error"), strict=True))
"""For each kind of picture on the page, its name in `steptwin.host.record.plots`."""


def write_pictures(runs: Runs) -> None:
    """Draw the pictures of every run that a page shows."""
    for outcome in runs.made():
        run = outcome.report.run
        for kind, name in _DRAWN.items():
            path = DOCS / picture(run.robot, run.job, kind)
            path.parent.mkdir(exist_ok=True)
            write_picture(path, partial(PICTURES[name], outcome.comparison, run, DEFAULT_VIEW))


def write_picture(path: Path, draw: Callable[[], Figure]) -> None:
    """Write a small PNG."""
    with mpl.rc_context(STYLE):
        figure = draw()
        figure.align_ylabels()
        path.write_bytes(small_png(figure))
