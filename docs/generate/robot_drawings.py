"""Draw each kind of mechanism with its dimensions and joints: the arm from above and from the side."""

from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any, Final

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Arc

from docs.generate.arm_drawings import draw_arm_in_space
from docs.generate.commands import DOCS, GeneratedPage
from docs.generate.drawing import write_picture
from docs.generate.machine_pages import machine_options
from docs.generate.markdown import table
from steptwin.features.papers.hybrid_arm import GUIDE_PART
from steptwin.host.common.arrays import FloatArray
from steptwin.host.robots import load_robot, read_robot
from steptwin.host.robots.kinematics.base import dimensions, meaning
from steptwin.host.robots.kinematics.kinds import kinds
from steptwin.host.robots.new_file import robot_text, usual_dimensions, usual_joints, with_settings

_LINK: Final[dict[str, Any]] = {"color": "#3b4a5a", "linewidth": 7, "solid_capstyle": "round", "zorder": 2}
_DIMENSION: Final = "#c2410c"
_JOINT: Final = "#1d4ed8"
_SHOULDER_DEG, _ELBOW_DEG, _TOOL_DEG = 28.0, 42.0, -60.0
_L1, _L2, _TOOL = 200.0, 150.0, 55.0


def drawing(kind: str) -> Path:
    """Return the file of a kind's drawing."""
    return DOCS / "pictures" / f"kind-{kind}.png"


def write_robot_drawings() -> None:
    """Draw every kind again."""
    for kind, draw in _DRAWINGS.items():
        write_picture(drawing(kind), draw)


def _scara() -> Figure:
    figure = Figure(figsize=(13.4, 4.4), layout="constrained")
    figure.suptitle("scara", x=0.01, ha="left", weight="bold")
    above, last, first = figure.subplots(1, 3, width_ratios=(1.15, 1.0, 1.0))
    _from_above(above)
    _from_the_side(last, lift_first=False)
    _from_the_side(first, lift_first=True)
    return figure


def _from_above(axes: Axes) -> None:
    heading_deg = 14.0
    first_deg = heading_deg + _SHOULDER_DEG
    second_deg = first_deg + _ELBOW_DEG
    tool_deg = second_deg + _TOOL_DEG
    shoulder = np.zeros(2)
    elbow = shoulder + _L1 * _unit(first_deg)
    wrist = elbow + _L2 * _unit(second_deg)
    tip = wrist + _TOOL * _unit(tool_deg)
    axes.plot(*np.array([shoulder, elbow, wrist]).T, marker="o", markersize=11, **_LINK)
    _beside(axes, shoulder, elbow, "l1_mm")
    _beside(axes, elbow, wrist, "l2_mm")
    _line(axes, shoulder, shoulder + 110 * _unit(heading_deg))
    _angle(axes, shoulder, (0.0, heading_deg), 190.0, "heading_deg", _DIMENSION)
    _angle(axes, shoulder, (heading_deg, first_deg), 90.0, "th1")
    _line(axes, elbow, elbow + 100 * _unit(first_deg))
    _angle(axes, elbow, (first_deg, second_deg), 75.0, "th2")
    _line(axes, wrist, wrist + 80 * _unit(second_deg))
    _angle(axes, wrist, (tool_deg, second_deg), 62.0, "th4")
    axes.annotate("", _at(tip), _at(wrist), arrowprops={"arrowstyle": "-|>", "color": "#3b4a5a", "linewidth": 2})
    axes.text(*_at((wrist + tip) / 2 + np.array([4.0, -8.0])), "tool_mm", color=_DIMENSION, va="top")
    for name, direction in (("x", np.array([1.0, 0.0])), ("y", np.array([0.0, 1.0]))):
        axes.annotate("", _at(300 * direction), (0, 0), arrowprops={"arrowstyle": "->", "color": "0.6"})
        axes.text(*_at(310 * direction), name, color="0.4", ha="center", va="center")
    _finish(axes, "from above", (-60, 360), (-110, 400))


def _from_the_side(axes: Axes, *, lift_first: bool) -> None:
    base = 90.0
    arm = base + (80.0 if lift_first else 0.0)
    second = arm + 45.0
    tip, wrist = second - 95.0, _L1 + _L2
    axes.axhline(0.0, color="0.6", linewidth=1, zorder=0)
    axes.text(wrist + _TOOL + 105, 4, "z = 0", color="0.4", ha="right")
    axes.plot([0, 0], [min(0.0, arm - 60.0), arm], color="#9aa5b1", linewidth=12, zorder=1)
    axes.plot([0, _L1, _L1, wrist], [arm, arm, second, second], marker="o", markersize=9, **_LINK)
    axes.plot([wrist, wrist, wrist + _TOOL], [second, tip, tip], color="#3b4a5a", linewidth=3)
    axes.plot([wrist + _TOOL], [tip], marker="v", color="#3b4a5a", markersize=8)
    _between(axes, (0, second + 30), (_L1, second + 30), "l1_mm")
    _between(axes, (_L1, second + 30), (wrist, second + 30), "l2_mm")
    _between(axes, (-30, 0), (-30, base), "base_mm", left=True)
    _between(axes, (_L1 - 20, arm), (_L1 - 20, second), "offset_mm", left=True)
    _between(axes, (wrist + _TOOL + 22, tip), (wrist + _TOOL + 22, second), "drop_mm")
    _between(axes, (wrist, tip - 40), (wrist + _TOOL, tip - 40), "tool_mm")
    if lift_first:
        _moves(axes, (-30, base), (-30, arm), "d1")
    else:
        _moves(axes, (wrist - 26, second - 12), (wrist - 26, tip), "d3")
    where = "lift first" if lift_first else "lift last"
    _finish(axes, f"from the side, stretched, {where}", (-120, wrist + _TOOL + 110), (-140, 290))


def _moves(axes: Axes, start: tuple[float, float], end: tuple[float, float], name: str) -> None:
    """Draw the arrow of a joint that moves along the vertical, from its zero upwards or downwards."""
    axes.annotate(
        "", end, start, arrowprops={"arrowstyle": "-|>", "color": _JOINT, "linewidth": 2, "shrinkA": 0, "shrinkB": 0}
    )
    axes.text(start[0] - 8, (start[1] + end[1]) / 2, name, color=_JOINT, ha="right", va="center")


def _in_space(kind: str) -> Figure:
    """Draw a new robot of a kind with the lengths and joints of its DH table."""
    robot = read_robot(robot_text(kind, kind, *with_settings(kind, {"axes": "XYZC"} if kind == "cartesian" else {})))
    return draw_arm_in_space(robot, tuple(0.6 * joint.lower + 0.4 * joint.upper for joint in robot.joints))


def _of_paper(kind: str) -> Figure:
    """Draw the paper's own robot of a kind, at its home, with its lengths and joints."""
    return draw_arm_in_space(load_robot(kind))


def _hybrid() -> Figure:
    figure = Figure(figsize=(9.2, 5.2), layout="constrained")
    figure.suptitle("hybrid-arm", x=0.01, ha="left", weight="bold")
    axes = figure.subplots()
    frame, low, half, link, out, down = 100.0, 400.0, 150.0, 350.0, 300.0, 120.0
    z2, left, right = 40.0, 30.0, 0.0
    height = low + left + (link**2 - (half + z2) ** 2) ** 0.5
    right = height - low - (link**2 - (half - z2) ** 2) ** 0.5
    platform = np.array([frame + z2, height])
    axes.axhline(0.0, color="0.6", linewidth=1)
    axes.text(700, 8, "z = 0", color="0.4", ha="right")
    axes.plot([0, 0], [0, 820], color="0.6", linestyle="-.", linewidth=1)
    axes.text(-12, 800, "th1, about the waist's axis", color=_JOINT, ha="right")
    for x, z, name in ((frame - half, left, "Z5"), (frame + half, right, "Z6")):
        axes.plot([x, x], [low - 250, low + 250], color="#9aa5b1", linewidth=3)
        axes.plot([x, platform[0]], [low + z, platform[1]], **{**_LINK, "linewidth": 5})
        axes.plot([x], [low + z], marker="s", color=_JOINT, markersize=11, zorder=3)
        axes.annotate("", (x, low + z + 75), (x, low + z), arrowprops={"arrowstyle": "-|>", "color": _JOINT})
        axes.text(x - 24, low + z, name, color=_JOINT, ha="right", va="center")
    guide = GUIDE_PART * link
    axes.plot([frame - half, platform[0]], [low + left + guide, height + guide], **{**_LINK, "linewidth": 3})
    axes.plot([platform[0]] * 2, [height, height + guide], **{**_LINK, "linewidth": 5})
    axes.text(frame - half - 12, low + left + guide + 60, "guide: keeps\nthe platform level", color="0.4", ha="right")
    axes.plot([frame, frame], [low - 120, height + 125], color="0.75", linestyle=":")
    axes.plot([platform[0], platform[0] + out], [height, height], **_LINK)
    axes.plot([platform[0] + out] * 2, [height, height - down], color="#3b4a5a", linewidth=3)
    axes.plot([platform[0] + out], [height - down], marker="v", color="#3b4a5a", markersize=9)
    axes.text(platform[0] + out + 22, height - down, "th4 turns the gripper", color=_JOINT, va="center")
    _between(axes, (-215, 0), (-215, low), "l1_mm", left=True)
    axes.plot([-215, frame + half], [low, low], color="0.8", linewidth=1, zorder=0)
    _between(axes, (0, 95), (frame, 95), "l2_mm")
    _between(axes, (frame, 125), (frame + half, 125), "h_mm")
    axes.text(frame + half + 12, (low + right + height) / 2, "L_mm, both links", color=_DIMENSION)
    _between(axes, (platform[0], height + 45), (platform[0] + out, height + 45), "l3_mm")
    _between(axes, (platform[0] + out - 30, height - down), (platform[0] + out - 30, height), "l4_mm", left=True)
    _between(axes, (frame, height + 125), (platform[0], height + 125), "")
    axes.text(platform[0] + 12, height + 125, "z2, at most z2_max_mm to either side", color=_DIMENSION, va="center")
    _finish(axes, "from the side, with th1 = 0: x to the right, z up", (-300, 720), (-30, 900))
    return figure


def _unit(angle_deg: float) -> FloatArray:
    return np.array([np.cos(np.deg2rad(angle_deg)), np.sin(np.deg2rad(angle_deg))])


def _at(point: FloatArray) -> tuple[float, float]:
    return float(point[0]), float(point[1])


def _line(axes: Axes, start: FloatArray, end: FloatArray) -> None:
    axes.plot(*np.array([start, end]).T, color="0.6", linestyle="--", linewidth=1, zorder=1)


def _angle(
    axes: Axes, centre: FloatArray, span_deg: tuple[float, float], radius: float, name: str, colour: str = _JOINT
) -> None:
    from_deg, to_deg = span_deg
    axes.add_patch(
        Arc(_at(centre), 2 * radius, 2 * radius, theta1=from_deg, theta2=to_deg, color=colour, linewidth=1.5)
    )
    axes.text(*_at(centre + (radius + 8) * _unit((from_deg + to_deg) / 2)), name, color=colour, va="center")


def _beside(axes: Axes, start: FloatArray, end: FloatArray, name: str) -> None:
    """Name a length in its middle, beside it on its left."""
    way = (end - start) / np.linalg.norm(end - start)
    place = (start + end) / 2 + 18 * np.array([-way[1], way[0]])
    axes.text(*_at(place), name, color=_DIMENSION, ha="right" if way[1] > 0.1 else "center", va="bottom")


def _between(
    axes: Axes, start: tuple[float, float], end: tuple[float, float], name: str, *, left: bool = False
) -> None:
    """Draw a dimension's arrow with its name beside it."""
    axes.annotate("", end, start, arrowprops={"arrowstyle": "<->", "color": _DIMENSION, "shrinkA": 0, "shrinkB": 0})
    x, z = (start[0] + end[0]) / 2, (start[1] + end[1]) / 2
    if start[0] == end[0]:
        axes.text(x + (-6 if left else 6), z, name, color=_DIMENSION, ha="right" if left else "left", va="center")
    else:
        axes.text(x, z + 6, name, color=_DIMENSION, ha="center", va="bottom")


def _finish(axes: Axes, title: str, x: tuple[float, float], y: tuple[float, float]) -> None:
    axes.set_title(title, fontsize=9, loc="left")
    axes.set_aspect("equal")
    axes.set_xlim(*x)
    axes.set_ylim(*y)
    axes.axis("off")


_DRAWINGS: Final[dict[str, Callable[[], Figure]]] = {
    "scara": _scara,
    "hybrid-arm": _hybrid,
    **{
        kind: partial(_of_paper, kind)
        for kind in ("teaching-scara", "lab-scara", "calibration-scara", "warehouse-scara")
    },
    **{kind: partial(_in_space, kind) for kind in ("cartesian", "axes", "chain")},
}


def _kind(name: str) -> str:
    kind = kinds()[name]
    joints = " ".join(joint.name for joint in usual_joints(name, usual_dimensions(name)))
    rows = [
        [f"`{key}`", meaning(field), _text(field.metadata["usual"])] for key, field in dimensions(kind.geometry).items()
    ]
    picture = drawing(name).relative_to(DOCS)
    return "\n\n".join(
        [
            f"### `{name}`",
            f"{kind.summary[0].upper()}{kind.summary[1:]}. Joints: `{joints}`.",
            f"![Dimensions and joints of {name}]({picture})",
            table(["key", "meaning", "in a new file"], rows, text_columns=3),
        ]
    )


def _text(value: object) -> str:
    if isinstance(value, bool):
        return "`true`" if value else "`false`"
    if isinstance(value, str):
        return f'`"{value}"`'
    return f"`{value:g}`" if isinstance(value, float) else "a table, see below" if value else "-"


ROBOT_FILES_PAGE: Final = GeneratedPage(
    "robot-files",
    "the kinds' dimensions, and the options in host/twin/machine/machine_options.py and the features",
    {"kinds": lambda _: "\n\n".join(map(_kind, kinds())), "machine_options": lambda _: machine_options()},
)
