"""Which pictures there are, and writing them."""

from collections.abc import Callable
from pathlib import Path

import matplotlib as mpl
from matplotlib.figure import Figure

from host.plots.canvas import DOTS_PER_INCH, STYLE
from host.plots.error import draw_error
from host.plots.joints import draw_joints
from host.plots.step_rates import draw_step_rates
from host.plots.timing import draw_timing
from host.plots.tool_path import draw_tool_path
from host.verify import Comparison, RunInfo

PICTURES: dict[str, Callable[[Comparison, RunInfo], Figure]] = {
    "joints.png": draw_joints,
    "step-rates.png": draw_step_rates,
    "tool-path.png": draw_tool_path,
    "error.png": draw_error,
    "timing.png": draw_timing,
}


def write_plots(out_dir: Path, comparison: Comparison, run: RunInfo) -> list[Path]:
    """Draw every picture of a run into a directory, which is made if it is missing, and return their paths."""
    out_dir.mkdir(parents=True, exist_ok=True)
    paths = []
    with mpl.rc_context(STYLE):
        for name, draw in PICTURES.items():
            path = out_dir / name
            figure = draw(comparison, run)
            figure.align_ylabels()
            figure.savefig(path, dpi=DOTS_PER_INCH)
            paths.append(path)
    return paths
