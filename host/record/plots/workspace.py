"""Draw a workspace from above, from the side and in space: the cloud of random joint positions, boundary and arm."""

from dataclasses import replace
from pathlib import Path
from typing import Final

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from steptwin.host.common.arrays import FloatArray
from steptwin.host.record.plots.canvas import COUNTED, STYLE, WIDTH_INCHES, save_figure, write_inside
from steptwin.host.record.plots.in_space import draw_cloud_in_space
from steptwin.host.record.plots.stick_figure import AT_ENDS, Pen, draw_arm, plane_of
from steptwin.host.robots.kinematics import make_kinematics
from steptwin.host.robots.robot import Robot
from steptwin.host.robots.workspace import MonteCarlo, Scan, orientation_words

CLOUD: Final = "0.6"
"""Colour of samples: grey small dots, behind the boundary in print."""

BOUNDARY: Final = COUNTED
"""Colour of the boundary: dark dots, as close as a line."""

_WIDE: Final = 2.0
"""Aspect ratio of the view from above beyond which the side view is below it instead of beside it."""

_HOME: Final = "arm at home"
_HEADING_INCHES: Final = 0.9
_PANEL_INCHES: Final = 4.6
_DRAWN_INCHES: Final = 9.0
_LABELS_INCHES: Final = 0.7


def write_workspace(path: Path, robot: Robot, cloud: MonteCarlo, scanned: Scan) -> None:
    """Draw both views into a PNG file."""
    with mpl.rc_context(STYLE):
        save_figure(draw_workspace(robot, cloud, scanned), path, {})


def write_workspace_3d(path: Path, robot: Robot, cloud: MonteCarlo) -> None:
    """Draw the cloud in space into a PNG file."""
    with mpl.rc_context(STYLE):
        save_figure(draw_workspace_3d(robot, cloud), path, {})


def draw_workspace(robot: Robot, cloud: MonteCarlo, scanned: Scan) -> Figure:
    """Return a figure with both views, true to scale, with the arm at home."""
    radius_mm = np.hypot(*(cloud.cloud_mm[:, :2] - np.array(scanned.axis_mm)).T)
    views = (cloud.cloud_mm[:, :2], np.column_stack([radius_mm, cloud.cloud_mm[:, 2]]))
    boundaries = (scanned.plan.boundary_mm, scanned.profile.boundary_mm)
    aspects = [_aspect(np.vstack(points)) for points in zip(views, boundaries, strict=True)]
    figure, (above, beside) = _panels(aspects)
    figure.suptitle(f"{robot.name} · workspace (COMPUTED)", x=0.01, ha="left", weight="bold")
    for axes, view, boundary in zip((above, beside), views, boundaries, strict=True):
        _draw(axes, view, boundary)
    above.set(xlabel="x [mm]", ylabel="y [mm]")
    above.set_title(f"from above; boundary at z = {scanned.plan.z_mm:.6g} mm", loc="left")
    beside.set(xlabel="radius about the arm's axis at home [mm]", ylabel="z [mm]")
    beside.set_title(
        f"from the side; boundary at azimuth {round(scanned.profile.azimuth_deg, 3) + 0.0:.4g} deg", loc="left"
    )
    _draw_home(above, beside, robot, scanned)
    labels = [
        f"positions of random joints, {len(cloud.cloud_mm)} of {cloud.counted}",
        f"scanned boundary{_held(robot, scanned)}",
    ]
    home = next(line for line in above.get_lines() if line.get_label() == _HOME)
    handles = [*above.get_lines()[:2], home]
    figure.legend(handles, [*labels, _HOME], loc="outside lower left", ncols=3, markerscale=2)
    return figure


def draw_workspace_3d(robot: Robot, cloud: MonteCarlo) -> Figure:
    """Return a figure of the cloud and the arm at home in space, with equal scales along x, y and z."""
    figure = draw_cloud_in_space(robot, cloud.cloud_mm, CLOUD)
    figure.suptitle(f"{robot.name} · workspace in space (COMPUTED)", x=0.01, ha="left", weight="bold")
    shown = f"positions of random joints, {len(cloud.cloud_mm)} of {cloud.counted}, and the {_HOME}"
    figure.text(0.99, 0.01, shown, ha="right", va="bottom")
    return figure


def _draw_home(above: Axes, beside: Axes, robot: Robot, scanned: Scan) -> None:
    """Draw the arm at home, from above, and in the plane of the profile: its other side is at negative radii."""
    links = make_kinematics(robot).links(np.array([robot.home]))
    draw_arm(above, links, [0], plane_of(0, 1), Pen(AT_ENDS), _HOME)
    azimuth_rad = np.deg2rad(scanned.profile.azimuth_deg)
    upright = np.array([[np.cos(azimuth_rad), 0.0], [np.sin(azimuth_rad), 0.0], [0.0, 1.0]])
    axis_mm = np.array([*scanned.axis_mm, 0.0])
    draw_arm(beside, [replace(link, points_mm=link.points_mm - axis_mm) for link in links], [0], upright, Pen(AT_ENDS))
    for axes in (above, beside):
        axes.autoscale_view()


def _aspect(points_mm: FloatArray) -> float:
    """Return height over width, at most 1, and 1 without points."""
    width_mm, height_mm = np.ptp(points_mm, axis=0) if len(points_mm) else (1.0, 1.0)
    return float(height_mm / width_mm) if width_mm > height_mm else 1.0


def _panels(aspects: list[float]) -> tuple[Figure, list[Axes]]:
    """Return a figure with two panels: stacked if the first one is wide, else side by side."""
    stacked = aspects[0] * _WIDE < 1.0
    heights_inches = [_DRAWN_INCHES * aspect + _LABELS_INCHES for aspect in aspects] if stacked else [_PANEL_INCHES]
    figure = Figure(figsize=(WIDTH_INCHES, sum(heights_inches) + _HEADING_INCHES), layout="constrained")
    grid = figure.subplots(len(heights_inches), 1 if stacked else 2, squeeze=False, height_ratios=heights_inches)
    return figure, list(grid.flat)


def _draw(axes: Axes, positions_mm: FloatArray, boundary_mm: FloatArray) -> None:
    axes.plot(*positions_mm.T, "o", markeredgewidth=0, markersize=1.1, color=CLOUD)
    axes.plot(*boundary_mm.T, "o", markeredgewidth=0, markersize=2.4, color=BOUNDARY)
    axes.set_aspect("equal")
    if not len(boundary_mm):
        write_inside(axes, "nothing within reach")


def _held(robot: Robot, scanned: Scan) -> str:
    """Return the end of a label: the tool's orientation in the sections and the positions of the slides."""
    words = orientation_words(robot, scanned.attitude_deg)
    orientation = "" if words.startswith("any") else f", {words}"
    return orientation + "".join(f", {name} = {position_mm:g} mm" for name, position_mm in scanned.slides.items())
