"""Draw the tool's path, planned and counted: true to scale, with a magnified error, and the largest error close up."""

from dataclasses import dataclass
from math import floor, log10

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from steptwin.host.common.arrays import FloatArray
from steptwin.host.record.plots.canvas import COUNTED, LIMIT, PLANNED, drawn_instants, new_figure, write_inside
from steptwin.host.verify import Comparison, RunInfo
from steptwin.host.verify.deviation import deviations

PANEL_INCHES = 3.9
SIDE_PANEL_INCHES = 2.6
INSTANTS = 20_001
MAGNIFIED_PART = 0.04
"""Largest size of the magnified error, as a fraction of the path's extent."""

CLOSE_ERRORS = 4.0
"""Half the width of the close view, as a multiple of the largest error."""

FLAT_PART = 0.01
"""A coordinate that moves by less than this fraction of the widest one gets no view of its own."""

STILL_MM = 1e-6
"""A coordinate that moves by no more than this stands still: rounding causes the rest."""

LEAST_VIEW_MM = 1.0
"""Width of the view around a tool that stands still."""

Plane = tuple[int, int]
"""Coordinates drawn across and up: 0 is x, 1 is y, 2 is z."""


@dataclass(frozen=True, slots=True)
class _Path:
    """Planned tool positions and the errors of the counted ones in mm, each of shape (n, 3), in order of time."""

    planned_mm: FloatArray
    errors_mm: FloatArray

    @property
    def extents_mm(self) -> FloatArray:
        """Planned extent of each coordinate, shape (3,)."""
        extents_mm = np.ptp(self.planned_mm, axis=0)
        return np.where(extents_mm > STILL_MM, extents_mm, 0.0)

    def counted_mm(self, gain: float = 1.0) -> FloatArray:
        return self.planned_mm + gain * self.errors_mm


def draw_tool_path(comparison: Comparison, run: RunInfo) -> Figure:
    """Draw the plane of the two coordinates that move most, then a row with the third coordinate if it moves."""
    end_s = comparison.expected.trajectory.duration_s
    whole = _path(comparison, np.linspace(0.0, end_s, INSTANTS))
    edges = _path(comparison, drawn_instants(comparison))
    views = _views(whole)
    heights_inches = [PANEL_INCHES, SIDE_PANEL_INCHES][: len(views)]
    figure = new_figure(run, "tool path", sum(heights_inches))
    rows = figure.subplots(len(views), 3, squeeze=False, height_ratios=heights_inches)
    for row, view in zip(rows, views, strict=True):
        _draw_whole(row[0], whole, view, 1.0, "true to scale")
        if whole.extents_mm.any():
            _draw_magnified(row[1], whole, view)
        else:
            row[1].set_axis_off()
            write_inside(row[1], "the tool does not move")
        _draw_close(row[2], edges, view)
    figure.legend(*figure.axes[0].get_legend_handles_labels(), loc="outside upper right", ncols=4)
    return figure


def _path(comparison: Comparison, t_s: FloatArray) -> _Path:
    """Return the path just before and just after each instant."""
    end_s = comparison.expected.trajectory.duration_s
    errors_mm = np.concatenate([part.tool_mm.swapaxes(0, 1).reshape(-1, 3) for part in deviations(comparison, t_s)])
    poses = comparison.expected.forward(comparison.expected.trajectory.positions(np.minimum(t_s, end_s)))
    return _Path(np.repeat(poses[:, :3], 2, axis=0), errors_mm)


def _views(path: _Path) -> list[Plane]:
    extents_mm = path.extents_mm
    first, second, third = np.argsort(-extents_mm, kind="stable").tolist()
    main = (min(first, second), max(first, second))
    flat = extents_mm[third] <= FLAT_PART * extents_mm[first]
    return [main] if flat else [main, (min(first, third), max(first, third))]


def _gain(path: _Path) -> float:
    """Return 1, 2 or 5 times a power of ten that makes the error visible, but small against the path."""
    extent_mm, error_mm = path.extents_mm.max(), np.abs(path.errors_mm).max()
    wanted = MAGNIFIED_PART * float(extent_mm / error_mm) if error_mm > 0.0 else 1.0
    if wanted <= 1.0:
        return 1.0
    decade = 10.0 ** floor(log10(wanted))
    return decade * max(step for step in (1.0, 2.0, 5.0) if step * decade <= wanted)


def _draw_whole(axes: Axes, path: _Path, view: Plane, gain: float, title: str) -> None:
    planned, counted = path.planned_mm[:, view], path.counted_mm(gain)[:, view]
    axes.plot(*planned.T, color=PLANNED, linewidth=5, label="planned")
    axes.plot(*counted.T, color=COUNTED, linewidth=0.6, label="counted")
    axes.plot(*planned[0], marker="o", color="black", linestyle="none", label="start")
    axes.plot(*planned[-1], marker="s", color="black", linestyle="none", label="end")
    if not path.extents_mm.any():
        axes.update_datalim(planned[:1] + LEAST_VIEW_MM / 2 * np.array([[-1.0, -1.0], [1.0, 1.0]]))
    _finish(axes, view, title)
    axes.set_aspect("equal", adjustable="datalim")


def _draw_magnified(axes: Axes, path: _Path, view: Plane) -> None:
    gain = _gain(path)
    _draw_whole(axes, path, view, gain, f"error magnified {gain:g} times" if gain > 1.0 else "error not magnified")


def _draw_close(axes: Axes, path: _Path, view: Plane) -> None:
    """Draw a window around the largest error, where single steps are visible."""
    distances_mm = np.linalg.norm(path.errors_mm, axis=1)
    worst = int(distances_mm.argmax())
    half_mm = CLOSE_ERRORS * float(distances_mm[worst]) or 1.0
    offsets_mm = path.planned_mm - path.planned_mm[worst]
    inside = (np.abs(offsets_mm) < 2.0 * half_mm).all(axis=1)
    counted_mm = offsets_mm + path.errors_mm
    axes.plot(*_gapped(offsets_mm, inside)[:, view].T, color=PLANNED, linewidth=5)
    axes.plot(*_gapped(counted_mm, inside)[:, view].T, color=COUNTED, linewidth=0.9, marker=".", markersize=3)
    axes.plot(*np.stack([offsets_mm[worst], counted_mm[worst]])[:, view].T, color=LIMIT, linestyle=":", linewidth=3)
    axes.set_xlim(-half_mm, half_mm)
    axes.set_ylim(-half_mm, half_mm)
    axes.locator_params(nbins=5)
    axes.set_aspect("equal")
    _finish(axes, view, f"largest error, {distances_mm[worst]:.3g} mm (dotted)", " from there")


def _gapped(points: FloatArray, inside: np.ndarray[tuple[int], np.dtype[np.bool_]]) -> FloatArray:
    """Return the points inside, with a gap (NaN) wherever the path leaves the window in between."""
    kept: FloatArray = np.where(inside[:, None], points, np.nan)
    return kept[inside | np.roll(inside, 1)]


def _finish(axes: Axes, view: Plane, title: str, origin: str = "") -> None:
    across, up = view
    axes.set_xlabel(f"{'xyz'[across]}{origin} [mm]")
    axes.set_ylabel(f"{'xyz'[up]}{origin} [mm]")
    axes.set_title(title, loc="left")
