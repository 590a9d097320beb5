"""Draw a paper's pictures: curves, and the pictures of runs and workspaces that other commands draw too."""

from collections.abc import Sequence
from io import BytesIO
from typing import Any, Final

import matplotlib as mpl
import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from PIL import Image

from steptwin.host.common.arrays import FloatArray
from steptwin.host.record.plots import DEFAULT_VIEW, PICTURES
from steptwin.host.record.plots.canvas import COUNTED, LIMIT, STYLE, WIDTH_INCHES
from steptwin.host.record.plots.workspace import draw_workspace, draw_workspace_3d
from steptwin.host.robots import load_robot
from steptwin.host.robots.kinematics import make_kinematics
from steptwin.host.robots.kinematics.base import link_frames, tool_frames
from steptwin.host.robots.kinematics.dh import Convention
from steptwin.host.robots.robot import Robot
from steptwin.host.robots.workspace import monte_carlo, scan
from steptwin.host.studies.papers.evaluation import EvaluatedPaper
from steptwin.host.studies.papers.paper import Curve, Listing, Panel, Picture, Plot, RunPicture, Sketch
from steptwin.host.studies.papers.paper_page import picture_name
from steptwin.host.studies.papers.runs import Runs

COLUMNS = ("row", "n", "o", "a", "p mm")
"""The columns of a transform: the tool's axes and its position."""


def matrix_rows(names: Sequence[str], matrices: Sequence[FloatArray]) -> list[list[str]]:
    """Return a row of texts for each row of each 4 by 4 matrix but the last one, which is always 0 0 0 1."""
    return [
        [f"{name}, {axis}", *(f"{element:z.6f}" for element in row[:3]), f"{row[3]:z.3f}"]
        for name, matrix in zip(names, matrices, strict=True)
        for axis, row in zip("xyz", matrix[:3].tolist(), strict=True)
    ]


def link_rows(robot: Robot, joints: Sequence[float]) -> list[list[str]]:
    """Return the rows of every link's transform at a joint position, T1, T2 ..., and of their product."""
    kinematics, position = make_kinematics(robot), np.array([joints])
    links = [link[0] for link in link_frames(kinematics, position)]
    names = [f"T{i}" for i in range(1, len(links) + 1)]
    return matrix_rows([*names, f"0T{len(links)}"], [*links, tool_frames(kinematics, position)[0]])


_DH_COLUMNS: Final = {
    Convention.MODIFIED: ("i", "alpha_i-1 deg", "a_i-1 mm", "d_i mm", "theta_i deg"),
    Convention.STANDARD: ("i", "theta_i deg", "d_i mm", "a_i mm", "alpha_i deg"),
}
"""The columns of a DH table, in the usual order of each convention."""


def dh_listing(robot_name: str, title: str) -> Listing[Any]:
    """Return the DH table of a robot as the kinematics has it, in the columns of its convention."""
    dh = make_kinematics(load_robot(robot_name)).dh
    rows = []
    for i, row in enumerate(dh.rows, start=1):
        cells = [f"{row.alpha_deg:g}", f"{row.a_mm:g}", str(row.d_mm), str(row.theta_deg)]
        rows.append([str(i), *(cells if dh.convention is Convention.MODIFIED else reversed(cells))])
    return Listing(f"{title}, {dh.convention.value} convention", _DH_COLUMNS[dh.convention], lambda _: rows)


ROW_INCHES: Final = 2.6
TRUE_TO_SCALE_INCHES: Final = 4.2
_DOTS_PER_INCH: Final = 100

_COLOURS: Final = (COUNTED, LIMIT, "0.55", "#2a7f62", "#b8860b")
"""Colours of the curves in a panel, which has no more curves; the first three differ in greyscale too."""

_STYLES: Final[dict[str, dict[str, Any]]] = {
    "line": {},
    "broken": {"linestyle": "--"},
    "broad": {"linewidth": 4.0, "alpha": 0.5},
    "points": {"linestyle": "none", "marker": "o", "markersize": 3.5},
}


def draw_pictures(paper: EvaluatedPaper, runs: Runs) -> dict[str, bytes]:
    """Return every picture of the paper as a PNG, by the name of its file."""
    with mpl.rc_context(STYLE):
        return {
            picture_name(paper.paper.robot, picture): small_png(_figure(picture, paper, runs))
            for item in paper.items
            for picture in item.item.pictures
        }


def _figure(picture: "Picture[Any]", paper: EvaluatedPaper, runs: Runs) -> Figure:
    """Return a picture's figure; its title begins with the robot and the paper's own place, to be found from there."""
    robot = paper.paper.robot
    if isinstance(picture, Plot):
        figure = _plot(picture, picture.panels(paper.study))
        said = f"{picture.caption} (COMPUTED)"
    elif isinstance(picture, Sketch):
        figure, said = picture.draw(paper.study), picture.caption
    elif isinstance(picture, RunPicture):
        outcome = runs.outcome(robot, picture.job)
        figure = PICTURES[picture.kind](outcome.comparison, outcome.report.run, DEFAULT_VIEW)
        figure.align_ylabels()
        said = figure.get_suptitle().removeprefix(f"{robot} · ")
    else:
        loaded = load_robot(robot)
        cloud = monte_carlo(loaded, 100_000, 1)
        figure = draw_workspace_3d(loaded, cloud) if picture.in_space else draw_workspace(loaded, cloud, scan(loaded))
        said = figure.get_suptitle().removeprefix(f"{robot} · ")
    figure.suptitle(f"{robot} · {picture.place}: {said}", x=0.01, ha="left", weight="bold")
    return figure


def _plot(picture: "Plot[Any]", panels: tuple[Panel, ...]) -> Figure:
    columns = min(picture.columns, len(panels))
    rows = -(-len(panels) // columns)
    scaled = any(panel.true_to_scale for panel in panels)
    height_inches = rows * (TRUE_TO_SCALE_INCHES if scaled else ROW_INCHES) + 0.5
    figure = Figure(figsize=(WIDTH_INCHES, height_inches), layout="constrained")
    grid = figure.subplots(rows, columns, squeeze=False)
    named: dict[str, Artist] = {}
    for axes, panel in zip(grid.flat, panels, strict=False):
        _draw(axes, panel)
        if len(panel.curves) > 1:
            named |= {str(line.get_label()): line for line in axes.get_lines()}
    if named:  # below the panels, where no curve is
        figure.legend(list(named.values()), list(named), loc="outside lower left", ncols=4)
    for axes in list(grid.flat)[len(panels) :]:
        axes.set_axis_off()
    figure.align_ylabels()
    return figure


def _draw(axes: Axes, panel: Panel) -> None:
    for curve, colour in zip(panel.curves, _COLOURS[: len(panel.curves)], strict=True):
        _draw_curve(axes, curve, colour)
    axes.set_title(panel.title, loc="left")
    axes.set(xlabel=panel.x_label, ylabel=panel.y_label)
    if panel.true_to_scale:
        axes.set_aspect("equal", adjustable="datalim")


def _draw_curve(axes: Axes, curve: Curve, colour: str) -> None:
    axes.plot(curve.x, curve.y, color=colour, label=curve.name, **_STYLES[curve.style])


def small_png(figure: Figure) -> bytes:
    """Return a PNG with a palette, a third of matplotlib's size; the octree method keeps colours of few pixels."""
    drawn, reduced = BytesIO(), BytesIO()
    figure.savefig(drawn, format="png", dpi=_DOTS_PER_INCH)
    pixels = Image.open(drawn).convert("RGB")
    pixels = pixels.quantize(method=Image.Quantize.FASTOCTREE, dither=Image.Dither.NONE)
    pixels.save(reduced, format="PNG", optimize=True)
    return reduced.getvalue()
