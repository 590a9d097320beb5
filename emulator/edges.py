"""Edges of a pin as arrays: instants in counts, sorted, and the level after each of them."""

from dataclasses import dataclass
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

"""The board's timer, 72 MHz, in which all instants are counted."""
NS_PER_MS = 1_000_000
COUNTS_PER_MS = 72_000

Int64Array = NDArray[np.int64]
Int8Array = NDArray[np.int8]
FloatArray = NDArray[np.float64]
Scalar = TypeVar("Scalar", bound=np.generic)

NO_COUNTS = np.empty(0, dtype=np.int64)
NO_LEVELS = np.empty(0, dtype=np.int8)


def counts_of_ns(duration_ns: int) -> int:
    """Counts that last at least as long."""
    return -(-duration_ns * COUNTS_PER_MS // NS_PER_MS)


def levels_at(times: Int64Array, edges: Int64Array, levels: Int8Array, before: int) -> Int8Array:
    """A pin's level at each of the sorted times; an edge at the very time is already seen."""
    firsts = np.searchsorted(times, edges, side="left")
    lengths = np.diff(firsts, prepend=0, append=times.size)
    return np.repeat(np.concatenate((np.array([before], dtype=np.int8), levels)), lengths)


@dataclass(frozen=True, slots=True)
class Delay:
    """How long a level takes through a part, in counts: to high and to low at its output."""

    to_high: int = 0
    to_low: int = 0

    @property
    def longest(self) -> int:
        """Either way."""
        return max(self.to_high, self.to_low)

    def of(self, level: int) -> int:
        """How long a change to a level takes."""
        return self.to_high if level else self.to_low

    def passed(self, edges: Int64Array, levels: Int8Array) -> tuple[Int64Array, Int8Array]:
        """The edges at the output of alternating edges at the input.

        A level that lasts no longer than the slow edge is later than the quick one does not get through at all.
        """
        arrivals = edges + np.where(levels == 1, self.to_high, self.to_low)
        overtaken = np.diff(arrivals) <= 0
        kept = np.ones(edges.size, dtype=np.bool_)
        kept[:-1] &= ~overtaken
        kept[1:] &= ~overtaken
        return arrivals[kept], levels[kept]


def merged(counts: Int64Array) -> Int64Array:
    """Sorted, each instant once.

    What comes is a few sorted parts, which a stable sort merges; numpy's `unique` hashes integers and takes 300 times
    as long for a million of them.
    """
    ordered = np.sort(counts, kind="stable")
    first = np.diff(ordered, prepend=ordered[:1] - 1) != 0
    once: Int64Array = ordered[first]
    return once


def joined(parts: list[NDArray[Scalar]], dtype: type[Scalar]) -> NDArray[Scalar]:
    """One array of many, empty of none."""
    return np.concatenate(parts) if parts else np.empty(0, dtype=dtype)
