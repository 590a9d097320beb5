"""Draw a calibration: distances of the tool from the model at each measured pose, before and after."""

from pathlib import Path

import matplotlib as mpl
import numpy as np
from matplotlib.figure import Figure

from steptwin.features.calibration.identification import Identification, rms_mm
from steptwin.host.common.bad_input import printable, shortened
from steptwin.host.record.plots.canvas import COUNTED, LIMIT, PLANNED, STYLE, WIDTH_INCHES, save_figure

_LEAST_MM = 1e-6  # smallest distance on the logarithmic scale; simulations without noise have 0


def write_residuals(path: Path, robot: str, found: Identification) -> None:
    """Write the picture to a PNG file."""
    with mpl.rc_context(STYLE):
        save_figure(draw_residuals(robot, found), path, {})


def draw_residuals(robot: str, found: Identification) -> Figure:
    """Return a figure: all distances on a logarithmic scale, and the final residuals in x, y and z below."""
    figure = Figure(figsize=(WIDTH_INCHES, 6.0), layout="constrained")
    title = f"{printable(shortened(robot))} · calibration by {len(found.measurements)} poses"
    figure.suptitle(title, x=0.01, ha="left", weight="bold")
    above, below = figure.subplots(2, 1, sharex=True)
    poses = np.arange(1, len(found.measurements) + 1)
    for mm, colour, marker, when in ((found.before_mm, LIMIT, "s", "before"), (found.after_mm, COUNTED, "o", "after")):
        label = f"{when}: {rms_mm(mm):.4g} mm rms"
        distances_mm = np.maximum(np.linalg.norm(mm, axis=1), _LEAST_MM)
        above.semilogy(poses, distances_mm, marker, color=colour, markersize=3.5, label=label)
    above.set(ylabel="distance [mm]", title="measured tool from that of the model")
    for axis, (colour, marker) in enumerate(((COUNTED, "o"), (LIMIT, "^"), ("0.4", "x"))):
        below.plot(poses, found.after_mm[:, axis], marker, color=colour, markersize=3.5, label="xyz"[axis])
    bound_mm = 3.0 * found.noise_mm
    below.axhspan(-bound_mm, bound_mm, color=PLANNED, alpha=0.3, label=f"3 sigma, {bound_mm:.3g} mm")
    below.set(xlabel="measured pose", ylabel="measured minus model [mm]", title="after, in each coordinate")
    for axes in (above, below):
        axes.legend(loc="upper left", bbox_to_anchor=(1.0, 1.0))
    return figure
