"""Draw a film's frames, and write them into a GIF or, through ffmpeg, into an MP4.

What stands still is drawn once, the rest into each frame.
"""

import subprocess
from collections.abc import Callable
from itertools import pairwise
from pathlib import Path
from shutil import which
from tempfile import TemporaryFile
from typing import Any, Final

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from PIL import Image

from steptwin.host.common.arrays import FloatArray
from steptwin.host.common.bad_input import prefixed
from steptwin.host.common.errors import InputError
from steptwin.host.common.whole_file import replacement, whole_file
from steptwin.host.record.animation.film import Camera, Film
from steptwin.host.record.plots.canvas import COUNTED, PLANNED, STYLE, plain_texts
from steptwin.host.robots.kinematics import ArmPart, Role

DOTS_PER_INCH: Final = 100
ASPECT: Final = 0.75
"""Height over width of a frame."""

STYLES: Final[dict[Role, dict[str, Any]]] = {
    Role.GUIDE: {"color": "#b9c2cb", "linewidth": 5.0},
    Role.SLIDE: {"color": "#4c86c6", "linewidth": 10.0, "solid_capstyle": "butt"},
    Role.LINK: {"color": "#3b4a5a", "linewidth": 6.0, "marker": "o", "markersize": 8, "markerfacecolor": "white"},
    Role.TOOL: {"color": "#d9822b", "linewidth": 3.0},
    Role.HAND: {"color": "#d9822b", "linewidth": 2.0},
    Role.AXIS: {"color": "#2456a6", "linewidth": 0.9, "linestyle": "-."},
    Role.X: {"color": "#b5432a", "linewidth": 1.8},
    Role.Y: {"color": "#2a7f62", "linewidth": 1.8},
    Role.Z: {"color": "#2456a6", "linewidth": 1.8},
}
_HEAD_PIXELS: Final = 9.0
"""Length of the head of the arrow that shows where the tool points."""
SHADOW: Final = "0.88"
GRID: Final = "0.93"
BOX: Final = "#a08c6c"

_MARGIN: Final = 0.05
_CORNER_PIXELS: Final = np.array([55.0, 85.0])
"""Place of the world's axes in the picture, from its lower left corner."""
_ARROW_PIXELS: Final = 32
_ROW: Final = 0.034
"""Height of a CLK pin's row, in parts of the picture's."""
_FOOT: Final = 0.06
"""Height of the line of text below everything."""
_PULSE: Final = "#2a7f62"

PixelArray = np.ndarray[Any, np.dtype[np.uint8]]


class FilmDrawing:
    """A film seen from a camera. Its frames are arrays of red, green, blue and alpha, of shape (height, width, 4)."""

    def __init__(self, film: Film, camera: Camera, width_pixels: int) -> None:
        self._film, self._camera = film, camera
        self._extent_mm = film.extent_mm()
        self._ground_mm = float(self._extent_mm[:, 2].min())
        size_pixels = [int(pixels) // 2 * 2 for pixels in (width_pixels, width_pixels * ASPECT)]  # as videos need it
        with mpl.rc_context(STYLE):
            figure = Figure(figsize=(size_pixels[0] / DOTS_PER_INCH, size_pixels[1] / DOTS_PER_INCH), dpi=DOTS_PER_INCH)
            self._canvas = _canvas(figure)
            axes = self._empty_axes(figure)
            self._draw_ground(axes)
            self._draw_world_axes(axes)
            axes.plot(*self._seen(film.path.planned_mm)[:, :2].T, color=PLANNED, linewidth=3.5, zorder=1)
            self._boxes = [LineCollection([], color=BOX, linewidth=1.2) for _ in film.boxes]
            self._parts, self._marks = (
                [(part, axes.plot([], [], **STYLES[part.role])[0]) for part in parts]
                for parts in (film.parts, film.marks)
            )
            self._shadow = LineCollection([], color=SHADOW, linewidth=5.0)
            for lines in (self._shadow, *self._boxes):
                axes.add_collection(lines)
            self._counted: Line2D = axes.plot([], [], color=COUNTED, linewidth=1.2)[0]
            self._pulses = LineCollection([], color=_PULSE, linewidth=0.9)
            if film.pulses:
                self._pulse_axes(figure).add_collection(self._pulses)
            self._clock = figure.text(0.015, 0.02, "", family="DejaVu Sans Mono", size=11)
            plain_texts(figure)
            self._mm_per_pixel = float(np.diff(axes.get_xlim())[0]) / axes.bbox.width
        drawn = [line for _, line in (*self._parts, *self._marks)]
        for artist in (self._shadow, *self._boxes, *drawn, self._counted, self._clock, *self._pulse_lines):
            artist.set_animated(True)
        self._canvas.draw()
        self._background = self._canvas.copy_from_bbox(figure.bbox)
        self._counted_seen = self._seen(film.path.counted_mm(film.gain))[:, :2]

    @property
    def frames(self) -> int:
        """The number of frames."""
        return len(self._film.times_s)

    def frame(self, i: int) -> PixelArray:
        """Draw one frame."""
        film = self._film
        self._canvas.restore_region(self._background)
        bodies = (part for part in film.parts if part.role is not Role.HAND)
        self._shadow.set_segments([self._on_ground(part.points_mm[i]) for part in bodies])
        for box, lines in zip(film.boxes, self._boxes, strict=True):
            lines.set_segments(list(self._seen(box.edges_mm + box.shifts_mm[i])[..., :2]))
        for part, line in (*self._parts, *self._marks):
            seen = self._seen(part.points_mm[i])[:, :2]
            line.set_data(*(self._with_head(seen) if part.role is Role.HAND else seen).T)
        self._counted.set_data(*self._counted_seen[: film.path_until[i]].T)
        self._clock.set_text(f"t = {film.times_s[i]:.3f} s")
        far_to_near = sorted(self._parts, key=lambda each: self._nearness(each[0], i))
        drawn = [line for _, line in (*far_to_near, *self._marks)]
        self._pulses.set_segments(self._pulse_segments(film.times_s[i]))
        for artist in (self._shadow, *self._boxes, *drawn, self._counted, self._clock, *self._pulse_lines):
            artist.draw(self._canvas.get_renderer())
        return np.array(self._canvas.buffer_rgba(), np.uint8)

    @property
    def _pulse_lines(self) -> list[LineCollection]:
        return [self._pulses] if self._film.pulses else []

    @property
    def _strip(self) -> float:
        """Height of all CLK pins' rows, in parts of the picture's."""
        return _ROW * len(self._film.pulses)

    def _pulse_segments(self, t_s: float) -> list[FloatArray]:
        """Return each pin's line, the first axis on top, over the milliseconds before an instant."""
        film, top = self._film, len(self._film.pulses) - 1
        lines = [row.levels(t_s - film.pulses_ms / 1000, t_s) for row in film.pulses]
        return [line * (1000.0, 0.6) + (0.0, top - i + 0.2) for i, line in enumerate(lines)]

    def _pulse_axes(self, figure: Figure) -> Axes:
        """Return axes for the CLK pins below the scene."""
        film, rows = self._film, len(self._film.pulses)
        axes = figure.add_axes((0.1, _FOOT, 0.885, self._strip))
        axes.set_axis_off()
        axes.set_xlim(-film.pulses_ms, 0.0)
        axes.set_ylim(0.0, rows)
        for i, row in enumerate(film.pulses):
            axes.text(
                -0.012, (rows - i - 0.5) / rows, row.name, size=8, ha="right", va="center", transform=axes.transAxes
            )
        figure.text(0.985, _FOOT + self._strip, f"CLK, {film.pulses_ms:g} ms", size=8, ha="right", color="0.35")
        return axes

    def _seen(self, points_mm: FloatArray) -> FloatArray:
        return self._camera.seen(points_mm)

    def _nearness(self, part: ArmPart, i: int) -> tuple[bool, float]:
        """Return the order of drawing: guides first, then from far to near."""
        return part.role is not Role.GUIDE, float(self._seen(part.points_mm[i])[:, 2].mean())

    def _with_head(self, seen: FloatArray) -> FloatArray:
        """Return a line of two points, in the picture, with the head of an arrow at its end; none seen end on."""
        way = seen[1] - seen[0]
        length = float(np.hypot(*way))
        if not length > 0.0:
            return seen
        ahead = min(_HEAD_PIXELS * self._mm_per_pixel, length) / length * way
        aside = 0.5 * np.array([-ahead[1], ahead[0]])
        return np.array([seen[0], seen[1], seen[1] - ahead + aside, seen[1], seen[1] - ahead - aside])

    def _on_ground(self, points_mm: FloatArray) -> FloatArray:
        on_ground_mm = points_mm.copy()
        on_ground_mm[:, 2] = self._ground_mm
        return self._seen(on_ground_mm)[:, :2]

    def _empty_axes(self, figure: Figure) -> Axes:
        """Return axes true to scale that hold the scene, under a heading."""
        film = self._film
        speed = "" if film.speed == 1.0 else f", {film.speed:g} x as fast"
        figure.text(0.015, 0.985, film.title, size=12, weight="bold", va="top")
        about = f"path's error magnified {film.gain:g} times" if film.gain > 1.0 else "path's error not magnified"
        figure.text(0.985, 0.02, f"grey: planned, blue: counted, {about}{speed}", size=8, ha="right", color="0.35")
        axes = figure.add_axes((0.0, _FOOT + self._strip, 1.0, 0.88 - self._strip))
        axes.set_axis_off()
        axes.set_aspect("equal")
        seen = np.concatenate([self._seen(self._extent_mm)[:, :2], self._on_ground(self._extent_mm)])
        middle, half = (seen.min(axis=0) + seen.max(axis=0)) / 2, (np.ptp(seen, axis=0) / 2).clip(min=1.0)
        half *= 1 + 2 * _MARGIN
        width, height = axes.bbox.width, axes.bbox.height
        scale = max(half[0] / width, half[1] / height)
        axes.set_xlim(middle[0] - scale * width, middle[0] + scale * width)
        axes.set_ylim(middle[1] - scale * height, middle[1] + scale * height)
        return axes

    def _draw_ground(self, axes: Axes) -> None:
        """Draw a grid on the ground."""
        low, high = self._extent_mm.min(axis=0), self._extent_mm.max(axis=0)
        every_mm = self._film.grid_mm
        first, last = np.floor(low[:2] / every_mm) * every_mm, np.ceil(high[:2] / every_mm) * every_mm
        xs, ys = (np.arange(a, b + every_mm / 2, every_mm) for a, b in zip(first, last, strict=True))
        lines = [[(x, first[1]), (x, last[1])] for x in xs] + [[(first[0], y), (last[0], y)] for y in ys]
        grid_mm = np.array([[(*end, low[2]) for end in line] for line in lines])
        axes.add_collection(LineCollection(list(self._seen(grid_mm)[..., :2]), color=GRID, linewidth=0.8, zorder=0))

    def _draw_world_axes(self, axes: Axes) -> None:
        """Draw the directions of x, y and z into the lower left corner."""
        corner_pixels = _CORNER_PIXELS + np.array([0.0, self._strip * axes.figure.bbox.height])
        for name, way in zip("xyz", np.eye(3), strict=True):
            along = _ARROW_PIXELS * self._seen(way)[:2]
            if np.hypot(*along) < _ARROW_PIXELS / 10:
                continue  # seen along this axis
            ends = [(float(x), float(y)) for x, y in corner_pixels + np.outer((0.0, 1.0, 1.3), along)]
            arrow = {"arrowstyle": "->", "color": "0.55", "shrinkA": 0, "shrinkB": 0}
            axes.annotate("", ends[1], ends[0], "figure pixels", "figure pixels", arrow, annotation_clip=False)
            axes.annotate(name, ends[2], xycoords="figure pixels", ha="center", va="center", color="0.4")


def _canvas(figure: Figure) -> Any:
    """Return the canvas, to which matplotlib gives no types."""
    return FigureCanvasAgg(figure)


Progress = Callable[[float], None]
"""Called with the part of the work that is done, from 0 to 1."""

COLOURS: Final = 64
"""Colours of a GIF: enough for lines with smooth edges, and small files."""

LAST_FRAME_S: Final = 1.0
"""Time for which a GIF shows its last frame before it begins again."""


def write_gif(path: Path, drawing: FilmDrawing, fps: float, progress: Progress) -> None:
    """Write an animation that repeats for ever. All frames have the colours of the last one, which shows everything."""
    palette = _palette(drawing)
    frames = []
    for i in range(drawing.frames):
        frames.append(_image(drawing, i).quantize(palette=palette, dither=Image.Dither.NONE))
        progress((i + 1) / drawing.frames)
    durations_ms = [*gif_durations_ms(len(frames) - 1, fps), int(1e3 * LAST_FRAME_S)]
    with whole_file(path) as file:
        frames[0].save(file, "GIF", save_all=True, append_images=frames[1:], duration=durations_ms, loop=0)


def _palette(drawing: FilmDrawing) -> Image.Image:
    """Return the last frame with a swatch of each style, so that thin lines keep their colours, in COLOURS colours."""
    image = _image(drawing, drawing.frames - 1)
    side = image.width // len(STYLES)
    for i, style in enumerate(STYLES.values()):
        image.paste(style["color"], (i * side, 0, (i + 1) * side, side // 2))
    return image.quantize(COLOURS)


def _image(drawing: FilmDrawing, i: int) -> Image.Image:
    return Image.fromarray(drawing.frame(i)).convert("RGB")


def gif_durations_ms(frames: int, fps: float) -> list[int]:
    """Return the duration of each frame. A GIF counts hundredths of a second: the sum stays within one of the right."""
    instants_cs = [round(100.0 * i / fps) for i in range(frames + 1)]
    return [10 * (later - earlier) for earlier, later in pairwise(instants_cs)]


def check_ffmpeg() -> str:
    """Return the path of ffmpeg; raise InputError if it is not installed."""
    found = which("ffmpeg")
    if found is None:
        raise InputError("ffmpeg, which makes mp4 files, is not installed; .gif and .html need no other program")
    return found


def write_mp4(path: Path, drawing: FilmDrawing, fps: float, progress: Progress) -> None:
    """Write a video with H.264, as every browser plays it; raise InputError if ffmpeg is missing or refuses."""
    ffmpeg, first = check_ffmpeg(), drawing.frame(0)
    height, width, _ = first.shape
    source = ("-f", "rawvideo", "-pix_fmt", "rgba", "-s", f"{width}x{height}", "-r", f"{fps:g}", "-i", "-")
    target = ("-an", "-c:v", "libx264", "-pix_fmt", "yuv420p", "-movflags", "+faststart", "-f", "mp4")
    with prefixed(f"{path}: "), replacement(path) as part:
        _encode((ffmpeg, "-y", "-loglevel", "error", *source, *target, str(part)), drawing, progress)


def _encode(command: tuple[str, ...], drawing: FilmDrawing, progress: Progress) -> None:
    with TemporaryFile() as errors:
        with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.DEVNULL, stderr=errors) as process:
            _feed(process, drawing, progress)
        if process.returncode:
            errors.seek(0)
            lines = errors.read().decode(errors="replace").strip().splitlines() or ["no reason given"]
            raise InputError(f"ffmpeg: {lines[-1]} (exit code {process.returncode})")


def _feed(process: "subprocess.Popen[bytes]", drawing: FilmDrawing, progress: Progress) -> None:
    """Give ffmpeg every frame; one that ends early says why itself."""
    stdin = process.stdin
    if stdin is None:
        return
    try:
        with stdin:
            for i in range(drawing.frames):
                frame: PixelArray = drawing.frame(i)
                stdin.write(frame.tobytes())
                progress((i + 1) / drawing.frames)
    except BrokenPipeError:
        pass
