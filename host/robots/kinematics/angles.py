"""Normalise angles in degrees."""

import numpy as np

from steptwin.host.common.arrays import FloatArray


def wrapped_deg(angle_deg: FloatArray) -> FloatArray:
    """Return the same angles in (-180, 180]; an angle that is already there does not change by a bit, NaN stays NaN.

    The others become 180 - (180 - angle) % 360. NaN, of poses out of reach, is left out: its remainder takes longest.
    """
    outside = (angle_deg <= -180.0) | (angle_deg > 180.0)
    wrapped = np.array(angle_deg)
    wrapped[outside] = 180.0 - (180.0 - wrapped[outside]) % 360.0
    return wrapped
