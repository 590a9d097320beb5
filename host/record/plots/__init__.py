"""Draw pictures of a run from a comparison of plan and evidence, never from the firmware's own view."""

from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Final

import matplotlib as mpl
from matplotlib.figure import Figure

from steptwin.host.record.plots.canvas import STYLE, PlotMoment, PlotView, save_figure
from steptwin.host.record.plots.close_ups import draw_edges, draw_phases
from steptwin.host.record.plots.in_space import draw_run_in_space
from steptwin.host.record.plots.joints import draw_error, draw_joints, draw_step_rates
from steptwin.host.record.plots.timing import draw_jitter, draw_timing, draw_widths
from steptwin.host.record.plots.tool_path import draw_tool_path, draw_tool_pose
from steptwin.host.verify import Comparison, RunInfo

__all__ = ["CLOSE_UPS", "DEFAULT_VIEW", "OF_TOOL", "PICTURES", "PlotMoment", "PlotView", "write_plots"]


Draw = Callable[[Comparison, RunInfo, PlotView], Figure]


def _whole(draw: Callable[[Comparison, RunInfo], Figure]) -> Draw:
    """Turn a picture of the whole run into one that ignores the view."""
    return lambda comparison, run, _view: draw(comparison, run)


PICTURES: Final[dict[str, Draw]] = {
    "joints": _whole(draw_joints),
    "step-rates": _whole(draw_step_rates),
    "tool-path": _whole(draw_tool_path),
    "tool-pose": _whole(draw_tool_pose),
    "in-space": draw_run_in_space,
    "error": _whole(draw_error),
    "timing": _whole(draw_timing),
    "jitter": _whole(draw_jitter),
    "widths": _whole(draw_widths),
    "edges": draw_edges,
    "phases": draw_phases,
}
"""Pictures by the names of their files, which the command line takes too."""

OF_TOOL: Final = ("tool-path", "tool-pose", "in-space")
"""Pictures of the tool, which are left out for a machine that has none."""

CLOSE_UPS: Final = ("edges", "phases")
"""Pictures that show the part of a run that a View chooses."""

DEFAULT_VIEW: Final = PlotView()
"""View that leaves the choice to each picture."""

_UNDATED: Final[dict[str, dict[str, None]]] = {"png": {}, "svg": {"Date": None}, "pdf": {"CreationDate": None}}
"""Metadata without a date, so that the same run gives the same bytes."""


def write_plots(
    out_dir: Path,
    comparison: Comparison,
    run: RunInfo,
    names: Iterable[str],
    form: str = "png",
    view: PlotView = DEFAULT_VIEW,
) -> list[Path]:
    """Draw pictures of a run into a directory, made if missing, and return the paths of the files.

    `view` chooses the part of the run that pictures of single edges show, and frames in the picture in space.
    """
    out_dir.mkdir(parents=True, exist_ok=True)
    paths = []
    if not comparison.expected.task.width:
        names = [name for name in names if name not in OF_TOOL]
    with mpl.rc_context(STYLE):
        for name in names:
            path = out_dir / f"{name}.{form}"
            figure = PICTURES[name](comparison, run, view)
            figure.align_ylabels()
            save_figure(figure, path, _UNDATED[form])
            paths.append(path)
    return paths
