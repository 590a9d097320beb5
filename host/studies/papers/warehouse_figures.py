"""Figures of the warehouse robot's paper that are no curves: the planar arm with its angles, the drawer coming out."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Arc, Rectangle

from steptwin.host.common.arrays import FloatArray
from steptwin.host.record.plots.canvas import COUNTED, LIMIT, WIDTH_INCHES

_ARM: Final = "#7a3d00"
_WOOD: Final = "#d9c7a7"
_DRAWER_MM: Final = (180.0, 150.0)
"""Length of the drawer, stated in sect. 2, and its width in the robot's file, [A]."""
_CELLS: Final = 3
_PLAY_MM: Final = 1.0
"""A cell counts as out that lacks no more, as for the emulated shelf."""


@dataclass(frozen=True, slots=True, eq=False)
class OpenDrawer:
    """What one panel of fig. 7 shows: its name, the arm from above, of shape (points, 2), and the drawer's opening."""

    name: str
    arm_mm: FloatArray
    open_mm: float


def planar_arm(lengths_mm: tuple[float, float, float], joints_deg: tuple[float, float, float]) -> Figure:
    """Return the sketch of a planar arm A B C D with the lengths l1, l2, l3 and the angles of the closed inverse."""
    figure = Figure(figsize=(WIDTH_INCHES, 7.2), layout="constrained")
    axes = figure.subplots()
    turned_deg = np.cumsum(joints_deg)
    directions = np.exp(1j * np.deg2rad(turned_deg))
    ends = np.array([0.0, *np.cumsum(np.array(lengths_mm) * directions)])
    points = np.column_stack([ends.real, ends.imag])
    axes.plot(*points.T, color=_ARM, linewidth=4, marker="o", markersize=9, markerfacecolor="white")
    wrist = points[2]
    axes.plot(*np.array([points[0], wrist]).T, color=LIMIT, linestyle="--", linewidth=1.2)
    for name, point, aside in zip("ABCD", points, ((-12, -14), (10, -14), (4, 12), (10, -6)), strict=True):
        axes.annotate(name, point, aside, textcoords="offset points", weight="bold")
    for i in range(3):
        middle = 0.38 * points[i] + 0.62 * points[i + 1]
        beside = (16 * directions[i].imag, -16 * directions[i].real)
        axes.annotate(f"l{i + 1}", middle, beside, textcoords="offset points", ha="center", va="center")
    alpha_deg = float(np.rad2deg(np.arctan2(wrist[1], wrist[0])))
    _angle(axes, points[0], 62, 0.0, joints_deg[0], "theta1", _ARM)
    _angle(axes, points[0], 105, joints_deg[0], alpha_deg, "beta", LIMIT)
    _angle(axes, points[0], 150, 0.0, alpha_deg, "alpha", COUNTED)
    _angle(axes, points[1], 45, turned_deg[0], turned_deg[1], "theta2", _ARM)
    _angle(axes, points[2], 36, turned_deg[1], turned_deg[2], "theta3", _ARM)
    _angle(axes, points[3], 30, 0.0, turned_deg[2], "phi", _ARM)
    for point, turned in zip(points[1:], turned_deg, strict=True):
        ray = 55 * np.array([np.cos(np.deg2rad(turned)), np.sin(np.deg2rad(turned))])
        axes.plot(*np.array([point, point + ray]).T, color="0.6", linewidth=0.8, linestyle=":")
    axes.plot(*np.array([points[3], points[3] + [55, 0]]).T, color="0.6", linewidth=0.8, linestyle=":")
    axes.axhline(0, color="0.6", linewidth=0.8)
    axes.set(xlabel="x [mm]", ylabel="y [mm]")
    axes.set_aspect("equal")
    axes.margins(0.08)
    axes.set_title("alpha: to the wrist C; beta: between it and l1; theta1 = alpha - beta", loc="left")
    return figure


def _angle(axes: Axes, at: FloatArray, radius: float, start_deg: float, end_deg: float, name: str, colour: str) -> None:
    """Draw an angle's arc, counted from start to end, with its name beside its first third."""
    lower_deg, upper_deg = min(start_deg, end_deg), max(start_deg, end_deg)
    axes.add_patch(Arc((at[0], at[1]), 2 * radius, 2 * radius, theta1=lower_deg, theta2=upper_deg, color=colour))
    middle = np.deg2rad(start_deg + 0.3 * (end_deg - start_deg))
    axes.text(at[0] + (radius + 6) * np.cos(middle), at[1] + (radius + 6) * np.sin(middle), name, color=colour,
              ha="left", va="center", fontsize=9)  # fmt: skip


def open_drawers(shown: Sequence[OpenDrawer]) -> Figure:
    """Return a panel for each: shelf, drawer with its cells, arm and hand from above; the shelf's front is fixed."""
    figure = Figure(figsize=(WIDTH_INCHES, 4.6), layout="constrained")
    row = figure.subplots(1, len(shown), sharey=True, squeeze=False)[0]
    front_mm = max(float(one.arm_mm[-1, 1]) + one.open_mm for one in shown)
    for axes, one in zip(row, shown, strict=True):
        _drawer(axes, one, front_mm)
        axes.set_title(one.name, loc="left")
        axes.set(xlabel="x [mm]", xlim=(-40, 380), ylim=(front_mm - 350, front_mm + 200))
        axes.set_aspect("equal")
    row[0].set_ylabel("y [mm]")
    return figure


def _drawer(axes: Axes, one: OpenDrawer, front_mm: float) -> None:
    tip_mm = one.arm_mm[-1]
    length_mm, width_mm = _DRAWER_MM
    axes.add_patch(Rectangle((-40, front_mm), 420, 260, facecolor="0.93", edgecolor="none"))
    cell_mm = length_mm / _CELLS
    for n in range(_CELLS):
        out = n * cell_mm + cell_mm <= one.open_mm + _PLAY_MM
        axes.add_patch(
            Rectangle((tip_mm[0] - width_mm / 2, tip_mm[1] + n * cell_mm), width_mm, cell_mm,
                      facecolor=_WOOD if out else "white", edgecolor="0.3", alpha=1.0 if out else 0.6)
        )  # fmt: skip
        axes.text(tip_mm[0], tip_mm[1] + (n + 0.5) * cell_mm, f"cell {n + 1}", ha="center", va="center", fontsize=8)
    axes.plot([-40, 380], [front_mm, front_mm], color="0.3", linewidth=1.5)
    axes.text(-32, front_mm + 12, "shelf", fontsize=8)
    axes.plot(*one.arm_mm.T, color=_ARM, linewidth=3.5, marker="o", markersize=6, markerfacecolor="white")
    axes.plot(*tip_mm, marker="s", color=LIMIT, markersize=7)
    axes.annotate("hand", tip_mm, (8, -12), textcoords="offset points", fontsize=8, color=LIMIT)
