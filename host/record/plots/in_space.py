"""Draw an arm in space, with the frames of its DH table or the path of its tool: three-dimensional, true to scale."""

from typing import Any, Final

import numpy as np
from matplotlib.figure import Figure

from steptwin.host.common.arrays import FloatArray
from steptwin.host.record.plots.canvas import COUNTED, HEADING_INCHES, LIMIT, WIDTH_INCHES
from steptwin.host.robots.kinematics import ArmPart, Role, make_kinematics
from steptwin.host.robots.robot import Robot

ARM: Final = "#7a3d00"
"""Colour of the arm: dark brown, as in the views onto planes."""
TRIAD: Final = (("x", "#b5432a"), ("y", "#2a7f62"), ("z", "#2456a6"))
"""Names and colours of a frame's axes; the letter is written at each axis' end, so that print needs no colours."""

_WIDTHS: Final = {Role.GUIDE: 1.2, Role.SLIDE: 5.0, Role.LINK: 4.5, Role.TOOL: 2.0}
_INCHES: Final = 6.4
_ZOOM: Final = 1.15
_TRIAD_PART: Final = 0.13
"""Length of a frame's axes in parts of the arm's extent."""
_BASE_PART: Final = 0.08
"""Radius of the base's ring in parts of the arm's extent."""
_DEPTH_PART: Final = 0.4
"""Least depth of the view's box in parts of its longest side."""
_NEAR: Final = 0.03
"""Origins nearer than this part of the extent share a label."""
_VIEW: Final = (24.0, -58.0)
"""Elevation and azimuth in degrees from which the arm is seen."""


def draw_arm_in_space(robot: Robot, joints: tuple[float, ...] | None = None) -> Figure:
    """Return a figure of the arm at a joint position, in mm and degrees, or at home."""
    figure, axes = _space()
    position = np.array([joints or robot.home])
    parts = make_kinematics(robot).links(position)
    _draw_parts(axes, parts)
    _set_view(axes, np.vstack([_points_of(parts), _draw_base(axes, parts, robot)]))
    return figure


def draw_link_frames(robot: Robot, joints: tuple[float, ...]) -> Figure:
    """Return a figure of the arm with the frame behind each row of its DH table, and each row's z axis as a line.

    Frames are numbered as the table numbers them: 0 is the base's. Frames at the same place share their number's label.
    """
    figure, axes = _space()
    kinematics, position = make_kinematics(robot), np.array([joints])
    parts = kinematics.links(position)
    frames = kinematics.dh.frames(kinematics.dh_variables(position))[:, 0]
    points_mm = np.vstack([_points_of(parts), frames[:, :3, 3]])
    extent_mm = float(np.ptp(points_mm, axis=0).max())
    _draw_parts(axes, parts, alpha=0.35)
    drawn = [points_mm, _draw_base(axes, parts, robot)]
    for numbers in _together(frames, _NEAR * extent_mm):
        drawn.append(_draw_frames(axes, frames, numbers, _TRIAD_PART * extent_mm))
    _set_view(axes, np.vstack(drawn))
    return figure


def draw_path_in_space(robot: Robot, wanted_mm: FloatArray, reached_mm: FloatArray, joints: FloatArray) -> Figure:
    """Return a figure of a path in space, near and with the arm.

    Args:
        robot: the robot.
        wanted_mm: prescribed path, of shape (n, 3).
        reached_mm: path that the tool takes, of shape (m, 3).
        joints: where the arm is drawn, of shape (joints,).
    """
    figure = Figure(figsize=(WIDTH_INCHES, 4.8 + HEADING_INCHES), layout="constrained")
    near: Any = figure.add_subplot(1, 2, 1, projection="3d")  # Any: matplotlib's stubs know no 3D axes
    whole: Any = figure.add_subplot(1, 2, 2, projection="3d")
    parts = make_kinematics(robot).links(joints[np.newaxis])
    _draw_parts(whole, parts)
    base_mm = _draw_base(whole, parts, robot)
    for axes in (near, whole):
        axes.plot(*wanted_mm.T, color=LIMIT, linewidth=4.0, alpha=0.45, label="prescribed")
        axes.plot(*reached_mm.T, color=COUNTED, linewidth=1.0, label="by the joints")
    near.set_title("the path", loc="left")
    whole.set_title("with the arm", loc="left")
    _set_view(near, wanted_mm)
    _set_view(whole, np.vstack([_points_of(parts), base_mm, wanted_mm]))
    figure.legend(handles=near.get_lines(), loc="outside lower left", ncols=2)
    return figure


def _space() -> tuple[Figure, Any]:
    figure = Figure(figsize=(WIDTH_INCHES, _INCHES + HEADING_INCHES), layout="constrained")
    return figure, figure.add_subplot(projection="3d")


def _points_of(parts: tuple[ArmPart, ...]) -> FloatArray:
    """Return all points of the parts but the guides', which may be far longer than the arm, of shape (n, 3)."""
    return np.vstack([part.points_mm[0] for part in parts if part.role is not Role.GUIDE])


def _draw_parts(axes: Any, parts: tuple[ArmPart, ...], alpha: float = 1.0) -> None:
    for part in parts:
        shown = alpha / 3 if part.role is Role.GUIDE else alpha
        axes.plot(*part.points_mm[0].T, color=ARM, alpha=shown, linewidth=_WIDTHS[part.role], solid_capstyle="round",
                  marker="o" if part.role is Role.LINK else "", markersize=7, markerfacecolor="white")  # fmt: skip


def _draw_base(axes: Any, parts: tuple[ArmPart, ...], robot: Robot) -> FloatArray:
    """Draw a ring around the base's axis, at the arm's lowest height; return its points, of shape (n, 3)."""
    points_mm = _points_of(parts)
    radius_mm = _BASE_PART * float(np.ptp(points_mm, axis=0).max())
    lowest_mm = min(float(part.points_mm[0, :, 2].min()) for part in parts)
    angle = np.linspace(0.0, 2 * np.pi, 60)
    across, up = radius_mm * np.cos(angle), radius_mm * np.sin(angle)
    x_mm, y_mm = make_kinematics(robot).dh.base.matrix[:2, 3]
    ring_mm = np.column_stack([x_mm + across, y_mm + up, np.full_like(angle, lowest_mm)])
    axes.plot(*ring_mm.T, color="0.35", linewidth=1.2)
    return ring_mm


def _together(frames: FloatArray, near_mm: float) -> list[list[int]]:
    """Return the numbers of the frames, those with nearly the same origin together."""
    groups: list[list[int]] = []
    for number, frame in enumerate(frames):
        for group in groups:
            if np.linalg.norm(frames[group[0], :3, 3] - frame[:3, 3]) < near_mm:
                group.append(number)
                break
        else:
            groups.append([number])
    return groups


def _draw_frames(axes: Any, frames: FloatArray, numbers: list[int], length_mm: float) -> FloatArray:
    """Draw frames with a common origin, their axes' names at the ends; return the ends, of shape (n, 3).

    Axes that several frames share carry all their numbers in one label.
    """
    origin_mm = frames[numbers[0], :3, 3]
    labels: list[tuple[FloatArray, str, str]] = []
    for (letter, colour), column in zip(TRIAD, range(3), strict=True):
        for number in numbers:
            direction = frames[number, :3, column]
            for i, (other, name, shade) in enumerate(labels):
                if shade == colour and np.allclose(other, direction, atol=1e-6):
                    labels[i] = (other, f"{name},{number}", shade)
                    break
            else:
                labels.append((direction, f"{letter}{number}", colour))
    for i, (direction, name, colour) in enumerate(labels):
        away = 1.22 + 0.24 * sum(bool(np.allclose(direction, other, atol=1e-6)) for other, _, _ in labels[:i])
        axes.quiver(*origin_mm, *(length_mm * direction), color=colour, linewidth=1.8, arrow_length_ratio=0.18)
        axes.text(*(origin_mm + away * length_mm * direction), name, color=colour, ha="center", va="center", fontsize=9)
    return np.array([origin_mm + 1.25 * length_mm * direction for direction, _, _ in labels])


def _set_view(axes: Any, points_mm: FloatArray) -> None:
    """Show a box around the points, with equal scales along x, y and z."""
    lower, upper = points_mm.min(axis=0), points_mm.max(axis=0)
    span = np.maximum(upper - lower, _DEPTH_PART * float((upper - lower).max()))
    middle = (lower + upper) / 2
    limits = [(float(m - s / 2), float(m + s / 2)) for m, s in zip(middle, span, strict=True)]
    axes.set(xlabel="x [mm]", ylabel="y [mm]", zlabel="z [mm]", xlim=limits[0], ylim=limits[1], zlim=limits[2])
    axes.set_box_aspect(tuple(span / span.max()), zoom=_ZOOM)
    axes.view_init(*_VIEW)
    axes.locator_params(nbins=5)
