"""Pictures of a run's motors."""

from collections.abc import Mapping
from typing import Final

import numpy as np
from matplotlib.axes import Axes

from steptwin.features.motors.turning import MotorRun
from steptwin.features.motors.turning.verdict import MARGIN_MIN
from steptwin.host.common.arrays import FloatArray
from steptwin.host.record.path_error import PathError
from steptwin.host.record.plots.canvas import COUNTED, LIMIT, PLANNED, Sheet, thinned
from steptwin.host.record.plots.picture import Picture
from steptwin.protocol.timer import COUNTS_PER_SECOND

_HERE: Final = "steptwin.features.motors.sizing.motor_pictures"
_TWO: Final = (1.0, 1.0)

PICTURES: Final[Mapping[str, Picture]] = {
    each.name: each
    for each in (
        Picture("motor-load", "load angle of the motors", _HERE, 1.0,
                heads=("electrical degrees between field and rotor, the greatest in each ms",), across=("time [s]",)),
        Picture("motor-torque", "torque of the motors", _HERE, 1.9, _TWO, above_inches=0.36, below_inches=0.6),
        Picture("motor-tool", "tool, planned, counted and really reached", _HERE, above_inches=0.36, below_inches=0.6,
                of_tool=True),
        Picture("motor-resonance", "resonance of the motors at steady speeds",
                "steptwin.features.motors.sizing.resonance", 1.5, _TWO, above_inches=0.36, below_inches=0.6),
    )
}  # fmt: skip
"""Pictures of a run's motors, by file name; they draw a MotorRun."""

IN_TIME: Final = ("motor-load", "motor-torque", "motor-tool")
"""Pictures drawn into the folder of a run with --motors; the other takes longer than most runs."""


def draw_motor_torque(sheet: Sheet, ran: MotorRun) -> None:
    """Draw a panel for each joint: speed across, torque up."""
    joints = ran.verdict.joints
    cells = [axes for row in sheet.panels(-(-len(joints) // 2), band_lines=2, share="none") for axes in row]
    for axis in range(len(joints)):
        _draw_torque_of_joint(cells[axis], ran, axis)
    for axes in cells[len(joints) :]:
        axes.remove()
    sheet.legend(cells[0], 2)


def _draw_torque_of_joint(axes: Axes, ran: MotorRun, axis: int) -> None:
    torques, joint = ran.torques, ran.verdict.joints[axis]
    curve = torques.curves[axis]
    axes.plot(curve.rpm, curve.torque_nm, color=COUNTED, linewidth=1.6, label="pull-out torque")
    axes.plot(
        curve.rpm, (1.0 - MARGIN_MIN) * curve.torque_nm, color=COUNTED, linestyle="--",
        label=f"{100 * MARGIN_MIN:.0f} % less",
    )  # fmt: skip
    rpm, needed_nm = np.abs(torques.rpm[:, axis]), np.abs(torques.needed_nm[:, axis])
    axes.plot(rpm, needed_nm, ".", color="0.45", markersize=2.5, markeredgewidth=0, label="needed, each ms")
    axes.plot(
        [joint.margin_rpm], [joint.torque_needed_nm], "o", color=LIMIT, markersize=6, fillstyle="none",
        markeredgewidth=1.5, label="least margin",
    )  # fmt: skip
    axes.set_title(f"{joint.name}: {joint.motor}, {100 * joint.margin:.0f} % left", loc="left", size=9.5)
    axes.set_xlim(0.0, float(curve.rpm[-1]))
    axes.set_ylim(bottom=0.0)
    axes.set_xlabel("turns a minute")
    axes.set_ylabel("torque [Nm]")


_PATH_INCHES: Final = 3.8
REACHED: Final = "#d1661b"
"""Colour of the rotors' real path: orange, of a middle grey in print."""


def draw_motor_tool(sheet: Sheet, ran: MotorRun) -> None:
    """Draw the path in the plane of the two coordinates that move most, and below it the errors over time."""
    heights = [_PATH_INCHES, sheet.picture.row_inches, sheet.picture.row_inches]
    (path,), (distance,), (attitude,) = sheet.panels(3, heights_inches=heights, band_lines=1, share="none")
    _draw_path(path, ran)
    paths = ran.paths
    for poses, colour, label in ((paths.counted, COUNTED, "counted"), (paths.reached, REACHED, "really reached")):
        apart = poses - paths.planned
        distance.plot(*thinned(paths.t_s, np.linalg.norm(apart[:, :3], axis=1)), color=colour, label=label)
        attitude.plot(*thinned(paths.t_s, paths.task.off_deg(poses, paths.planned)), color=colour)
    distance.set_title("distance from the plan", loc="left")
    distance.set_ylabel("[mm]")
    distance.set_ylim(bottom=0.0)
    for axes in (distance, attitude):
        axes.set_xlim(paths.t_s[0], paths.t_s[-1])
        axes.set_xlabel("time [s]")
    attitude.set_title("angle from the plan", loc="left")
    attitude.set_ylabel("[deg]")
    sheet.legend(path, 4)


def _draw_path(axes: Axes, ran: MotorRun) -> None:
    planned = ran.paths.planned[:, :3]
    reached = PathError(planned, np.nan_to_num(ran.paths.reached[:, :3] - planned))
    counted = PathError(planned, ran.paths.counted[:, :3] - planned)
    gain = reached.gain
    first, second = sorted(np.argsort(-reached.extents_mm, kind="stable")[:2].tolist())

    def across(points: FloatArray) -> FloatArray:
        return np.asarray(points[:, [first, second]].T)

    axes.plot(*across(planned), color=PLANNED, linewidth=5, label="planned")
    axes.plot(*across(counted.counted_mm(gain)), color=COUNTED, linewidth=0.6, label="counted")
    axes.plot(*across(reached.counted_mm(gain)), color=REACHED, linewidth=1.0, label="really reached")
    axes.plot(*across(planned[:1]), marker="o", color="black", linestyle="none", label="start")
    axes.set_aspect("equal", adjustable="datalim")
    axes.set_xlabel(f"{'xyz'[first]} [mm]")
    axes.set_ylabel(f"{'xyz'[second]} [mm]")
    axes.set_title(f"errors magnified {gain:g} times" if gain > 1.0 else "errors not magnified", loc="left")


_WIDEST_DEG: Final = 190.0
_TORQUE_MAX_DEG: Final = 90.0
_LATE_PART: Final = 0.8
"""Fraction of the picture's width beyond which a label is on the left of its line."""


def draw_motor_load(sheet: Sheet, ran: MotorRun) -> None:
    """Draw a row for each motor, from the start of the motion until the drivers go off."""
    names = ran.driving.robot.axis_names
    rows = sheet.panels(len(names), band_lines=1)
    t_s = (ran.trace.counts - ran.driving.start_counts) / COUNTS_PER_SECOND
    shown = (t_s >= 0.0) & (ran.trace.counts < ran.driving.off_counts)
    end_s = max(float(t_s[shown][-1]), 1e-3)
    for axis, ((axes,), name) in enumerate(zip(rows, names, strict=True)):
        axes.plot(*thinned(t_s[shown], ran.trace.load_deg[shown, axis]), color=COUNTED)
        for limit_deg in (-_TORQUE_MAX_DEG, _TORQUE_MAX_DEG):
            axes.axhline(limit_deg, color=LIMIT, linestyle="--", label="greatest torque" if limit_deg > 0.0 else None)
        slip_counts = ran.trace.first_slip_counts[axis]
        if slip_counts is not None:
            _mark_slip(axes, ran.driving.seconds(slip_counts), end_s)
        _scale(axes, ran.trace.load_deg[shown, axis])
        axes.set_ylabel(f"{name} [deg]")
    sheet.legend(rows[0][0], 2)
    rows[-1][0].set_xlim(0.0, end_s)


def _mark_slip(axes: Axes, at_s: float, end_s: float) -> None:
    """Mark a slip by a line and, where there is room, its time; a slip before t = 0 has no line."""
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
        size=9.5,
        bbox={"facecolor": "white", "edgecolor": "none", "pad": 1.0},
    )


def _scale(axes: Axes, load_deg: np.ndarray[tuple[int], np.dtype[np.float64]]) -> None:
    widest_deg = min(max(110.0, 1.1 * float(np.abs(load_deg).max(initial=0.0))), _WIDEST_DEG)
    axes.set_ylim(-widest_deg, widest_deg)
    axes.set_yticks([-90, 0, 90])
