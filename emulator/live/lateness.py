"""Measure lateness in a histogram whose size is bounded, whatever the number of events."""

from typing import Final

_SUBDIVISION_BITS: Final = 4
"""16 classes for each doubling: a figure read from the histogram is at most 1/16 too large."""
_CLASSES: Final = 1 << _SUBDIVISION_BITS


class Lateness:
    """Histogram of lateness in nanoseconds; an early event counts as 0."""

    def __init__(self) -> None:
        self.count: int = 0
        self.max_ns: int = 0
        self._counts: dict[int, int] = {}

    def add(self, late_ns: int) -> None:
        """Add the lateness of one event."""
        late_ns = max(late_ns, 0)
        self.count += 1
        self.max_ns = max(self.max_ns, late_ns)
        number = _class_of(late_ns)
        self._counts[number] = self._counts.get(number, 0) + 1

    def percentile_ns(self, percent: float) -> int:
        """Return a bound that this part of all events does not exceed, the upper end of a class; 0 without events."""
        seen = 0
        for number in sorted(self._counts):
            seen += self._counts[number]
            if 100 * seen >= percent * self.count:
                return min(_upper_end_ns(number), self.max_ns)
        return self.max_ns


def _class_of(late_ns: int) -> int:
    """Return the class of a lateness: one for each nanosecond below 32 ns, above that one for each first five bits."""
    shift = max(late_ns.bit_length() - _SUBDIVISION_BITS - 1, 0)
    return shift * _CLASSES + (late_ns >> shift)


def _upper_end_ns(number: int) -> int:
    shift = max(number // _CLASSES - 1, 0)
    return (number - shift * _CLASSES + 1 << shift) - 1
