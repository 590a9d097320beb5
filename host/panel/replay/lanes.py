"""The pins and phase currents around an instant: only what a window holds, since a run has millions of edges."""

from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from steptwin.host.common.arrays import Int64Array
from steptwin.host.record.waveforms import Signal

POINTS_MAX: Final = 400
"""Largest number of changes of one signal that a window shows one by one: more would merge into a band."""


@dataclass(frozen=True, slots=True)
class Span:
    """A part of a record, in counts since power-up; both ends belong to it."""

    from_counts: int
    to_counts: int


@dataclass(frozen=True, slots=True, eq=False)
class Lane:
    """One signal in a window.

    Attributes:
        axis: name of the axis.
        quantity: name of the pin, or of a current.
        counts: shape (n,), the window's beginning, then the instants of the changes.
        values: shape (n,), the value from each of them on.
        changes: how many changes there are in the window; if there are too many, only the first value is shown.
    """

    axis: str
    quantity: str
    counts: Int64Array
    values: NDArray[Any]
    changes: int

    @property
    def crowded(self) -> bool:
        """True if the changes are too many to be shown."""
        return self.changes >= self.counts.size


def lane(signal: Signal, span: Span) -> Lane:
    """Return a signal's part in a window."""
    counts, values = signal.changes.between(span.from_counts, span.to_counts)
    shown = slice(0, counts.size if counts.size <= POINTS_MAX else 0)
    return Lane(
        signal.axis,
        signal.quantity,
        np.concatenate([[span.from_counts], counts[shown]]),
        np.concatenate([[signal.changes.at(span.from_counts)], values[shown]]),
        int(counts.size),
    )
