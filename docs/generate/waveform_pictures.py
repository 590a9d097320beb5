"""Draw the pictures of docs/waveforms.md as `steptwin plot` does, of the hybrid arm's helix."""

from typing import Final

import matplotlib as mpl

from docs.generate.pictures import write_picture
from docs.generate.pieces import DOCS
from docs.generate.runs import Runs
from steptwin.host.record.plots import DEFAULT_VIEW, PICTURES, View
from steptwin.host.record.plots.canvas import STYLE

WAVEFORM_PAGE: Final = DOCS / "waveforms.md"

_VIEWS: Final = {"edges": View(1.94, 0.06), "phases": DEFAULT_VIEW, "jitter": DEFAULT_VIEW, "widths": DEFAULT_VIEW}
"""For each picture the window that it shows: Z5 turns around at 1.94 s."""


def write_waveform_pictures(runs: Runs) -> None:
    """Draw the pictures anew."""
    outcome = runs.outcome("hybrid-arm", "helix")
    with mpl.rc_context(STYLE):
        for name, view in _VIEWS.items():
            path = DOCS / "pictures" / f"waveform-{name}.png"
            write_picture(path, PICTURES[name](outcome.comparison, outcome.report.run, view))
