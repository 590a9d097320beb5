"""Normalise angles in degrees."""

import numpy as np

from steptwin.host.common.arrays import FloatArray


def wrapped_deg(angle_deg: FloatArray) -> FloatArray:
    """Return the same angles in (-180, 180]; an angle that is already there does not change by a bit."""
    inside = (angle_deg > -180.0) & (angle_deg <= 180.0)
    return np.where(inside, angle_deg, 180.0 - (180.0 - angle_deg) % 360.0)
