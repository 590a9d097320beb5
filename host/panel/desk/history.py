"""The last minutes of every joint, for plots and for files."""

from dataclasses import dataclass
from threading import Lock
from typing import Final

import numpy as np

from steptwin.host.common.arrays import FloatArray

HISTORY_SAMPLES: Final = 12_000
"""Samples that are kept: five minutes at 40 a second."""


@dataclass(frozen=True, slots=True, eq=False)
class Samples:
    """Samples in order of time.

    Attributes:
        t_s: shape (n,), on the clock of `time.monotonic`.
        positions: shape (n, joints), in mm and degrees.
        rates: shape (n, joints), in mm/s and deg/s; NaN where the board did not report it.
        following_errors: shape (n, joints), in mm and degrees; NaN where the board did not report it.
    """

    t_s: FloatArray
    positions: FloatArray
    rates: FloatArray
    following_errors: FloatArray


class History:
    """A ring of samples; may be used from any thread."""

    def __init__(self, joints: int, samples_max: int = HISTORY_SAMPLES) -> None:
        self._t_s = np.empty(samples_max)
        self._columns = np.empty((samples_max, 3, joints))
        """Of each sample: positions, rates, following errors."""
        self._count = 0
        self._lock = Lock()

    def add(self, t_s: float, positions: FloatArray, rates: FloatArray, following_errors: FloatArray) -> None:
        """Add a sample, later than all others; arrays are of shape (joints,)."""
        with self._lock:
            place = self._count % self._t_s.size
            self._t_s[place] = t_s
            self._columns[place] = positions, rates, following_errors
            self._count += 1

    def since(self, t_s: float = float("-inf")) -> Samples:
        """Return the samples after a time, all by default; the arrays are the caller's own."""
        with self._lock:
            size = self._t_s.size
            order = np.arange(max(0, self._count - size), self._count) % size
            first = int(np.searchsorted(self._t_s[order], t_s, side="right"))
            kept = order[first:]
            times, columns = self._t_s[kept], self._columns[kept]
        return Samples(times, columns[:, 0], columns[:, 1], columns[:, 2])
