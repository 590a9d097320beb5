"""The edges of a chip's pins, as far as they are kept."""

from collections import deque
from typing import Final

import numpy as np

from steptwin.host.common.arrays import Int64Array

EDGES_MAX: Final = 1 << 20
"""Edges of all pins that are kept at least; older ones are dropped, so that memory stays bounded."""


class PinLog:
    """Keeps the newest edges of all pins."""

    def __init__(self, edges_max: int | None = EDGES_MAX) -> None:
        """Keep so many edges at least; None: all."""
        self._edges_max = edges_max
        self._parts: deque[tuple[Int64Array, Int64Array]] = deque()
        self._count = 0

    def add(self, counts: Int64Array, changes: Int64Array) -> None:
        """Append edges: instants, and 2 * pin + level."""
        if not counts.size:
            return
        self._parts.append((counts, changes))
        self._count += counts.size
        while self._edges_max is not None and self._count - self._parts[0][0].size >= self._edges_max:
            self._count -= self._parts.popleft()[0].size

    def of(self, pin: int) -> tuple[Int64Array, Int64Array]:
        """Return the instants in counts of a pin's edges, and its levels from each on."""
        none = np.empty(0, np.int64)
        counts = np.concatenate([none, *(counts[changes >> 1 == pin] for counts, changes in self._parts)])
        levels = np.concatenate([none, *(changes[changes >> 1 == pin] & 1 for _, changes in self._parts)])
        return counts, levels
