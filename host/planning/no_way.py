"""Tell where there is no way to go: both ends are one place, but for rounding."""

from typing import Final

import numpy as np

from steptwin.host.common.arrays import FloatArray

NO_WAY: Final = 1e-6
"""Distance in mm or degrees up to which two places are one.

A joint with 1 000 steps for a mm or degree makes a thousandth of a step of it, so no motor can show it. The rounding
errors of coordinates and of inverse kinematics are below 1e-9.
"""


def is_no_way(way: FloatArray) -> bool:
    """Return whether a difference of positions, in mm and degrees, is nothing to move by."""
    return bool(np.abs(way).max() <= NO_WAY)
