"""Array types of the host's computations."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray


class AxisRecords(NamedTuple):
    """PVT records of one axis as lists of equal length, without their sequence numbers."""

    displacements_units: list[int]
    end_velocities: list[int]
    durations_ms: list[int]


BoolArray = NDArray[np.bool_]
FloatArray = NDArray[np.float64]
Int8Array = NDArray[np.int8]
Int16Array = NDArray[np.int16]
Int32Array = NDArray[np.int32]
Int64Array = NDArray[np.int64]
