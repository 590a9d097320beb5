"""What a waveform shows: named signals that change at instants, read in stretches so that memory stays small."""

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from enum import Enum
from itertools import pairwise
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from steptwin.host.record.waveforms.timebase import TimeScale, Window
from steptwin.host.verify.evidence import Int64Array

Values = NDArray[Any]

NO_COUNTS = np.empty(0, np.int64)

CHANGES_PER_STRETCH = 1 << 16
"""How many changes of one signal are held as text at once."""


class SignalKind(Enum):
    """What a signal's values are."""

    WIRE = "wire"
    """0 or 1."""
    REAL = "real"
    """Numbers."""
    TEXT = "text"
    """Indices of the signal's texts."""


class Changes(Protocol):
    """A signal's course: its changes in order of time."""

    def at(self, counts: int) -> int | float:
        """The value at an instant; a change at the very instant is seen already."""
        ...

    def between(self, after: int, until: int) -> tuple[Int64Array, Values]:
        """Instants of the changes in (after, until] and the value after each; at one instant the last one counts."""
        ...

    def marks(self, every: int) -> Int64Array:
        """Instants between which there are at most so many changes."""
        ...


@dataclass(frozen=True, slots=True)
class HeldValues:
    """Values that hold from an instant on; fulfils Changes.

    Attributes:
        counts: shape (n,), sorted.
        values: shape (n,), the value from each instant on.
        before: the value before all of them.
    """

    counts: Int64Array
    values: Values
    before: int | float = 0

    def at(self, counts: int) -> int | float:
        """As Changes has it."""
        return self._after(int(np.searchsorted(self.counts, counts, side="right")))

    def between(self, after: int, until: int) -> tuple[Int64Array, Values]:
        """As Changes has it; a value that does not differ from the one before is no change."""
        first, last = np.searchsorted(self.counts, (after, until), side="right").tolist()
        counts, values = self.counts[first:last], self.values[first:last]
        final = np.append(counts[1:] != counts[:-1], True) if counts.size else np.empty(0, np.bool_)
        counts, values = counts[final], values[final]
        changed = values != np.concatenate([[self._after(first)], values[:-1]])[: values.size]
        return counts[changed], values[changed]

    def marks(self, every: int) -> Int64Array:
        """As Changes has it."""
        return self.counts[every::every]

    def _after(self, changes: int) -> int | float:
        """The value after so many changes."""
        value: int | float = self.values[changes - 1].item() if changes else self.before
        return value


@dataclass(frozen=True, slots=True)
class Pulses:
    """A pin that rises and falls in turn, low at first; fulfils Changes. Both arrays have shape (pulses,)."""

    rise_counts: Int64Array
    fall_counts: Int64Array

    def at(self, counts: int) -> int:
        """As Changes has it."""
        begun, ended = (np.searchsorted(edges, counts, side="right") for edges in (self.rise_counts, self.fall_counts))
        return int(begun - ended)

    def between(self, after: int, until: int) -> tuple[Int64Array, Values]:
        """As Changes has it."""
        first = int(np.searchsorted(self.fall_counts, after, side="right"))
        last = int(np.searchsorted(self.rise_counts, until, side="right"))
        counts = np.column_stack([self.rise_counts[first:last], self.fall_counts[first:last]]).ravel()
        levels = np.tile(np.array([1, 0], np.int8), last - first)
        inside = (counts > after) & (counts <= until)
        return counts[inside], levels[inside]

    def marks(self, every: int) -> Int64Array:
        """As Changes has it."""
        return self.rise_counts[every // 2 :: every // 2]


@dataclass(frozen=True, slots=True)
class Signal:
    """One line of a waveform.

    Attributes:
        axis: whose it is, a joint's name.
        what: of the axis it shows.
        kind: of its values.
        changes: its course.
        texts: what the values of a text mean.
    """

    axis: str
    what: str
    kind: SignalKind
    changes: Changes
    texts: tuple[str, ...] = ()

    @property
    def name(self) -> str:
        """As in files: letters, digits and underscores only."""
        return f"{self.scope}_{self.what}"

    @property
    def scope(self) -> str:
        """The axis' name as in files."""
        return re.sub(r"[^A-Za-z0-9_]", "_", self.axis)


def stretches(signals: Sequence[Signal], window: Window, scale: TimeScale) -> Iterator[tuple[int, int]]:
    """The window in pieces (after, until], in each of which a signal changes at most so often; no unit is divided."""
    marks = [signal.changes.marks(CHANGES_PER_STRETCH) for signal in signals]
    ends = {scale.last_counts(unit) for unit in scale.rounded(np.concatenate([NO_COUNTS, *marks])).tolist()}
    inside = sorted(end for end in ends if window.from_counts < end < window.to_counts)
    yield from pairwise([window.from_counts, *inside, window.to_counts])
