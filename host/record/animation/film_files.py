"""Write the animation of a stored run into a file of the kind that its name says."""

from collections.abc import Callable
from functools import partial
from importlib.util import find_spec
from pathlib import Path
from typing import Final

from steptwin.host.common.bad_input import unknown
from steptwin.host.common.errors import InputError
from steptwin.host.record.animation.camera import Camera
from steptwin.host.record.animation.film import USUAL_SHOT, Film, Shot, make_film
from steptwin.host.record.animation.film_page import write_page
from steptwin.host.record.folder import StoredRun

WIDTH_PIXELS: Final = 720
WIDTH_PIXELS_MIN, WIDTH_PIXELS_MAX = 240, 3840

Progress = Callable[[float], None]
"""Called with the part of the work that is done, from 0 to 1."""


def check_kind(path: Path) -> None:
    """Raise InputError if no animation has a file's suffix, or if what makes it is not installed."""
    if path.suffix not in _KINDS:
        raise unknown(f"{path.name}: the kind", path.suffix, _KINDS)
    if path.suffix == ".html":
        return
    if not find_spec("matplotlib"):
        raise InputError(f"{path.suffix}: matplotlib is not installed (pip install 'steptwin[plot]'); .html needs none")
    if path.suffix == ".mp4":
        from steptwin.host.record.animation.picture_files import check_ffmpeg

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
    film = make_film(run, shot)
    _KINDS[path.suffix](path, film, camera, width_pixels, progress)
    return film


def _write_page(path: Path, film: Film, camera: Camera, _width_pixels: int, _progress: Progress) -> None:
    write_page(path, film, camera)


def _write_pictures(video: bool, path: Path, film: Film, camera: Camera, width_pixels: int, progress: Progress) -> None:
    from steptwin.host.record.animation.drawing import FilmDrawing
    from steptwin.host.record.animation.picture_files import write_gif, write_mp4

    write = write_mp4 if video else write_gif
    write(path, FilmDrawing(film, camera, width_pixels), film.fps, progress)


_KINDS: Final[dict[str, Callable[[Path, Film, Camera, int, Progress], None]]] = {
    ".gif": partial(_write_pictures, False),
    ".mp4": partial(_write_pictures, True),
    ".html": _write_page,
}
"""What writes each kind of file, by the suffix."""
