"""Make the README's moving picture: the warehouse robot pulls a drawer, and the CLK pins of its drivers.

The arm stands where the drivers' counts put it, with the tool's planned path and the counted one, its error magnified.
"""

from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, Final

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.collections import LineCollection, PolyCollection
from matplotlib.figure import Figure
from PIL import Image
from scipy.spatial import ConvexHull

from docs.generate.commands import DOCS
from docs.generate.runs import Runs
from steptwin.host.common.arrays import FloatArray
from steptwin.host.record.folder import StoredRun, read_run
from steptwin.host.record.path_error import heading, path_error
from steptwin.host.record.plots.canvas import COUNTED, PLANNED, STYLE
from steptwin.host.record.recorded_machine import RecordedMachine
from steptwin.host.robots.kinematics import Role
from steptwin.host.robots.kinematics.marks import Skeleton
from steptwin.protocol.timer import COUNTS_PER_SECOND

FILM: Final = DOCS / "pictures" / "drawer-pull.gif"
_FRAME_MS, _LAST_MS, _SPEED, _COLOURS = 80, 1000, 2.0, 64
_SCENE, _PINS = (0.0, 0.264, 1.0, 0.676), (0.1, 0.06, 0.885, 0.204)
_PINS_MS = 40.0
STYLES: Final[dict[Role, dict[str, Any]]] = {
    Role.GUIDE: {"color": "#b9c2cb", "linewidth": 5.0, "zorder": 2},
    Role.SLIDE: {"color": "#4c86c6", "linewidth": 10.0, "solid_capstyle": "butt", "zorder": 3.5},
    Role.LINK: {"color": "#3b4a5a", "linewidth": 6.0, "marker": "o", "markersize": 8, "markerfacecolor": "white"},
    Role.TOOL: {"color": "#d9822b", "linewidth": 3.0},
    Role.HAND: {"color": "#d9822b", "linewidth": 2.0},
    Role.AXIS: {"color": "#2456a6", "linewidth": 0.9, "linestyle": "-."},
}
_SHADOW, _GRID, _BOX, _DRAWER, _PULSE = "0.88", "0.93", "#a08c6c", "#e3c078", "#2a7f62"
_DRAWER_WORDS = "#8a6414"
_RIGHT = np.array([3**0.5, 1.0, 0.0]) / 2
_UP = np.array([-1.0, 3**0.5, 2 * 3**0.5]) / 4
"""Directions of the picture in the world, seen from azimuth -60 and elevation 30 degrees."""


def write_drawer_pull_film(runs: Runs) -> None:
    """Write the GIF; all frames have the colours of the last one, which shows everything."""
    with TemporaryDirectory() as folder:
        runs.outcome("warehouse-scara", "drawer-pull").save(folder)
        run = read_run(Path(folder))
    with mpl.rc_context(STYLE):
        frames = _frames(run)
    palette = frames[-1].copy()
    for i, style in enumerate(STYLES.values()):  # so that thin lines keep their colours
        palette.paste(style["color"], (100 * i, 0, 100 * i + 100, 50))
    palette = palette.quantize(_COLOURS)
    drawn = [frame.quantize(palette=palette, dither=Image.Dither.NONE) for frame in frames]
    lasts_ms = [_FRAME_MS] * (len(drawn) - 1) + [_LAST_MS]
    drawn[0].save(FILM, "GIF", save_all=True, append_images=drawn[1:], duration=lasts_ms, loop=0)


def seen(points_mm: FloatArray) -> FloatArray:
    """Return where points are in the picture, without perspective, so that it is true to scale."""
    return np.stack([points_mm @ _RIGHT, points_mm @ _UP], axis=-1)


def _frames(run: StoredRun) -> list[Image.Image]:
    machine = RecordedMachine.of(run)
    t_s = np.append(np.arange(0.0, run.duration_s, _SPEED * _FRAME_MS / 1000), run.duration_s)
    path_s = np.linspace(0.0, run.duration_s, 3001)
    path = path_error(run.comparison, path_s)
    parts = (*machine.links(t_s), *Skeleton(run.robot).axes(machine.counted_joints(t_s)))
    bodies = [part for part in parts if part.role not in (Role.GUIDE, Role.AXIS)]
    shifts_mm = machine.box_shifts_mm(t_s)
    boxes = {name: run.robot.boxes[name].edges_mm for name in shifts_mm}
    corners = [(edges + shifts_mm[name].min(axis=0)).reshape(-1, 3) for name, edges in boxes.items()]
    shown_mm = np.concatenate([*(part.points_mm.reshape(-1, 3) for part in bodies), *corners, path.planned_mm])
    floor_mm = float(shown_mm[:, 2].min())

    figure = Figure(figsize=(6.4, 4.8), dpi=100)
    canvas: Any = FigureCanvasAgg(figure)
    axes = _scene(figure, shown_mm, floor_mm)
    axes.plot(*seen(path.planned_mm).T, color=PLANNED, linewidth=3.5, zorder=1)
    shadow = LineCollection([], color=_SHADOW, linewidth=5.0, zorder=1)
    crates = {name: LineCollection([], color=_BOX, linewidth=1.2) for name in boxes}
    pulled = max(boxes, key=lambda name: float(np.ptp(shifts_mm[name], axis=0).max()))
    drawer = PolyCollection([], facecolor=_DRAWER, edgecolor=_BOX, linewidth=1.2, zorder=1.5)
    label = figure.text(0.985, 0.935, "", size=11, weight="bold", color=_DRAWER_WORDS, ha="right", va="top")
    for each in (shadow, drawer, *crates.values()):
        axes.add_collection(each)
    lines = [axes.plot([], [], **{"zorder": 3, **STYLES[part.role]})[0] for part in parts]
    (counted,) = axes.plot([], [], color=COUNTED, linewidth=1.2, zorder=4)
    pins = _pins(figure, [axis.name for axis in run.comparison.evidence.axes])
    clock = figure.text(0.015, 0.02, "", family="DejaVu Sans Mono", size=11)
    figure.text(0.015, 0.985, heading(run.report.run), size=12, weight="bold", va="top")
    words = f"grey: planned, blue: counted, path's error magnified {path.gain:g} times, {_SPEED:g} x as fast"
    figure.text(0.985, 0.02, words, size=8, ha="right", color="0.35")
    trace = seen(path.counted_mm(path.gain))

    frames = []
    for i, now_s in enumerate(t_s.tolist()):
        shadow.set_segments([seen(part.points_mm[i] * (1.0, 1.0, 0.0) + (0.0, 0.0, floor_mm)) for part in bodies])
        for name, crate in crates.items():
            crate.set_segments(list(seen(boxes[name] + shifts_mm[name][i])))
        here = seen((boxes[pulled] + shifts_mm[pulled][i]).reshape(-1, 3))
        drawer.set_verts([here[ConvexHull(here).vertices]])
        opened_mm = float(np.linalg.norm(shifts_mm[pulled][i]))
        label.set_text(f"{pulled}: {opened_mm:3.0f} mm open")
        for part, line in zip(parts, lines, strict=True):
            line.set_data(*seen(part.points_mm[i]).T)
        counted.set_data(*trace[: 2 * np.searchsorted(path_s, now_s, side="right")].T)
        pins.set_segments(_pulses(run, now_s))
        clock.set_text(f"t = {now_s:.3f} s")
        canvas.draw()
        frames.append(Image.fromarray(np.array(canvas.buffer_rgba(), np.uint8)).convert("RGB"))
    return frames


def _scene(figure: Figure, shown_mm: FloatArray, floor_mm: float) -> Axes:
    """Return axes true to scale that hold the points, with a grid of 100 mm on the floor."""
    axes = figure.add_axes(_SCENE)
    axes.set_axis_off()
    ends = np.concatenate([seen(shown_mm), seen(shown_mm * (1.0, 1.0, 0.0) + (0.0, 0.0, floor_mm))])
    middle, half = (ends.min(axis=0) + ends.max(axis=0)) / 2, 1.1 * np.ptp(ends, axis=0) / 2
    half = np.array(axes.bbox.size) * (half / axes.bbox.size).max()
    axes.set(xlim=middle[0] + np.array([-1.0, 1.0]) * half[0], ylim=middle[1] + np.array([-1.0, 1.0]) * half[1])
    (x0, y0), (x1, y1) = 100 * (shown_mm[:, :2].min(axis=0) // 100), -100 * (-shown_mm[:, :2].max(axis=0) // 100)
    grid = [[(x, y0, floor_mm), (x, y1, floor_mm)] for x in np.arange(x0, x1 + 1.0, 100.0)]
    grid += [[(x0, y, floor_mm), (x1, y, floor_mm)] for y in np.arange(y0, y1 + 1.0, 100.0)]
    axes.add_collection(LineCollection(list(seen(np.array(grid))), color=_GRID, linewidth=0.8, zorder=0))
    return axes


def _pins(figure: Figure, names: list[str]) -> LineCollection:
    """Return the lines of the CLK pins, a row for each axis below the scene."""
    axes = figure.add_axes(_PINS, xlim=(-_PINS_MS, 0.0), ylim=(0.0, len(names)))
    axes.set_axis_off()
    for row, name in enumerate(reversed(names)):
        axes.text(-_PINS_MS - 0.1, row + 0.5, name, size=8, ha="right", va="center")
    figure.text(0.985, _PINS[1] + _PINS[3], f"CLK, {_PINS_MS:g} ms", size=8, ha="right", color="0.35")
    axes.add_collection(lines := LineCollection([], color=_PULSE, linewidth=0.9))
    return lines


def _pulses(run: StoredRun, now_s: float) -> list[FloatArray]:
    """Return each pin's line over the milliseconds before an instant, the first axis on top."""
    evidence, lines = run.comparison.evidence, []
    now_counts = evidence.start_counts + now_s * COUNTS_PER_SECOND
    for row, axis in enumerate(reversed(evidence.axes)):
        edges = np.column_stack([axis.clk_rise_counts[: axis.clk_fall_counts.size], axis.clk_fall_counts])
        edges_ms = (edges - now_counts) * 1000 / COUNTS_PER_SECOND
        edges_ms = edges_ms[(edges_ms[:, 1] > -_PINS_MS) & (edges_ms[:, 0] < 0.0)]
        x = np.concatenate([[-_PINS_MS], np.repeat(edges_ms, 2, axis=1).ravel(), [0.0]])
        y = np.concatenate([[0.0], np.tile([0.0, 1.0, 1.0, 0.0], len(edges_ms)), [0.0]])
        lines.append(np.column_stack([x.clip(-_PINS_MS, 0.0), row + 0.2 + 0.6 * y]))
    return lines
