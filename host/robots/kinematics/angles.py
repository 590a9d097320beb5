"""Angles in degrees."""

import numpy as np

from steptwin.host.common.arrays import FloatArray


def wrapped_deg(angle_deg: FloatArray) -> FloatArray:
    """The same angles in (-180, 180]; those already there are returned to the last bit."""
    inside = (angle_deg > -180.0) & (angle_deg <= 180.0)
    return np.where(inside, angle_deg, 180.0 - (180.0 - angle_deg) % 360.0)
