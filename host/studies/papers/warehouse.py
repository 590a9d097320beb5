"""What is computed for the warehouse robot's paper, whose items are in warehouse.toml, with figures that are no curves.

A. Jiang, L. Guo, X. Tan, "Development of Prototype of a New Intelligent Warehouse Robot", 2019,
DOI 10.3969/j.issn.1009-9492.2019.05.018.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from math import cos, hypot, nan, radians, sin
from typing import TYPE_CHECKING, Any, ClassVar, Final

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Arc, Rectangle

from steptwin.host.common.arrays import FloatArray
from steptwin.host.planning.jobs import make_job
from steptwin.host.planning.laws import Trapezoid
from steptwin.host.record.plots.canvas import COUNTED, LIMIT, WIDTH_INCHES
from steptwin.host.studies.papers.paper import Computed, Curve, Figures, Panel, Rows
from steptwin.host.studies.papers.study import Study, matrix_rows, panels_over, texts

if TYPE_CHECKING:
    from matplotlib.figure import Figure


L2_MM: Final = 200.0
L3_MM: Final = 150.0
L4_MM: Final = 40.0
TRAVEL_MM: Final = 180.0
DURATION_S: Final = 10.0
RAMP_S: Final = 2.0
"""t1: assumed, the paper has none."""
CELL_MM: Final = 60.0
"""Length of a cell: a third of the drawer."""
_SAMPLES: Final = 1001
_PULL: Final = "pull-line"
_EXPERIMENT: Final = "drawer-pull"
"""The job that moves along the line alone, and the job that is the experiment of sect. 3."""
_SPEED_MM_S: Final = TRAVEL_MM / (DURATION_S - RAMP_S)
"""S / (T - t1) in eq. 3."""

X_MM: Final = L2_MM * cos(radians(0)) + L3_MM * cos(radians(60)) + L4_MM * cos(radians(90))
Y_MM: Final = L2_MM * sin(radians(0)) + L3_MM * sin(radians(60)) + L4_MM * sin(radians(90))
"""The tool at the start."""
_ARM: Final = "#7a3d00"
_WOOD: Final = "#d9c7a7"
_DRAWER_MM: Final = (180.0, 150.0)
"""Length of the drawer, stated in sect. 2, and its width in the robot's file, [A]."""
_CELLS: Final = 3
_PLAY_MM: Final = 1.0
"""A cell counts as out that lacks no more, as for the emulated shelf."""


def printed_position_mm(t_s: float) -> float:
    """Return S_x(t) as printed: twice the first branch, and the second one again for the third."""
    return _SPEED_MM_S * t_s**2 / RAMP_S if t_s <= RAMP_S else _SPEED_MM_S * (t_s - RAMP_S / 2)


def corrected_position_mm(t_s: float) -> float:
    """Return S_x(t) as corrected."""
    if t_s <= RAMP_S:
        return _SPEED_MM_S * t_s**2 / (2 * RAMP_S)
    if t_s <= DURATION_S - RAMP_S:
        return _SPEED_MM_S * (t_s - RAMP_S / 2)
    return TRAVEL_MM - _SPEED_MM_S * (DURATION_S - t_s) ** 2 / (2 * RAMP_S)


def swept_mm(until_s: float) -> float:
    """Return the area under the trapezoid of the speed, whose own area is the drawer's way, up to an instant."""
    corners_s = (0.0, RAMP_S, DURATION_S - RAMP_S, DURATION_S)
    t_s = np.union1d([t for t in corners_s if t < until_s], [until_s])
    shape = np.interp(t_s, corners_s, (0.0, 1.0, 1.0, 0.0))
    return TRAVEL_MM * float(np.trapezoid(shape, t_s)) / (DURATION_S - RAMP_S)


def _cos_beta(second_mm: float) -> float:
    """Return cos beta at the start, with x or y in the second bracket."""
    square = (X_MM - L4_MM * cos(radians(90))) ** 2 + (second_mm - L4_MM * sin(radians(90))) ** 2
    return float((square + L2_MM**2 - L3_MM**2) / (2 * L2_MM * square**0.5))


def _arc_cosine_deg(cosine: float) -> float:
    return float(np.rad2deg(np.arccos(cosine))) if abs(cosine) <= 1 else nan


def _lettered(panels: tuple[Panel, ...]) -> tuple[Panel, ...]:
    """Return panels with the letters that the paper's figures have, (a) to (c)."""
    return tuple(replace(panel, title=f"({letter})") for letter, panel in zip("abc", panels, strict=True))


@dataclass(frozen=True)
class WarehouseStudy(Study):
    """The drawer pull at the paper's samples, and the runs."""

    robot_name = "warehouse-scara"
    at: ClassVar[tuple[float, ...]] = (0.0, 0.0, 100.0, 0.0, 60.0, 30.0)
    shown: ClassVar[tuple[float, ...]] = (0.0, 0.0, 100.0, 0.0, 60.0, -20.0)

    @cached_property
    def t_s(self) -> FloatArray:
        """The paper's samples: 1000 intervals in 10 s."""
        return np.linspace(0.0, DURATION_S, _SAMPLES)

    @cached_property
    def joints(self) -> FloatArray:
        """Joints at the samples, of shape (1001, 6)."""
        return make_job(self.robot, _PULL).positions(self.t_s)

    @cached_property
    def poses(self) -> FloatArray:
        """The tool's poses at the samples, of shape (1001, 4)."""
        return self.kinematics.forward(self.joints)

    @property
    def switch_rows(self) -> Rows:
        """The outputs that storing and fetching switch."""
        return [
            [job, output.name, "on" if output.on else "off", f"{output.changed_s:.3f}"]
            for job in ("store", "fetch")
            for output in self.run[job].outcome.report.outputs
        ]

    @property
    def tool_rows(self) -> Rows:
        """The tool's transform at the start."""
        return matrix_rows({"tool": self.transforms(self.joints[:1])[0]})

    @cached_property
    def printed_joints(self) -> FloatArray:
        """Joints at the samples by the paper's inverse, its second x replaced by y: it still loses the sign of y."""
        wrist_y_mm = self.poses[:, 1] - L4_MM
        alpha_deg = np.rad2deg(np.arctan2(wrist_y_mm, X_MM))
        joints = self.joints.copy()
        joints[:, 3] += np.abs(alpha_deg) - alpha_deg
        joints[:, 5] = 90.0 - joints[:, 3] - joints[:, 4]
        return joints

    @property
    def _cos_beta(self) -> Computed:
        """Cos beta of eq. 2 at the start; in truth it is that of the angle between the first link and the wrist."""
        x_mm, y_mm = self.poses[0, :2].tolist()
        wrist = (x_mm, y_mm - L4_MM)
        th1 = radians(float(self.joints[0, 3]))
        true = float(cos(th1) * wrist[0] + sin(th1) * wrist[1]) / hypot(*wrist)
        return Computed(_cos_beta(X_MM), _cos_beta(Y_MM), true)

    @property
    def formulas(self) -> dict[str, Computed]:
        """The misprinted formulas: of the inverse, of the law and of the line."""
        instants_s = {"S_t1": RAMP_S, "S_middle": DURATION_S - RAMP_S / 2, "S_T": DURATION_S}
        laws = printed_position_mm, corrected_position_mm, swept_mm
        x_mm, y_mm = self.poses[-1, :2].tolist()
        first_deg, middle_deg, last_deg = self.poses[[0, 500, -1], 3].tolist()
        printed_off_mm = float(self.apart_mm(self.printed_joints, self.joints)[-1])
        corrected_deg = first_deg + 500 * (last_deg - first_deg) / 1000
        return {
            "cos_beta": self._cos_beta,
            "beta": Computed(*map(_arc_cosine_deg, self._cos_beta)),
            "alpha": Computed(printed_off_mm, hypot(x_mm - X_MM, y_mm - (Y_MM - TRAVEL_MM)), 0.0),
            **{name: Computed(*(law(t_s) for law in laws)) for name, t_s in instants_s.items()},
            "steps": Computed(1000 * 0.001, 1000 * 0.01, DURATION_S),
            "end": Computed(Y_MM + TRAVEL_MM, Y_MM - TRAVEL_MM, -10.0),
            "attitude": Computed(500 * 90.0 / 1000, corrected_deg, middle_deg),
        }

    @property
    def pull(self) -> Figures:
        """The pull: its law, when the wrist crosses y = 0 and each cell is out, and how far x, y and phi go; joints."""
        law, out_mm = self.law, self.poses[0, 1] - self.poses[:, 1]
        x_mm, y_mm, _, phi_deg = np.ptp(self.poses, axis=0).tolist()
        cells = {f"cell_{n}_s": float(np.interp(CELL_MM * n, out_mm, self.t_s)) for n in (1, 2, 3)}
        return {
            "travel_mm": TRAVEL_MM,
            "intervals": len(self.joints) - 1,
            "arm_joints": len(self.robot.joints) - 2,
            "law_mm": float(law.position(np.array([DURATION_S]))[0]),
            "crossing_s": float(np.interp(0.0, L4_MM - self.poses[:, 1], self.t_s)),
            **{"x_mm": x_mm, "y_mm": y_mm, "phi_deg": phi_deg},
            **cells,
        }

    @property
    def planar_arm_picture(self) -> "Figure":
        """Fig. 4: the planar arm at a position that shows all angles of eq. 2."""

        return planar_arm((L2_MM, L3_MM, L4_MM), (20.0, 50.0, -25.0))

    @cached_property
    def law(self) -> Trapezoid:
        """The law of the job: trapezoidal speed."""
        return Trapezoid(TRAVEL_MM, DURATION_S, RAMP_S)

    @property
    def law_panels(self) -> tuple[Panel, ...]:
        """Eq. 3 as printed and as corrected, and the speed."""
        printed, corrected = (
            np.array([law(float(t_s)) for t_s in self.t_s]) for law in (printed_position_mm, corrected_position_mm)
        )
        return (
            Panel("the drawer's way S(t)", "time [s]", "S [mm]",
                  (Curve("corrected", self.t_s, corrected, "broad"), Curve("as printed", self.t_s, printed, "broken"))),
            Panel("its speed", "time [s]", "dS/dt [mm/s]",
                  (Curve("corrected", self.t_s, self.law.velocity(self.t_s)),)),
        )  # fmt: skip

    @property
    def peak_deg_s(self) -> dict[str, float]:
        """Each joint's peak speed between the samples."""
        peaks = np.abs(np.diff(self.joints, axis=0)).max(axis=0) / (DURATION_S / (_SAMPLES - 1))
        return dict(zip(self.robot.joint_names, peaks.tolist(), strict=True))

    @property
    def joint_rows(self) -> Rows:
        """The joints every second."""
        chosen = range(0, _SAMPLES, 100)
        return [[f"{self.t_s[k]:g}", f"{self.poses[k, 1]:z.3f}", *texts(self.joints[k, 3:])] for k in chosen]

    @property
    def joint_panels(self) -> tuple[Panel, ...]:
        """Fig. 5: the arm's joints over time."""
        names = zip(self.robot.joint_names, self.joints.T, strict=True)
        columns = [(f"{name} [deg]", [(name, column, "line")]) for name, column in names if name.startswith("th")]
        return _lettered(panels_over(self.t_s, "time [s]", columns))

    @property
    def pose_panels(self) -> tuple[Panel, ...]:
        """Fig. 6: the tool's pose, and where the printed inverse takes it."""
        printed = self.kinematics.forward(self.printed_joints)
        columns = [
            (name, [("corrected", self.poses[:, i], "broad"), ("alpha by arc cosine", printed[:, i], "broken")])
            for i, name in ((0, "x [mm]"), (1, "y [mm]"), (3, "phi [deg]"))
        ]
        return _lettered(panels_over(self.t_s, "time [s]", columns))

    @property
    def _shelf(self) -> Any:
        """What the emulated shelf tells of the experiment."""
        return self.run[_EXPERIMENT].outcome.comparison.evidence.features["shelf"]

    @property
    def drawer(self) -> Figures:
        """How far the drawer is out at the end by the emulated shelf, and how many of its cells."""
        out_mm, cells = self._shelf.open_mm, self._shelf.cells_out
        return {"open_mm": sum(out_mm.values()), "cells": sum(cells.values())}

    @property
    def drawer_picture(self) -> "Figure":
        """Fig. 7: the arm from above by the run's counts: the drawer connected, and one, two and three cells out."""

        run = self.run[_EXPERIMENT]
        pulled_s = [0.0, *(self.pull[f"cell_{n}_s"] for n in (1, 2, 3))]
        joints = run.counted(run.duration_s - DURATION_S + np.array(pulled_s))
        ends = ((L2_MM, L3_MM, L4_MM) * np.exp(1j * np.deg2rad(joints[:, 3:].cumsum(axis=1)))).cumsum(axis=1)
        arms_mm = [np.column_stack([[0.0, *arm.real], [0.0, *arm.imag]]) for arm in ends]
        names = ("(a) connected", "(b) one cell out", "(c) two cells out", "three cells out")
        front_mm = arms_mm[0][-1, 1]
        return open_drawers(
            [OpenDrawer(name, arm, front_mm - arm[-1, 1]) for name, arm in zip(names, arms_mm, strict=True)]
        )


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
    _angle(axes, points[0], 62, (0.0, joints_deg[0]), "theta1", _ARM)
    _angle(axes, points[0], 105, (joints_deg[0], alpha_deg), "beta", LIMIT)
    _angle(axes, points[0], 150, (0.0, alpha_deg), "alpha", COUNTED)
    _angle(axes, points[1], 45, (turned_deg[0], turned_deg[1]), "theta2", _ARM)
    _angle(axes, points[2], 36, (turned_deg[1], turned_deg[2]), "theta3", _ARM)
    _angle(axes, points[3], 30, (0.0, turned_deg[2]), "phi", _ARM)
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


def _angle(axes: Axes, at: FloatArray, radius: float, ends_deg: tuple[float, float], name: str, colour: str) -> None:
    """Draw an angle's arc, counted from the first end to the second, with its name beside its first third."""
    lower_deg, upper_deg = min(ends_deg), max(ends_deg)
    axes.add_patch(Arc((at[0], at[1]), 2 * radius, 2 * radius, theta1=lower_deg, theta2=upper_deg, color=colour))
    middle = np.deg2rad(ends_deg[0] + 0.3 * (ends_deg[1] - ends_deg[0]))
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
