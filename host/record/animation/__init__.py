"""Animate a stored run: the arm, the planned path and the counted one with its error magnified.

An animation is a file of the kind that its name says. An HTML page plays in any browser and asks no other host for
anything.
"""

import json
from collections.abc import Callable
from functools import partial
from importlib.resources import files
from importlib.util import find_spec
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from steptwin.host.common.bad_input import unknown
from steptwin.host.common.errors import InputError
from steptwin.host.common.extras import installing
from steptwin.host.common.whole_file import write_whole
from steptwin.host.record.animation.film import (
    CAMERAS,
    USUAL_SHOT,
    Camera,
    Film,
    Shot,
    extent_mm,
    make_film,
    shown_boxes,
)
from steptwin.host.record.folder import StoredRun

__all__ = [
    "CAMERAS",
    "USUAL_SHOT",
    "Camera",
    "Film",
    "Shot",
    "check_kind",
    "extent_mm",
    "make_film",
    "shown_boxes",
    "write_animation",
]
SPEEDS: Final = (0.01, 0.02, 0.05, 0.1, 0.2, 0.5, 1, 2, 5, 10, 20, 50, 100)
"""Speeds that pages offer, as factors of real time; an animation's own comes beside them."""

_DECIMALS: Final = 3
"""Decimals of a length in mm: a thousandth of what a screen shows."""
_ERROR_DECIMALS: Final = 6
"""Decimals of the path's errors, which the page magnifies."""
WIDTH_PIXELS: Final = 720
WIDTH_PIXELS_MIN, WIDTH_PIXELS_MAX = 240, 3840

Progress = Callable[[float], None]
"""Called with the part of the work that is done, from 0 to 1."""


def write_page(path: Path, film: Film, camera: Camera, *_of_pictures: object) -> None:
    """Write the page; `camera` is where it begins, a user may turn the scene."""
    text = (files(__package__) / "player.html").read_text(encoding="utf-8")
    for name, value in (("CAMERAS", CAMERAS), ("FILM", _document(film, camera))):
        text = text.replace(f"/*{name}*/null", _script(value))
    write_whole(path, text)


def _document(film: Film, camera: Camera) -> dict[str, Any]:
    extent_mm = film.extent_mm()
    return {
        "title": film.title,
        "camera": (camera.azimuth_deg, camera.elevation_deg),
        "fps": film.fps,
        "speed": film.speed,
        "speeds": sorted({*SPEEDS, film.speed}),
        "times": _list(film.times_s, _ERROR_DECIMALS),
        "parts": [
            {"name": part.name, "role": part.role, "points": _list(part.points_mm, _DECIMALS)}
            for part in (*film.parts, *film.marks)
        ],
        "boxes": [
            {"name": box.name, "edges": _list(box.edges_mm, _DECIMALS), "shifts": _list(box.shifts_mm, _DECIMALS)}
            for box in film.boxes
        ],
        "planned": _list(film.path.planned_mm[1::2], _DECIMALS),
        "errors": _list(film.path.errors_mm[1::2], _ERROR_DECIMALS),
        "until": (film.path_until // 2).tolist(),
        "gain": film.gain,
        "bounds": _list(np.array([extent_mm.min(axis=0), extent_mm.max(axis=0)]), _DECIMALS),
        "grid_mm": film.grid_mm,
    }


def _list(values: NDArray[Any], decimals: int) -> list[Any]:
    rounded: list[Any] = (values.round(decimals) + 0.0).tolist()  # without -0.0
    return rounded


def _script(value: object) -> str:
    """Return JSON that cannot end the page's script, whatever names are in it."""
    return json.dumps(value, separators=(",", ":")).replace("<", "\\u003c").replace(">", "\\u003e")


def check_kind(path: Path) -> None:
    """Raise InputError if no animation has a file's suffix, or if what makes it is not installed."""
    if path.suffix not in _KINDS:
        raise unknown(f"{path.name}: the kind", path.suffix, _KINDS)
    if path.suffix == ".html":
        return
    if not find_spec("matplotlib"):
        raise InputError(f"{path.suffix}: matplotlib is not installed ({installing('plot')}); .html needs none")
    if path.suffix == ".mp4":
        from steptwin.host.record.animation.drawing import check_ffmpeg

        check_ffmpeg()


def write_animation(
    path: Path,
    run: StoredRun,
    camera: Camera,
    shot: Shot = USUAL_SHOT,
    width_pixels: int = WIDTH_PIXELS,
    progress: Progress = lambda _: None,
) -> Film:
    """Write an animation as .gif, .mp4 or .html, and return what it shows.

    Args:
        path: the file.
        run: the stored run.
        camera: the direction from which it is seen; in a page only at first.
        shot: frames, speed, part of the motion, magnification of the path's error.
        width_pixels: width of the pictures; a page fills its window.
        progress: called during the work.

    Raises:
        InputError: another suffix, a missing library or program, or a shot or width that make no animation.
    """
    check_kind(path)
    if not WIDTH_PIXELS_MIN <= width_pixels <= WIDTH_PIXELS_MAX:
        raise InputError(f"width={width_pixels} is outside {WIDTH_PIXELS_MIN}..{WIDTH_PIXELS_MAX} pixels")
    if shot.pulses_ms is not None and path.suffix == ".html":
        raise InputError(f"pulses_ms={shot.pulses_ms:g}: a page shows no pins, a .gif or .mp4 does")
    film = make_film(run, shot)
    _KINDS[path.suffix](path, film, camera, width_pixels, progress)
    return film


def _write_pictures(video: bool, path: Path, film: Film, camera: Camera, width_pixels: int, progress: Progress) -> None:
    from steptwin.host.record.animation.drawing import FilmDrawing, write_gif, write_mp4

    write = write_mp4 if video else write_gif
    write(path, FilmDrawing(film, camera, width_pixels), film.fps, progress)


_KINDS: Final[dict[str, Callable[[Path, Film, Camera, int, Progress], None]]] = {
    ".gif": partial(_write_pictures, False),
    ".mp4": partial(_write_pictures, True),
    ".html": write_page,
}
"""Functions that write each kind of file, by its suffix."""
