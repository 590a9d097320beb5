"""Edges of a pin as arrays: sorted instants in counts, and the level after each edge."""

from dataclasses import dataclass
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

Int64Array = NDArray[np.int64]
Int8Array = NDArray[np.int8]
FloatArray = NDArray[np.float64]
Scalar = TypeVar("Scalar", bound=np.generic)

NO_COUNTS = np.empty(0, dtype=np.int64)
NO_LEVELS = np.empty(0, dtype=np.int8)


def levels_at(times: Int64Array, edges: Int64Array, levels: Int8Array, before: int) -> Int8Array:
    """Return a pin's level at each of the sorted times; an edge at exactly that time has already happened."""
    if not edges.size:
        return np.full(times.size, before, dtype=np.int8)
    firsts = np.searchsorted(times, edges, side="left")
    lengths = np.diff(firsts, prepend=0, append=times.size)
    return np.repeat(np.concatenate((np.array([before], dtype=np.int8), levels)), lengths)


@dataclass(frozen=True, slots=True)
class Delay:
    """Delays of a component in counts, for rising and falling levels at its output."""

    to_high: int = 0
    to_low: int = 0

    @property
    def longest(self) -> int:
        """The longer delay."""
        return max(self.to_high, self.to_low)

    def of(self, level: int) -> int:
        """Return the delay of a change to a level."""
        return self.to_high if level else self.to_low

    def passed(self, edges: Int64Array, levels: Int8Array) -> tuple[Int64Array, Int8Array]:
        """Return the edges at the output for alternating edges at the input.

        A level that is not longer than the difference of the delays is lost, because its second edge overtakes its
        first.
        """
        arrivals = edges + np.where(levels == 1, self.to_high, self.to_low)
        overtaken = np.diff(arrivals) <= 0
        kept = np.ones(edges.size, dtype=np.bool_)
        kept[:-1] &= ~overtaken
        kept[1:] &= ~overtaken
        return arrivals[kept], levels[kept]


def merged(counts: Int64Array) -> Int64Array:
    """Return the instants sorted, each once.

    The input consists of a few sorted parts, which a stable sort merges quickly. numpy's `unique` hashes integers and
    takes 300 times as long for a million of them.
    """
    ordered = np.sort(counts, kind="stable")
    first = np.diff(ordered, prepend=ordered[:1] - 1) != 0
    once: Int64Array = ordered[first]
    return once


def joined(parts: list[NDArray[Scalar]], dtype: type[Scalar]) -> NDArray[Scalar]:
    """Concatenate the parts; return an empty array if there are none."""
    return np.concatenate(parts) if parts else np.empty(0, dtype=dtype)
