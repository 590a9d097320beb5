"""Draw an arm in space, with the path of its tool or a cloud of its positions: three-dimensional, true to scale."""

from collections.abc import Sequence
from dataclasses import replace
from itertools import product
from typing import Any, Final

import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from steptwin.host.common.arrays import FloatArray
from steptwin.host.record.path_error import path_error
from steptwin.host.record.plots.canvas import COUNTED, PLANNED, WIDTH_INCHES, Sheet
from steptwin.host.record.plots.shown_run import SAMPLES, ShownRun
from steptwin.host.robots.kinematics import ArmPart, Role, make_kinematics
from steptwin.host.robots.kinematics.base import tool_frames
from steptwin.host.robots.kinematics.marks import Skeleton
from steptwin.host.robots.robot import Robot

ARM: Final = "#7a3d00"
"""Colour of the arm: dark brown, as in the views onto planes."""
TRIAD: Final = (("x", "#b5432a"), ("y", "#2a7f62"), ("z", "#2456a6"))
"""Names and colours of a frame's axes; a letter at each axis' end makes prints readable without colours."""
_WIDTHS: Final = {Role.GUIDE: 1.2, Role.SLIDE: 5.0, Role.LINK: 4.5, Role.TOOL: 2.0, Role.HAND: 2.0}
_HIGHEST_INCHES: Final = 6.2
"""Largest height of a view's box on paper, without its labels."""
_SHARES: Final = {1: (1.0,), 2: (0.6, 0.4)}
"""Parts of the picture's width for each of one or two views."""
_NARROWEST_INCHES: Final = 6.0
"""Least width of a figure: that of its heading."""
_BESIDE_INCHES: Final = 1.6
"""Space for labels beside a view's box, on both sides together."""
_AROUND_INCHES: Final = (0.65, 0.8)
"""Space above the box, for headings, and below it, for its labels."""
_TICK_INCHES: Final = 0.7
"""Length of an axis on paper for each piece between its ticks."""
_LETTERS: Final = 9
"""Font size of the labels around a view."""
_BASE_PART: Final = 0.08
"""Radius of the base's ring, relative to the arm's extent."""
_DEPTH_PART: Final = 0.4
"""Least depth of the view's box, relative to its longest side."""
_LEAST_MM: Final = 1.0
"""Least side of the view's box, for a tool at standstill."""
_ELEVATION_DEG: Final = 24.0
"""Elevation of the camera."""
_AZIMUTHS_DEG: Final = (-58.0, -28.0, -118.0)
"""Possible azimuths of the camera: that which shows its shortest drawn link longest is used."""
HAND: Final = "#d9822b"
"""Colour of the arrow in the tool's direction."""
_POINTING: Final = {"scara": "x", "direction": "z", "pose": "z"}
"""The tool's axis that shows its orientation, by its task."""
_ARROWS: Final = 20
_ARROW_PART: Final = 0.12
"""Length of an arrow of the tool's direction, relative to the path's extent."""


def draw_cloud_in_space(robot: Robot, cloud_mm: FloatArray, colour: str) -> Figure:
    """Return a figure of positions of the tool, of shape (n, 3), and the arm at home."""
    parts = make_kinematics(robot).links(np.array([robot.home]))
    figure = Figure()
    (axes,) = space_views(figure, parts)
    axes.plot(*cloud_mm.T, "o", markeredgewidth=0, markersize=1.5, color=colour, alpha=0.7)
    drawn = np.vstack([cloud_mm, points_around(parts), draw_base(axes, parts, robot)])
    draw_parts(axes, parts, within=drawn)
    fit_views(figure, [axes], [drawn])
    return figure


def draw_in_space(sheet: Sheet, shown: ShownRun) -> None:
    """Draw a run's path with the tool's direction along it, and the arm at its start and end.

    Frames of base, joints and tool are those at the start. Without a known robot there is only the path.
    """
    comparison = shown.comparison
    robot, motion = comparison.expected.robot, comparison.expected.motion
    path = path_error(comparison, shown.planned_s)
    joints = motion.positions(shown.planned_s[:: SAMPLES // _ARROWS])
    links = make_kinematics(robot).links(joints) if robot else ()
    near, whole = space_views(sheet.figure, links, 2)
    for axes in (near, whole):
        axes.plot(*path.planned_mm.T, color=PLANNED, linewidth=4.0, label="planned")
        axes.plot(*path.counted_mm().T, color=COUNTED, linewidth=0.8, label="counted")
        axes.plot(*path.planned_mm[:1].T, "o", color="black", label="start")
        axes.plot(*path.planned_mm[-1:].T, "s", color="black", label="end")
    close, all_mm, title = [path.planned_mm], [path.planned_mm], "the path"
    if robot:
        start, end = (_at_one(links, i) for i in (0, -1))
        draw_parts(whole, end, alpha=0.35)
        draw_parts(whole, start)
        all_mm += [points_of(start), points_of(end), draw_base(whole, start, robot)]
        if shown.view.frames:
            all_mm += [_draw_mark(whole, mark) for mark in Skeleton(robot).frames(joints[:1])]
        if axis := _POINTING.get(comparison.expected.task.name):
            length_mm = _ARROW_PART * max(1.0, float(np.ptp(path.planned_mm, axis=0).max()))
            close.append(_draw_pointing(near, tool_frames(make_kinematics(robot), joints), axis, length_mm))
            title = f"the path and the tool's {axis} axis"
    views, titles = [near, whole], (title, "with the arm at start and end")
    fit_views(sheet.figure, views, [np.vstack(close), np.vstack(all_mm)], titles)
    sheet.entitle()
    sheet.figure.legend(handles=near.get_lines()[:4], loc="lower left", ncols=4)


def _draw_pointing(axes: Any, tools: FloatArray, axis: str, length_mm: float) -> FloatArray:
    """Draw an axis of the tool's frames, of shape (n, 4, 4), as arrows; return their ends, of shape (n, 3)."""
    ways_mm = length_mm * tools[:, :3, "xyz".index(axis)]
    for start_mm, way_mm in zip(tools[:, :3, 3], ways_mm, strict=True):
        axes.quiver(*start_mm, *way_mm, color=HAND, linewidth=1.2, arrow_length_ratio=0.3)
    return np.asarray(tools[:, :3, 3] + ways_mm)


def _at_one(parts: tuple[ArmPart, ...], instant: int) -> tuple[ArmPart, ...]:
    """Return the parts at one of their instants."""
    return tuple(replace(part, points_mm=part.points_mm[instant][np.newaxis]) for part in parts)


def _draw_mark(axes: Any, mark: ArmPart) -> FloatArray:
    """Draw the axis of a frame; return its ends, of shape (2, 3)."""
    ends_mm: FloatArray = mark.points_mm[0]
    axes.plot(*ends_mm.T, color=dict(TRIAD)[mark.role], linewidth=1.6)
    return ends_mm


def space_views(figure: Figure, parts: tuple[ArmPart, ...], count: int = 1) -> list[Any]:
    """Return views into space; Any: matplotlib's stubs know no 3D axes."""
    figure.set_size_inches(WIDTH_INCHES, WIDTH_INCHES)
    views: list[Any] = [figure.add_subplot(1, count, i + 1, projection="3d") for i in range(count)]
    for axes in views:
        axes.view_init(_ELEVATION_DEG, _azimuth_deg(parts))
    return views


def rightwards(azimuth_deg: float) -> FloatArray:
    """Return the direction in space that points right in a picture from an azimuth."""
    azimuth_rad = np.deg2rad(azimuth_deg)
    return np.array([-np.sin(azimuth_rad), np.cos(azimuth_rad), 0.0])


def _azimuth_deg(parts: tuple[ArmPart, ...]) -> float:
    """Return the azimuth that shows the links best, none of them end on."""
    ways_mm = [part.points_mm[0, -1] - part.points_mm[0, 0] for part in parts if part.role is Role.LINK]
    return max(_AZIMUTHS_DEG, key=lambda azimuth: min((abs(way @ rightwards(azimuth)) for way in ways_mm), default=0.0))


def points_of(parts: tuple[ArmPart, ...]) -> FloatArray:
    """Return all points of the parts except guides, which may be far longer than the arm, of shape (n, 3)."""
    return np.vstack([part.points_mm[0] for part in parts if part.role is not Role.GUIDE])


def points_around(parts: tuple[ArmPart, ...]) -> FloatArray:
    """Return the points of the parts and of guides no longer than the arm, of shape (n, 3)."""
    points_mm = points_of(parts)
    longest_mm = float(np.ptp(points_mm, axis=0).max())
    guides = [part.points_mm[0] for part in parts if part.role is Role.GUIDE]
    return np.vstack([points_mm, *(guide for guide in guides if np.ptp(guide, axis=0).max() <= longest_mm)])


def draw_parts(axes: Any, parts: tuple[ArmPart, ...], alpha: float = 1.0, within: FloatArray | None = None) -> None:
    """Draw the parts; guides, which may be far longer than the arm, only in the box of the points `within`."""
    for part in parts:
        points_mm, shown = part.points_mm[0], alpha
        if part.role is Role.GUIDE:
            shown = alpha / 2
            if within is not None:
                points_mm = np.clip(points_mm, within.min(axis=0), within.max(axis=0))
        if part.role is Role.HAND:
            axes.quiver(*points_mm[0], *(points_mm[1] - points_mm[0]), color=HAND, alpha=alpha, linewidth=2.0)
            continue
        axes.plot(*points_mm.T, color=ARM, alpha=shown, linewidth=_WIDTHS[part.role], solid_capstyle="round",
                  marker="o" if part.role is Role.LINK else "", markersize=7, markerfacecolor="white")  # fmt: skip


def draw_base(axes: Any, parts: tuple[ArmPart, ...], robot: Robot) -> FloatArray:
    """Draw a ring around the base's axis, at the arm's lowest height; return its points, of shape (n, 3)."""
    points_mm = points_of(parts)
    radius_mm = _BASE_PART * float(np.ptp(points_mm, axis=0).max())
    lowest_mm = min(float(part.points_mm[0, :, 2].min()) for part in parts)
    angle = np.linspace(0.0, 2 * np.pi, 60)
    across, up = radius_mm * np.cos(angle), radius_mm * np.sin(angle)
    x_mm, y_mm = make_kinematics(robot).dh.base.matrix[:2, 3]
    ring_mm = np.column_stack([x_mm + across, y_mm + up, np.full_like(angle, lowest_mm)])
    axes.plot(*ring_mm.T, color="0.35", linewidth=1.2)
    return ring_mm


def fit_views(figure: Figure, views: list[Any], points: list[FloatArray], titles: Sequence[str] = ()) -> None:
    """Draw a box around each view's points, side by side and as large as possible; adapt the figure's height.

    A single high and narrow view makes the figure narrower.
    """
    widths_inches = [WIDTH_INCHES * share for share in _SHARES[len(views)]]
    drawn = []
    for axes, points_mm, width_inches in zip(views, points, widths_inches, strict=True):
        _set_view(axes, points_mm)
        corners = np.array(list(product(*(axes.get_xlim3d(), axes.get_ylim3d(), axes.get_zlim3d()))))
        seen = np.column_stack([corners, np.ones(len(corners))]) @ axes.get_proj().T
        flat = seen[:, :2] / seen[:, 3:]
        lower, upper = flat.min(axis=0), flat.max(axis=0)
        scale = float(np.min(np.array([width_inches - _BESIDE_INCHES, _HIGHEST_INCHES]) / (upper - lower)))
        for axis, other in zip((axes.xaxis, axes.yaxis, axes.zaxis), (4, 2, 1), strict=True):
            long_inches = scale * float(np.linalg.norm(flat[other] - flat[0]))
            between = min(5, max(1, round(long_inches / _TICK_INCHES)))
            least = min(between, 2)
            axis.set_major_locator(MaxNLocator(between, steps=[1, 2, 2.5, 5, 10], min_n_ticks=least))
            axis.labelpad = 7.0
            axis.label.set_size(_LETTERS)
        axes.tick_params(labelsize=_LETTERS)
        drawn.append((lower, upper, scale))
    above_inches, below_inches = _AROUND_INCHES
    box_inches = max(scale * (upper[1] - lower[1]) for lower, upper, scale in drawn)
    height_inches = box_inches + above_inches + below_inches
    if len(views) == 1:
        lower, upper, scale = drawn[0]
        widths_inches = [min(WIDTH_INCHES, max(_NARROWEST_INCHES, scale * (upper - lower)[0] + 2 * _BESIDE_INCHES))]
    whole_inches = sum(widths_inches)
    figure.set_size_inches(whole_inches, height_inches)
    lefts_inches = [0.0, *widths_inches[:-1]]
    for start_inches, title in zip(lefts_inches, titles, strict=False):
        place = (start_inches + 0.3) / whole_inches, 1 - 0.55 / height_inches
        figure.text(*place, title, va="center", fontsize=10)
    for axes, start_inches, width_inches, (lower, upper, scale) in zip(
        views, lefts_inches, widths_inches, drawn, strict=True
    ):
        window = axes.viewLim
        middle = scale * ((lower + upper) / 2 - np.array([window.x0, window.y0]))
        left = start_inches + width_inches / 2 - middle[0]
        bottom = below_inches + box_inches / 2 - middle[1]
        side = scale * window.width
        axes.set_position((left / whole_inches, bottom / height_inches, side / whole_inches, side / height_inches))


def _set_view(axes: Any, points_mm: FloatArray) -> None:
    """Set a box around the points, with equal scales along x, y and z."""
    lower, upper = points_mm.min(axis=0), points_mm.max(axis=0)
    span = np.maximum(upper - lower, max(_DEPTH_PART * float((upper - lower).max()), _LEAST_MM))
    middle = (lower + upper) / 2
    limits = [(float(m - s / 2), float(m + s / 2)) for m, s in zip(middle, span, strict=True)]
    axes.set(xlabel="x [mm]", ylabel="y [mm]", zlabel="z [mm]", xlim=limits[0], ylim=limits[1], zlim=limits[2])
    axes.set_box_aspect(tuple(span / span.max()))
