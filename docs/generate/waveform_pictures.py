"""Draw the pictures of docs/waveforms.md as `steptwin plot` does, of the hybrid arm's helix."""

from functools import partial
from typing import Final

from docs.generate.pictures import write_picture
from docs.generate.pieces import DOCS
from steptwin.host.papers.runs import Runs
from steptwin.host.record.plots import DEFAULT_VIEW, PICTURES, View

WAVEFORM_PAGE: Final = DOCS / "waveforms.md"

_VIEWS: Final = {"edges": View(1.94, 0.06), "phases": DEFAULT_VIEW, "jitter": DEFAULT_VIEW, "widths": DEFAULT_VIEW}
"""For each picture the window that it shows: Z5 turns around at 1.94 s."""


def write_waveform_pictures(runs: Runs) -> None:
    """Draw the pictures again."""
    outcome = runs.outcome("hybrid-arm", "helix")
    for name, view in _VIEWS.items():
        path = DOCS / "pictures" / f"waveform-{name}.png"
        write_picture(path, partial(PICTURES[name], outcome.comparison, outcome.report.run, view))
