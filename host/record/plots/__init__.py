"""Draw pictures of a run from its plan and evidence, never from the firmware's own state.

Importing this does not import matplotlib.
"""

from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any, Final

from steptwin.host.record.plots.picture import DEFAULT_VIEW, Picture, PlotView, draw_picture, write_pictures
from steptwin.host.verify import Comparison, RunInfo

__all__ = [
    "DEFAULT_VIEW",
    "PICTURES",
    "RUN_PICTURES",
    "Picture",
    "PlotView",
    "draw_picture",
    "write_pictures",
    "write_plots",
]

_OWN: Final = "steptwin.host.record.plots."
_OVERVIEW, _JOINTS, _ERROR = _OWN + "overview", _OWN + "joints", _OWN + "error"
_TOOL, _SPACE, _TIMING, _CLOSE = _OWN + "tool_path", _OWN + "in_space", _OWN + "timing", _OWN + "close_ups"
_TIME: Final = "time [s]"
_LATE: Final = (
    "accepted edge minus ideal crossing [us], positive is late;\n"
    "linear within one count of the board's timer, +-0.014 us, logarithmic beyond"
)

PICTURES: Final[Mapping[str, Picture]] = {
    each.name: each
    for each in (
        Picture("overview", "overview", _OVERVIEW, above_inches=0.4, below_inches=0.6),
        Picture("error", "counted minus planned", _ERROR, 0.95, (3.0, 1.3), ("whole motion", "largest, close up"),
                (_TIME, "")),
        Picture("joints", "planned joint motion", _JOINTS, 1.3, (1.0, 1.0, 1.0),
                ("position", "speed", "acceleration"), (_TIME, _TIME, _TIME), 0.32),
        Picture("step-rates", "step rates", _JOINTS, 1.3, across=(_TIME,)),
        Picture("tool-path", "tool path", _TOOL, 2.9, (1.0, 1.0), above_inches=0.36, below_inches=0.6, of_tool=True),
        Picture("tool-pose", "tool pose", _TOOL, 1.3, (1.0, 1.0), across=(_TIME, _TIME), above_inches=0.32,
                of_tool=True),
        Picture("in-space", "in space", _SPACE, of_tool=True),
        Picture("timing", "edge timing against the ideal crossings", _TIMING, 1.2, across=(_LATE,), above_inches=0.36),
        Picture("jitter", "interval jitter against the ideal crossings", _TIMING, 1.3, (3.0, 1.2),
                across=(_TIME, "intervals"), above_inches=0.36),
        Picture("widths", "CLK against the drivers' limits", _TIMING, 1.4, above_inches=0.36),
        Picture("edges", "pins", _CLOSE, 0.32, close_up=True),
        Picture("phases", "phase currents", _CLOSE, 1.7, (1.0, 2.6), ("B over A, the whole run", ""), ("A [A]", ""),
                close_up=True),
    )
}  # fmt: skip
"""Pictures of a run by file name, which is also their name on the command line."""

RUN_PICTURES: Final = ("overview", "error")
"""Pictures drawn into every run's folder."""


def write_plots(
    folder: Path,
    names: Iterable[str],
    run: RunInfo,
    comparison: Comparison,
    document: Mapping[str, Any],
    form: str = "png",
    view: PlotView = DEFAULT_VIEW,
) -> list[Path]:
    """Draw pictures of a run into a folder, created if missing, and return the paths of the files.

    Pictures of the tool are left out for a machine without one. `document` is that of the run's report.json.
    """
    from steptwin.host.record.plots.shown_run import ShownRun

    pictures = [PICTURES[name] for name in names]
    if not comparison.expected.task.width:
        pictures = [each for each in pictures if not each.of_tool]
    return write_pictures(folder, pictures, run, ShownRun(comparison, document, view), form)
