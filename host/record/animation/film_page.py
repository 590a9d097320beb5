"""Write an animation as one HTML page that plays in any browser and asks no other host for anything."""

import json
from importlib.resources import files
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from steptwin.host.common.whole_file import whole_file
from steptwin.host.record.animation.camera import CAMERAS, Camera
from steptwin.host.record.animation.film import Film

SPEEDS: Final = (0.01, 0.02, 0.05, 0.1, 0.2, 0.5, 1, 2, 5, 10, 20, 50, 100)
"""Speeds that pages offer, as factors of real time; an animation's own comes beside them."""

_DECIMALS: Final = 3
"""Decimals of a length in mm: a thousandth of what a screen shows."""
_ERROR_DECIMALS: Final = 6
"""Decimals of the path's errors, which the page magnifies."""


def write_page(path: Path, film: Film, camera: Camera) -> None:
    """Write the page; `camera` is where it begins, a user may turn the scene."""
    text = (files(__package__) / "player.html").read_text(encoding="utf-8")
    for name, value in (("CAMERAS", CAMERAS), ("FILM", _document(film, camera))):
        text = text.replace(f"/*{name}*/null", _script(value))
    with whole_file(path) as file:
        file.write(text.encode())


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
            {"name": part.name, "role": part.role, "points": _list(part.points_mm, _DECIMALS)} for part in film.parts
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
