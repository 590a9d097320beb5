"""Animate a stored run: the arm, the planned path and the counted one with its error magnified."""

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
from steptwin.host.record.animation.film_files import check_kind, write_animation

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
