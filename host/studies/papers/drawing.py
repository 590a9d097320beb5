"""Draw a paper's pictures: curves, and the pictures of runs and workspaces that other commands draw too."""

from io import BytesIO
from typing import Any, Final

import matplotlib as mpl
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from PIL import Image

from steptwin.host.record.plots import DEFAULT_VIEW, PICTURES
from steptwin.host.record.plots.canvas import COUNTED, LIMIT, STYLE, WIDTH_INCHES
from steptwin.host.record.plots.workspace import draw_workspace, draw_workspace_3d
from steptwin.host.robots import load_robot
from steptwin.host.robots.workspace import monte_carlo, scan
from steptwin.host.studies.papers.evaluation import EvaluatedPaper
from steptwin.host.studies.papers.paper import Curve, Panel, Picture, PictureKind
from steptwin.host.studies.papers.paper_page import picture_name
from steptwin.host.studies.papers.study import Runs

ROW_INCHES: Final = 2.6
TRUE_TO_SCALE_INCHES: Final = 4.2
_DOTS_PER_INCH: Final = 100
_RANDOM: Final = 100_000
"""Random joint positions of a workspace."""

_COLOURS: Final = (COUNTED, LIMIT, "0.55", "#2a7f62", "#b8860b")
"""Colours of the curves in a panel, which has no more curves; the first three differ in greyscale too."""

_STYLES: Final[dict[str, dict[str, Any]]] = {
    "line": {},
    "broken": {"linestyle": "--"},
    "broad": {"linewidth": 4.0, "alpha": 0.5},
}


def draw_pictures(paper: EvaluatedPaper, runs: Runs) -> dict[str, bytes]:
    """Return every picture of the paper as a PNG, by the name of its file."""
    with mpl.rc_context(STYLE):
        return {
            picture_name(paper.paper.robot, picture): small_png(_figure(picture, paper, runs))
            for item in paper.items
            for picture in item.item.pictures
        }


def _figure(picture: Picture, paper: EvaluatedPaper, runs: Runs) -> Figure:
    """Return a picture's figure; its title begins with the robot and the paper's own place, to be found from there."""
    robot, said = paper.paper.robot, picture.caption
    if picture.look and picture.kind is PictureKind.PLOT:
        figure, said = _plot(picture, picture.look(paper.study)), f"{said} (COMPUTED)"
    elif picture.look:
        figure = picture.look(paper.study)
    else:
        figure = _run(robot, picture, runs) if picture.job else _workspace(robot, picture)
        said = figure.get_suptitle().removeprefix(f"{robot} · ")
    figure.suptitle(f"{robot} · {picture.place}: {said}", x=0.01, ha="left", weight="bold")
    return figure


def _run(robot: str, picture: Picture, runs: Runs) -> Figure:
    outcome = runs.outcome(robot, picture.job)
    figure = PICTURES[picture.view](outcome.comparison, outcome.report.run, DEFAULT_VIEW)
    figure.align_ylabels()
    return figure


def _workspace(name: str, picture: Picture) -> Figure:
    robot = load_robot(name)
    cloud = monte_carlo(robot, _RANDOM, 1)
    return draw_workspace_3d(robot, cloud) if picture.view == "cloud" else draw_workspace(robot, cloud, scan(robot))


def _plot(picture: Picture, panels: tuple[Panel, ...]) -> Figure:
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
