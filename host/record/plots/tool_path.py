"""Draw the tool's path, planned and counted: with the arm, with a magnified error, and its largest error close up."""

from typing import Final

import numpy as np
from matplotlib.axes import Axes

from steptwin.host.common.arrays import FloatArray
from steptwin.host.record.path_error import PathError, path_error
from steptwin.host.record.plots.canvas import COUNTED, LIMIT, PLANNED, Sheet, write_inside
from steptwin.host.record.plots.shown_run import ShownRun
from steptwin.host.record.plots.stick_figure import AT_ENDS, BETWEEN, Pen, draw_arm, plane_of
from steptwin.host.robots.kinematics import ArmPart, make_kinematics
from steptwin.host.robots.kinematics.base import tool_frames
from steptwin.host.robots.robot import Robot
from steptwin.host.verify import Comparison

WIDE_MM: Final = 1.0
"""Least height of a panel in mm, deg or mm/s; in a smaller one rounding errors would look like motion."""

_NAMES: Final = {"phi": "attitude"}
_TITLES: Final = {3: "position", 4: "position and attitude"}
"""Titles of a tool's coordinates, by their number; a tool that turns in space has more."""
_COLUMN: Final = 4
"""Rows of the right column: three axes of the tool, and the speed."""
_AXES: Final = ("n, the tool's x axis", "o, its y axis", "a, its z axis")
_STYLES: Final = ("-", "--", ":")
"""Line styles of the direction cosines with x, y and z, for prints without colours."""


def draw_tool_pose(sheet: Sheet, shown: ShownRun) -> None:
    """Draw the tool's coordinates at the left; at the right the direction cosines of a known robot, and the speed."""
    comparison, t_s = shown.comparison, shown.planned_s
    robot, task, forward = comparison.expected.robot, comparison.expected.task, comparison.expected.forward
    labels = [f"{_NAMES.get(name, name)} [{unit or '1'}]" for name, unit in task.coordinates.items()]
    rows = sheet.panels(max(len(labels), _COLUMN), band_lines=1)
    planned, counted = comparison.expected.motion.positions(t_s), _counted(comparison, t_s)
    poses, counted_poses = (task.unwrapped(task.figures(forward(joints))) for joints in (planned, counted))
    for (axes, _), values, counted_values, label in zip(rows, poses.T, counted_poses.T, labels, strict=False):
        _draw_both(axes, t_s, values, counted_values)
        axes.set_ylabel(label)
    cosines = [axes for _, axes in rows[: len(_AXES)]]
    for axes in [axes for _, axes in rows[:-1] if robot is None or axes not in cosines]:
        axes.set_axis_off()
    for axes, _ in rows[len(labels) :]:
        axes.set_axis_off()
    if robot is not None:
        _draw_cosines(cosines, t_s, robot, counted)
    _draw_speed(rows[-1][1], t_s, poses[:, :3])
    rows[0][0].set_title(_TITLES.get(len(labels), "position and orientation"), loc="left")
    sheet.legend(rows[0][0], 2)
    rows[-1][0].set_xlim(0.0, shown.end_s)


def _counted(comparison: Comparison, t_s: FloatArray) -> FloatArray:
    """Return the joints, of shape (n, joints), by the drivers' counts just after each instant."""
    return comparison.expected.joints(np.column_stack([axis.around(t_s)[1] for axis in comparison.counted]))


def _draw_both(axes: Axes, t_s: FloatArray, planned: FloatArray, counted: FloatArray) -> None:
    axes.plot(t_s, planned, color=PLANNED, linewidth=4, label="planned")
    axes.plot(t_s, counted, color=COUNTED, linewidth=0.8, label="counted")
    _widen(axes, planned)


def _widen(axes: Axes, values: FloatArray) -> None:
    middle = (values.min() + values.max()) / 2
    axes.update_datalim([(0.0, middle - WIDE_MM / 2), (0.0, middle + WIDE_MM / 2)])


def _draw_cosines(column: list[Axes], t_s: FloatArray, robot: Robot, joints: FloatArray) -> None:
    frames = tool_frames(make_kinematics(robot), joints)
    for k, (axes, what) in enumerate(zip(column, _AXES, strict=True)):
        for coordinate, style in enumerate(_STYLES):
            axes.plot(t_s, frames[:, coordinate, k], color=COUNTED, linestyle=style, label="xyz"[coordinate])
        axes.set_ylim(-1.1, 1.1)
        axes.set_ylabel(f"cosines of {what[0]} [1]")
        axes.set_title(what, loc="left")
    column[0].legend(loc="lower right", bbox_to_anchor=(1.0, 1.2), borderaxespad=0.0, ncols=3)


def _draw_speed(axes: Axes, t_s: FloatArray, planned_mm: FloatArray) -> None:
    speeds = np.linalg.norm(np.diff(planned_mm, axis=0), axis=1) / np.diff(t_s)
    axes.plot((t_s[1:] + t_s[:-1]) / 2, speeds, color=COUNTED)
    _widen(axes, speeds)
    axes.set_ylim(bottom=0.0)
    axes.set_ylabel("[mm/s]")
    axes.set_title("planned speed along the path", loc="left")


INSTANTS: Final = 20_001
CLOSE_ERRORS: Final = 4.0
"""Half the width of the close view, relative to the largest error."""

FLAT_PART: Final = 0.01
"""Fraction of the widest coordinate's motion below which a coordinate gets no view of its own."""

ARM_INSTANTS: Final = 7
"""Number of instants with a drawn arm, from start to end; more would hide the path."""

LEAST_VIEW_MM: Final = 1.0
"""Width of the view around a tool at standstill."""

Plane = tuple[int, int]
"""Coordinates drawn horizontally and vertically: 0 is x, 1 is y, 2 is z."""


def draw_tool_path(sheet: Sheet, shown: ShownRun) -> None:
    """Draw the plane of the two coordinates that move most, then one with the third coordinate if it moves.

    Each of the two has the path with the arm, with magnified errors, and the largest error close up.
    """
    comparison = shown.comparison
    whole = path_error(comparison, np.linspace(0.0, shown.end_s, INSTANTS))
    edges = path_error(comparison, shown.drawn_s)
    views = _views(whole)
    rows = sheet.panels(2 * len(views) - (len(views) > 1), band_lines=2, share="none")
    cells = [axes for row in rows for axes in row]
    for n, view in enumerate(views):
        with_arm, magnified, close = cells[3 * n : 3 * n + 3]
        draw_arm_and_path(with_arm, comparison, whole, view)
        if whole.extents_mm.any():
            gain = whole.gain
            title = f"error magnified {gain:g} times" if gain > 1.0 else "error not magnified"
            _draw_whole(magnified, whole, view, gain, title)
        else:
            magnified.set_axis_off()
            write_inside(magnified, "the tool does not move")
        _draw_close(close, edges, view)
    for axes in cells[3 * len(views) :]:
        axes.remove()
    sheet.legend(cells[0], 3)


def draw_arm_and_path(axes: Axes, comparison: Comparison, path: PathError, view: Plane | None = None) -> None:
    """Draw the path with the arm at some instants, by default in the plane of the coordinates that move most."""
    view = view or _views(path)[0]
    links = _links(comparison)
    _draw_arm(axes, links, view)
    _draw_whole(axes, path, view, 1.0, f"{'with the arm, ' if links else ''}true to scale")


def _links(comparison: Comparison) -> tuple[ArmPart, ...]:
    """Return the arm's planned parts at some instants of the motion; None for an unknown robot."""
    expected = comparison.expected
    if expected.robot is None:
        return ()
    t_s = np.linspace(0.0, expected.motion.duration_s, ARM_INSTANTS)
    return make_kinematics(expected.robot).links(expected.motion.positions(t_s))


def _draw_arm(axes: Axes, links: tuple[ArmPart, ...], view: Plane) -> None:
    """Draw the arm along its way, then on top of it at the start and at the end."""
    between, start, end = Pen(BETWEEN, 0.45), Pen(AT_ENDS), Pen(AT_ENDS, style="--")
    draw_arm(axes, links, range(1, ARM_INSTANTS - 1), plane_of(*view), between)
    draw_arm(axes, links, [ARM_INSTANTS - 1], plane_of(*view), end, "arm at the end")
    draw_arm(axes, links, [0], plane_of(*view), start, "arm at the start")


def _views(path: PathError) -> list[Plane]:
    extents_mm = path.extents_mm
    first, second, third = np.argsort(-extents_mm, kind="stable").tolist()
    main = (min(first, second), max(first, second))
    flat = extents_mm[third] <= FLAT_PART * extents_mm[first]
    return [main] if flat else [main, (min(first, third), max(first, third))]


def _draw_whole(axes: Axes, path: PathError, view: Plane, gain: float, title: str) -> None:
    planned, counted = path.planned_mm[:, view], path.counted_mm(gain)[:, view]
    axes.plot(*planned.T, color=PLANNED, linewidth=5, label="planned")
    axes.plot(*counted.T, color=COUNTED, linewidth=0.6, label="counted")
    axes.plot(*planned[0], marker="o", color="black", linestyle="none", label="start")
    axes.plot(*planned[-1], marker="s", color="black", linestyle="none", label="end")
    if not path.extents_mm.any():
        axes.update_datalim(planned[:1] + LEAST_VIEW_MM / 2 * np.array([[-1.0, -1.0], [1.0, 1.0]]))
    _finish(axes, view, title)
    axes.set_aspect("equal", adjustable="datalim")


def _draw_close(axes: Axes, path: PathError, view: Plane) -> None:
    """Draw a window around the largest error, with single steps visible."""
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
    _finish(axes, view, f"largest error, {distances_mm[worst]:.3g} mm", " from there")


def _gapped(points: FloatArray, inside: np.ndarray[tuple[int], np.dtype[np.bool_]]) -> FloatArray:
    """Return the points inside, with a gap (NaN) wherever the path leaves the window in between."""
    kept: FloatArray = np.where(inside[:, None], points, np.nan)
    return kept[inside | np.roll(inside, 1)]


def _finish(axes: Axes, view: Plane, title: str, origin: str = "") -> None:
    across, up = view
    axes.set_xlabel(f"{'xyz'[across]}{origin} [mm]")
    axes.set_ylabel(f"{'xyz'[up]}{origin} [mm]")
    axes.set_title(title, loc="left")
