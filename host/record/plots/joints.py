"""Draw planned position and speed of every moving joint."""

from matplotlib.figure import Figure

from steptwin.host.record.plots.canvas import (
    COUNTED,
    moving_axes,
    new_figure,
    note_still_axes,
    planned_instants,
    rows_of_axes,
)
from steptwin.host.verify import Comparison, RunInfo

ROW_INCHES = 1.6


def draw_joints(comparison: Comparison, run: RunInfo) -> Figure:
    """Draw a row for each moving joint: position at the left, speed at the right."""
    moving = moving_axes(comparison)
    figure = new_figure(run, "planned joint motion", ROW_INCHES * max(len(moving), 1))
    rows = rows_of_axes(figure, len(moving), 2)
    t_s = planned_instants(comparison)
    positions = comparison.expected.trajectory.positions(t_s)
    velocities = comparison.expected.trajectory.velocities(t_s)
    for (left, right), i in zip(rows, moving, strict=False):
        unit = comparison.expected.joint_units[i]
        left.plot(t_s, positions[:, i], color=COUNTED)
        left.set_ylabel(f"{comparison.joint_names[i]} [{unit}]")
        right.plot(t_s, velocities[:, i], color=COUNTED)
        right.axhline(0.0, color="0.5", linewidth=0.6)
        right.set_ylabel(f"[{unit}/s]")
    rows[0][0].set_title("position", loc="left")
    rows[0][1].set_title("speed", loc="left")
    for axes in rows[-1]:
        axes.set_xlabel("time [s]")
        axes.set_xlim(0.0, t_s[-1])
    note_still_axes(figure, comparison, moving)
    return figure
