"""Write the frames of an animation into a GIF, or through ffmpeg into an MP4."""

import subprocess
from collections.abc import Callable
from itertools import pairwise
from pathlib import Path
from shutil import which
from tempfile import TemporaryFile
from typing import Final

from PIL import Image

from steptwin.host.common.bad_input import prefixed
from steptwin.host.common.errors import InputError
from steptwin.host.common.whole_file import replacement, whole_file
from steptwin.host.record.animation.drawing import FilmDrawing, PixelArray

Progress = Callable[[float], None]
"""Called with the part of the work that is done, from 0 to 1."""

COLOURS: Final = 64
"""Colours of a GIF: enough for lines with smooth edges, and small files."""

LAST_FRAME_S: Final = 1.0
"""Time for which a GIF shows its last frame before it begins again."""


def write_gif(path: Path, drawing: FilmDrawing, fps: float, progress: Progress) -> None:
    """Write an animation that repeats for ever. All frames have the colours of the last one, which shows everything."""
    palette = _image(drawing, drawing.frames - 1).quantize(COLOURS)
    frames = []
    for i in range(drawing.frames):
        frames.append(_image(drawing, i).quantize(palette=palette, dither=Image.Dither.NONE))
        progress((i + 1) / drawing.frames)
    durations_ms = [*gif_durations_ms(len(frames) - 1, fps), int(1e3 * LAST_FRAME_S)]
    with whole_file(path) as file:
        frames[0].save(file, "GIF", save_all=True, append_images=frames[1:], duration=durations_ms, loop=0)


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
