"""Draw the torque that a plan needs of each motor into the motor's pull-out curve."""

from typing import Final

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from steptwin.host.record.plots.canvas import COUNTED, LIMIT, new_figure
from steptwin.host.twin.motors import MotorRun
from steptwin.host.twin.motors.verdict import MARGIN_MIN
from steptwin.host.verify import RunInfo

_ROW_INCHES: Final = 2.3
_COLUMNS: Final = 2
_NEEDED: Final = "0.45"


def draw_torque(ran: MotorRun, run: RunInfo) -> Figure:
    """Draw a panel for each joint: speed across, torque up."""
    joints = ran.verdict.joints
    rows = -(-len(joints) // _COLUMNS)
    figure = new_figure(run, "torque of the motors", _ROW_INCHES * rows)
    grid = figure.subplots(rows, _COLUMNS, squeeze=False).ravel()
    for axis, axes in enumerate(grid):
        if axis < len(joints):
            _draw_joint(axes, ran, axis)
        else:
            axes.set_axis_off()
    figure.legend(*grid[0].get_legend_handles_labels(), loc="outside lower left", ncols=4, markerscale=1.5)
    return figure


def _draw_joint(axes: Axes, ran: MotorRun, axis: int) -> None:
    torques, joint = ran.torques, ran.verdict.joints[axis]
    curve = torques.curves[axis]
    axes.plot(curve.rpm, curve.torque_nm, color=COUNTED, linewidth=1.6, label="pull-out torque")
    axes.plot(
        curve.rpm, (1.0 - MARGIN_MIN) * curve.torque_nm, color=COUNTED, linestyle="--",
        label=f"{100 * MARGIN_MIN:.0f} % less",
    )  # fmt: skip
    rpm, needed_nm = np.abs(torques.rpm[:, axis]), np.abs(torques.needed_nm[:, axis])
    axes.plot(rpm, needed_nm, ".", color=_NEEDED, markersize=2.5, markeredgewidth=0, label="needed, each ms")
    axes.plot(
        [joint.margin_rpm], [joint.torque_needed_nm], "o", color=LIMIT, markersize=6, fillstyle="none",
        markeredgewidth=1.5, label="least margin",
    )  # fmt: skip
    axes.set_title(f"{joint.name}: {joint.motor}, {100 * joint.margin:.0f} % left", loc="left")
    axes.set_xlim(0.0, float(curve.rpm[-1]))
    axes.set_ylim(bottom=0.0)
    axes.set_xlabel("turns a minute")
    axes.set_ylabel("torque [Nm]")
