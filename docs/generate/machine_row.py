"""Draw the machines that come along side by side at home, for the README."""

from typing import Final

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from docs.generate.commands import DOCS
from docs.generate.drawer_pull_film import STYLES, seen
from docs.generate.drawing import write_picture
from steptwin.host.record.plots.canvas import STYLE
from steptwin.host.robots import load_robot
from steptwin.host.robots.kinematics import Role, make_kinematics

MACHINES_ROW: Final = DOCS / "pictures" / "machines.png"
_SHOWN: Final = (
    ("lab-scara", "teaching-scara", "calibration-scara", "warehouse-scara", "hybrid-arm"),
    ("ar4-mk3", "parol6", "thor", "corexy-gantry"),
)
_BENT_DEG: Final = {"teaching-scara": 70.0, "calibration-scara": 70.0}
"""Angle of the elbow of arms that are straight at home."""
_NOT_DRAWN: Final = (Role.AXIS, Role.GUIDE)
"""Parts that say nothing at this size, or are much longer than the arm."""


def write_machines_row() -> None:
    """Write the picture: a row of papers' arms, and one of machines that people build."""
    with mpl.rc_context(STYLE):
        write_picture(MACHINES_ROW, _draw)


def _draw() -> Figure:
    figure = Figure(figsize=(9.6, 4.4))
    for row, names in enumerate(_SHOWN):
        for column, name in enumerate(names):
            width = 1 / len(names)
            axes = figure.add_axes((column * width, 0.5 - 0.5 * row, width, 0.5))
            _draw_machine(axes, name)
    return figure


def _draw_machine(axes: Axes, name: str) -> None:
    """Draw a machine at home, true to scale for itself, with its name below."""
    robot = load_robot(name)
    joints = np.array([robot.home])
    if name in _BENT_DEG:
        joints[:, robot.index_of("th2")] = _BENT_DEG[name]
    parts = [part for part in make_kinematics(robot).links(joints) if part.role not in _NOT_DRAWN]
    for part in parts:
        axes.plot(*seen(part.points_mm[0]).T, **{"zorder": 3, **STYLES[part.role]})
    points = seen(np.concatenate([part.points_mm[0] for part in parts]))
    floor_mm = min(float(part.points_mm[0][:, 2].min()) for part in parts)
    shadows = [seen(part.points_mm[0] * (1.0, 1.0, 0.0) + (0.0, 0.0, floor_mm)) for part in parts]
    for shadow in shadows:
        axes.plot(*shadow.T, color="0.9", linewidth=4.0, zorder=1)
    everything = np.concatenate([points, *shadows])
    middle, half = (everything.min(axis=0) + everything.max(axis=0)) / 2, 0.56 * np.ptp(everything, axis=0).max()
    axes.set(xlim=middle[0] + np.array([-1.0, 1.0]) * half, ylim=middle[1] + np.array([-1.25, 1.0]) * half)
    axes.set_aspect("equal")
    axes.set_axis_off()
    axes.set_title(name, y=0.0, fontsize=10)
