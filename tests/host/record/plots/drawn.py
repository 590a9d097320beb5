"""Read the points of a line in a picture: matplotlib types them as anything."""

from typing import Any

import numpy as np

from steptwin.host.common.arrays import FloatArray


def drawn_points(line: Any) -> FloatArray:
    """Return the points of a line, of shape (n, 2), or (n, 3) in space."""
    if hasattr(line, "get_data_3d"):
        return np.column_stack(line.get_data_3d())
    return np.asarray(line.get_xydata(), dtype=np.float64)
