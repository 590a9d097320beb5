"""Decide whether two positions are equal apart from rounding."""

from typing import Final

import numpy as np

from steptwin.host.common.arrays import FloatArray

NO_WAY: Final = 1e-6
"""Largest distance in mm or degrees of equal positions.

With 1 000 steps for a mm or degree it is a thousandth of a step, so no motor can show it. The rounding errors of
coordinates and of inverse kinematics are below 1e-9.
"""


def is_no_way(way: FloatArray) -> bool:
    """Return whether a difference of positions, in mm and degrees, is too small for a motion."""
    return bool(np.abs(way).max() <= NO_WAY)
