"""Rigid transforms as the frames of robot files, place and roll, pitch and yaw, and back without a loss."""

from collections.abc import Iterable
from typing import Final

import numpy as np

from steptwin.host.common.arrays import FloatArray
from steptwin.host.robots.kinematics.serial.rows import FixedFrame

_UPRIGHT: Final = 1e-14
"""Cosine of the pitch below which roll and yaw are one turn: from there on it is rounding only."""
_DECIMALS: Final = 12
"""Decimals of a frame's numbers: beyond them there is the dust of products only."""


def frame_of(transform: FloatArray) -> FixedFrame:
    """Return a transform of shape (4, 4) as a frame; the matrix of the frame is the transform, even near pitch 90.

    Roll and pitch are taken of what remains after the turn back by the yaw, so that they fit any rounding of it.
    """
    turn = transform[:3, :3]
    upright = np.hypot(turn[0, 0], turn[1, 0]) < _UPRIGHT
    yaw = 0.0 if upright else float(np.arctan2(turn[1, 0], turn[0, 0]))
    c, s = np.cos(yaw), np.sin(yaw)
    rest = np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]]) @ turn
    pitch, roll = np.arctan2(-rest[2, 0], rest[0, 0]), np.arctan2(-rest[1, 2], rest[1, 1])
    return FixedFrame(triple(transform[:3, 3].tolist()), triple(np.rad2deg([roll, pitch, yaw]).tolist()))


def triple(values: Iterable[float]) -> tuple[float, float, float]:
    """Return three numbers without the dust of their products."""
    x, y, z = (round(value, _DECIMALS) + 0.0 for value in values)
    return x, y, z
