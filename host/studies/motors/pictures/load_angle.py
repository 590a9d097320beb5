"""Draw each motor's load angle over time, with the angle beyond which it holds no more."""

from typing import Final

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from steptwin.host.record.plots.canvas import COUNTED, LIMIT, new_figure, rows_of_axes, thinned
from steptwin.host.twin.motors import MotorRun
from steptwin.host.verify import RunInfo
from steptwin.protocol.timer import COUNTS_PER_SECOND

_ROW_INCHES: Final = 1.15
_WIDEST_DEG: Final = 190.0
_TORQUE_MAX_DEG: Final = 90.0
_LATE_PART: Final = 0.8
"""Part of the picture behind which a label stands on the left of its line."""


def draw_load_angle(ran: MotorRun, run: RunInfo) -> Figure:
    """Draw a row for each joint, from the start of the motion until the drivers go off."""
    joints = ran.driving.robot.joints
    figure = new_figure(run, "load angle of the motors", _ROW_INCHES * len(joints))
    rows = rows_of_axes(figure, len(joints))
    t_s = (ran.trace.counts - ran.driving.start_counts) / COUNTS_PER_SECOND
    shown = (t_s >= 0.0) & (ran.trace.counts < ran.driving.off_counts)
    end_s = max(float(t_s[shown][-1]), 1e-3)
    for axis, ((axes,), joint) in enumerate(zip(rows, joints, strict=True)):
        axes.plot(*thinned(t_s[shown], ran.trace.load_deg[shown, axis]), color=COUNTED)
        for limit_deg in (-_TORQUE_MAX_DEG, _TORQUE_MAX_DEG):
            axes.axhline(limit_deg, color=LIMIT, linestyle="--", label="greatest torque" if limit_deg > 0.0 else None)
        slip_counts = ran.trace.first_slip_counts[axis]
        if slip_counts is not None:
            _mark_slip(axes, ran.driving.seconds(slip_counts), end_s)
        _scale(axes, ran.trace.load_deg[shown, axis])
        axes.set_ylabel(f"{joint.name} [deg]")
    rows[0][0].legend(loc="lower right", bbox_to_anchor=(1.0, 1.0), borderaxespad=0.0, ncols=2)
    rows[0][0].set_title("electrical degrees between field and rotor, the greatest in each ms", loc="left")
    rows[-1][0].set_xlabel("time [s]")
    rows[-1][0].set_xlim(0.0, end_s)
    return figure


def _mark_slip(axes: Axes, at_s: float, end_s: float) -> None:
    """Draw a line at a slip, and its instant where the picture has room; before t = 0 there is no line."""
    left = at_s < _LATE_PART * end_s
    axes.axvline(at_s, color=LIMIT, linewidth=1.5)
    axes.annotate(
        f"slips at {at_s:.3f} s",
        (min(max(at_s, 0.0), end_s), 1.0),
        (3.0 if left else -3.0, -2.0),
        xycoords=("data", "axes fraction"),
        textcoords="offset points",
        ha="left" if left else "right",
        va="top",
        color=LIMIT,
        size=8,
        bbox={"facecolor": "white", "edgecolor": "none", "pad": 1.0},
    )


def _scale(axes: Axes, load_deg: np.ndarray[tuple[int], np.dtype[np.float64]]) -> None:
    widest_deg = min(max(110.0, 1.1 * float(np.abs(load_deg).max(initial=0.0))), _WIDEST_DEG)
    axes.set_ylim(-widest_deg, widest_deg)
    axes.set_yticks([-90, 0, 90])
