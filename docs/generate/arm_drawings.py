"""Draw an arm in space with its dimensions and joints, or with the frames of its DH table, for the pages."""

from collections.abc import Iterable
from dataclasses import replace
from itertools import pairwise
from typing import Any, Final

import numpy as np
from matplotlib.figure import Figure

from steptwin.host.common.arrays import FloatArray
from steptwin.host.record.plots.in_space import (
    TRIAD,
    draw_base,
    draw_parts,
    fit_views,
    points_around,
    points_of,
    rightwards,
    space_views,
)
from steptwin.host.robots.box import Box
from steptwin.host.robots.kinematics import ArmPart, make_kinematics
from steptwin.host.robots.kinematics.dh import Convention
from steptwin.host.robots.kinematics.marks import Skeleton
from steptwin.host.robots.robot import Robot

_TRIAD_PART: Final = 0.13
"""Length of a frame's axes in parts of the arm's extent."""
_BESIDE_PART: Final = 0.45
"""Distance between the labels of two axes that point the same way, level, in parts of their length."""
_NEAR: Final = 0.03
"""Origins nearer than this part of the extent share a label."""
_UP: Final = np.array([0.0, 0.0, 1.0])
_ASIDE_PART: Final = 0.07
"""Distance of a dimension's arrow from what it measures, in parts of the arm's extent."""
_HEAD_PART: Final = 0.03
"""Length of the head of a dimension's arrow in parts of the arm's extent."""
_DIMENSION: Final = "#a02010"
_PIECES: Final = 12
"""Places of a body that a label keeps away from."""
_AXIS: Final = "#2456a6"


def draw_arm_in_space(robot: Robot, joints: tuple[float, ...] | None = None) -> Figure:
    """Return a figure of the arm at a joint position, in mm and degrees, or at home, with its dimensions and joints.

    A robot on slides is drawn twice: the arm, and the whole robot with the boxes around it, such as its shelf.
    """
    kinematics, position = make_kinematics(robot), np.array([joints or robot.home])
    parts = kinematics.links(position)
    guided = [part for part in parts if part.name.startswith("rail")]
    figure = Figure()
    views = space_views(figure, parts, 2 if guided else 1)
    draw_parts(views[0], parts, within=points_around(parts))
    dimensions_mm = _draw_dimensions(views[0], robot, position)
    axes_mm = _draw_joint_axes(views[0], robot, position, parts, dimensions_mm)
    drawn = [points_around(parts), draw_base(views[0], parts, robot), dimensions_mm, axes_mm]
    shown = [np.vstack(drawn)]
    if guided:
        draw_parts(views[1], parts)
        boxes = [_draw_box(views[1], box) for box in robot.boxes.values()]
        shown.append(np.vstack([*(part.points_mm[0] for part in parts), *boxes]))
    fit_views(figure, views, shown, ("the arm", "with slides and boxes around") if guided else ())
    return figure


def draw_link_frames(robot: Robot, joints: tuple[float, ...]) -> Figure:
    """Return a figure of the arm with the frame behind each row of its DH table, and each row's z axis as a line.

    Frames are numbered as the table numbers them: 0 is the base's. Frames at the same place share their number's label.
    """
    kinematics, position = make_kinematics(robot), np.array([joints])
    parts = kinematics.links(position)
    figure = Figure()
    (axes,) = space_views(figure, parts)
    frames = kinematics.dh.frames(kinematics.dh_variables(position))[:, 0]
    points_mm = np.vstack([points_of(parts), frames[:, :3, 3]])
    extent_mm = float(np.ptp(points_mm, axis=0).max())
    draw_parts(axes, parts, alpha=0.35, within=points_mm)
    drawn = [points_mm, draw_base(axes, parts, robot)]
    for numbers in _together(frames, _NEAR * extent_mm):
        drawn.append(_draw_frames(axes, frames, numbers, _TRIAD_PART * extent_mm))
    fit_views(figure, [axes], [np.vstack(drawn)])
    return figure


def _draw_box(axes: Any, box: Box) -> FloatArray:
    """Draw a box's edges; return their ends, of shape (24, 3)."""
    for edge_mm in box.edges_mm:
        axes.plot(*edge_mm.T, color="0.55", linewidth=0.7)
    return box.edges_mm.reshape(-1, 3)


def dimension_names(robot: Robot) -> dict[tuple[int, str], str]:
    """Return the name of the robot's dimension behind a row's a or d in the DH table, by the row's index and letter.

    A dimension belongs to the parameter that changes with it.
    """
    rows, names = make_kinematics(robot).dh.rows, {}
    for key, value in robot.geometry.items():
        if not key.endswith("_mm") or not isinstance(value, float):
            continue
        changed = make_kinematics(replace(robot, geometry={**robot.geometry, key: value * 1.01 + 0.01})).dh.rows
        for i, (row, other) in enumerate(zip(rows, changed, strict=True)):
            for letter, before, after in (
                ("a", row.a_mm, other.a_mm),
                ("d", row.d_mm.constant, other.d_mm.constant),
            ):
                if before != after and before:
                    names[i, letter] = key.removesuffix("_mm")
    return names


def _draw_dimensions(axes: Any, robot: Robot, position: FloatArray) -> FloatArray:
    """Draw an arrow beside each named length of the DH table, with name and mm; return the labels' places."""
    kinematics = make_kinematics(robot)
    dh = kinematics.dh
    frames = dh.frames(kinematics.dh_variables(position))[:, 0]
    extent_mm = float(np.ptp(points_of(kinematics.links(position)), axis=0).max())
    places, right = [frames[-1, :3, 3]], rightwards(axes.azim)
    for (i, letter), name in dimension_names(robot).items():
        modified, row = dh.convention is Convention.MODIFIED, dh.rows[i]
        if letter == "a":
            length_mm, direction = row.a_mm, frames[i if modified else i + 1, :3, 0]
        else:
            length_mm, direction = row.d_mm.constant, frames[i + 1 if modified else i, :3, 2]
        along_mm = length_mm * direction
        from_base = (letter == "a") is modified
        start_mm = frames[i, :3, 3] if from_base else frames[i + 1, :3, 3] - along_mm
        if letter == "d" and row.d_mm.variable:
            start_mm = start_mm - (kinematics.dh_variables(position)[row.d_mm.variable][0] * row.d_mm.sign) * direction
        aside_mm = _ASIDE_PART * extent_mm * (right if abs(direction[2]) > 0.5 else _UP)
        ends = start_mm + aside_mm, start_mm + aside_mm + along_mm
        head = min(0.4, _HEAD_PART * extent_mm / abs(length_mm))
        for end, way in zip(ends, (along_mm, -along_mm), strict=True):
            axes.quiver(*end, *way, color=_DIMENSION, linewidth=1.0, arrow_length_ratio=head)
            axes.plot(*np.array([end - aside_mm, end]).T, color=_DIMENSION, linewidth=0.5)
        place = (ends[0] + ends[1]) / 2 + 0.5 * aside_mm
        upright = aside_mm[2] == 0.0
        ways = ("left", "center") if upright else ("center", "bottom")
        _write(axes, place, f"{name} = {abs(length_mm):g} mm", _DIMENSION, *ways)
        places += [place, place + 0.2 * extent_mm * right] if upright else [place]
    return np.array(places)


def _draw_joint_axes(
    axes: Any, robot: Robot, position: FloatArray, parts: tuple[ArmPart, ...], labels_mm: FloatArray
) -> FloatArray:
    """Draw the axis of each joint, with its name at the end that is farther from bodies and other names in the picture.

    Joints on one axis share it. `labels_mm`, of shape (n, 3), are the places of labels. Returns the ends, (n, 3).
    """
    named: list[tuple[FloatArray, str]] = []
    for mark, name in zip(Skeleton(robot).axes(position), robot.joint_names, strict=True):
        ends_mm = mark.points_mm[0]
        for n, (known_mm, names) in enumerate(named):
            if (joined_mm := _joined(known_mm, ends_mm)) is not None:
                named[n] = joined_mm, f"{names}, {name}"
                break
        else:
            named.append((ends_mm, name))
    picture = _picture_of(axes)
    taken = [np.linspace(start, end, _PIECES) @ picture for part in parts for start, end in pairwise(part.points_mm[0])]
    taken.append(labels_mm @ picture)
    for ends_mm, name in named:
        axes.plot(*ends_mm.T, color=_AXIS, linewidth=1.0, linestyle="-.")
        outside_mm = ends_mm + 0.1 * (ends_mm - ends_mm[::-1])
        beside_mm = picture @ _across((ends_mm[1] - ends_mm[0]) @ picture)
        places_mm = np.vstack([outside_mm + part * beside_mm for part in (0.0, 0.2, -0.2)])
        room = [np.linalg.norm(np.vstack(taken) - place_mm @ picture, axis=1).min() for place_mm in places_mm]
        place_mm = places_mm[int(np.argmax(room))]
        taken.append(np.array([place_mm @ picture]))
        _write(axes, place_mm, name, _AXIS, "center", "center")
    return np.vstack([ends_mm for ends_mm, _ in named])


def _across(way: FloatArray) -> FloatArray:
    """Return a way in the picture, of shape (2,), turned by a quarter."""
    return np.array([-way[1], way[0]])


def _joined(first_mm: FloatArray, second_mm: FloatArray) -> FloatArray | None:
    """Return the ends of two axes together, both of shape (2, 3); None unless they are one line, or far along it."""
    way_mm = first_mm[1] - first_mm[0]
    along = (second_mm - first_mm[0]) @ way_mm / (way_mm @ way_mm)
    off_mm = np.linalg.norm(second_mm - first_mm[0] - np.outer(along, way_mm), axis=1)
    if off_mm.max() > 1.0 or along.min() > 1.0 or along.max() < 0.0:
        return None
    return np.asarray(first_mm[0] + np.outer([min(0.0, along.min()), max(1.0, along.max())], way_mm))


def _picture_of(axes: Any) -> FloatArray:
    """Return the directions in space that are to the right and upwards in the picture, the columns of (3, 2)."""
    right, tilt_rad = rightwards(axes.azim), np.deg2rad(axes.elev)
    towards = np.cross(right, _UP)
    return np.column_stack([right, np.cos(tilt_rad) * _UP - np.sin(tilt_rad) * towards])


def _together(frames: FloatArray, near_mm: float) -> list[list[int]]:
    """Return the numbers of the frames, those with nearly the same origin together."""
    return _grouped(range(len(frames)), frames[:, :3, 3], near_mm)


def _grouped(numbers: Iterable[int], vectors: FloatArray, near: float) -> list[list[int]]:
    """Return numbers of vectors, of shape (n, 3), each together with the first one that is as near as this."""
    groups: list[list[int]] = []
    for number in numbers:
        same = (group for group in groups if np.linalg.norm(vectors[group[0]] - vectors[number]) < near)
        if (group := next(same, None)) is None:
            groups.append([number])
        else:
            group.append(number)
    return groups


def _draw_frames(axes: Any, frames: FloatArray, numbers: list[int], length_mm: float) -> FloatArray:
    """Draw frames with a common origin, their axes' names at the ends; return the ends, of shape (n, 3).

    Axes that several frames share carry all their numbers in one label.
    """
    origin_mm = frames[numbers[0], :3, 3]
    labels = [
        (frames[shared[0], :3, column], f"{letter}{','.join(map(str, shared))}", colour)
        for column, (letter, colour) in enumerate(TRIAD)
        for shared in _grouped(numbers, frames[:, :3, column], 1e-6)
    ]
    for i, (direction, name, colour) in enumerate(labels):
        before = sum(bool(np.allclose(direction, other, atol=1e-6)) for other, _, _ in labels[:i])
        away = 1.22 + before * (0.24 if abs(direction[2]) > 0.5 else _BESIDE_PART)
        axes.quiver(*origin_mm, *(length_mm * direction), color=colour, linewidth=1.8, arrow_length_ratio=0.18)
        _write(axes, origin_mm + away * length_mm * direction, name, colour, "center", "center")
    return np.array([origin_mm + 1.25 * length_mm * direction for direction, _, _ in labels])


def _write(axes: Any, place_mm: FloatArray, text: str, colour: str, across: str, up: str) -> None:
    """Write a label, aligned `across` and `up` in matplotlib's words, on a ground that no line crosses."""
    ground = {"facecolor": "white", "alpha": 0.75, "edgecolor": "none", "pad": 0.8}
    axes.text(*place_mm, text, color=colour, ha=across, va=up, fontsize=9, bbox=ground)
