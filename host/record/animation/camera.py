"""The direction from which a scene is seen. Pictures are drawn without perspective, so that they are true to scale."""

from dataclasses import dataclass
from reprlib import repr as short
from typing import Final, Self

import numpy as np

from steptwin.host.common import numbers
from steptwin.host.common.arrays import FloatArray
from steptwin.host.common.bad_input import nearest_within, outside, prefixed
from steptwin.host.common.errors import InputError

ELEVATION_MAX_DEG: Final = 90.0


@dataclass(frozen=True, slots=True)
class Camera:
    """The direction from the scene to the camera.

    Attributes:
        azimuth_deg: about the vertical, from the x axis.
        elevation_deg: above the horizontal; 90 looks down.

    Raises:
        InputError: an elevation beyond 90 degrees.
    """

    azimuth_deg: float
    elevation_deg: float

    def __post_init__(self) -> None:
        if not -ELEVATION_MAX_DEG <= self.elevation_deg <= ELEVATION_MAX_DEG:
            limits = (-ELEVATION_MAX_DEG, ELEVATION_MAX_DEG, "deg")
            raise InputError(
                f"elevation {outside(self.elevation_deg, *limits)}{nearest_within(self.elevation_deg, *limits)}"
            )

    @classmethod
    def named(cls, text: str) -> Self:
        """Return a camera by its name, or by two numbers `AZIMUTH,ELEVATION`; raise InputError for another text."""
        if text in CAMERAS:
            return cls(*CAMERAS[text])
        angles = text.split(",")
        if len(angles) != 2:
            names = ", ".join(CAMERAS)
            raise InputError(f"camera={short(text)}: is none of {names}, nor AZIMUTH,ELEVATION in degrees")
        with prefixed(f"camera={text}: "):
            return cls(*map(numbers.finite_number, angles))

    @property
    def basis(self) -> FloatArray:
        """Unit vectors to the right, upwards and towards the camera, the rows of a matrix of shape (3, 3)."""
        azimuth_rad, elevation_rad = np.deg2rad(self.azimuth_deg), np.deg2rad(self.elevation_deg)
        c, s, ce, se = np.cos(azimuth_rad), np.sin(azimuth_rad), np.cos(elevation_rad), np.sin(elevation_rad)
        return np.array([[-s, c, 0.0], [-se * c, -se * s, ce], [ce * c, ce * s, se]])

    def seen(self, points_mm: FloatArray) -> FloatArray:
        """Return places in the picture, to the right and upwards in mm, and the depth towards the camera.

        Points and result have the shape (..., 3).
        """
        return np.asarray(points_mm @ self.basis.T)


CAMERAS: Final = {"iso": (-60.0, 30.0), "top": (-90.0, 90.0), "front": (-90.0, 0.0), "side": (0.0, 0.0)}
"""Azimuth and elevation of the cameras with names; the front is seen along the y axis, the side against the x axis."""
