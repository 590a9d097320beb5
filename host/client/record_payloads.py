"""Encode an axis' PVT records as the bytes of RPDO4, all at once: one by one this took a tenth of a stream's time."""

from typing import Final

import numpy as np

from steptwin.host.common.axis_records import AxisRecords
from steptwin.protocol.pvt import I24_MAX, I24_MIN, SEQUENCE_MODULUS

_I24_MASK = (1 << 24) - 1
_PAYLOAD: Final = "V8"
"""numpy's type for eight bytes that mean nothing to it."""


def payloads(records: AxisRecords, first: int) -> list[bytes]:
    """Return the bytes of each record, as `PvtRecord.encode` makes them; they are numbered from `first` on.

    Raises:
        OverflowError: a value exceeds its field.
    """
    displacements, velocities = (_within(values, I24_MIN, I24_MAX) & _I24_MASK for values in records[:2])
    durations = _within(records.durations_ms, 0, 255)
    sequences = np.arange(first, first + len(durations)) % SEQUENCE_MODULUS
    words = displacements | velocities << 24 | durations << 48 | sequences << 56
    data: list[bytes] = words.astype("<i8").view(_PAYLOAD).tolist()
    return data


def _within(values: list[int], low: int, high: int) -> np.ndarray[tuple[int], np.dtype[np.int64]]:
    array = np.array(values, np.int64)
    wrong = array[(array < low) | (array > high)]
    if wrong.size:
        raise OverflowError(f"a PVT record has no room for {wrong[0]}: its field holds {low} to {high}")
    return array
