"""How late things were: a histogram of bounded size, whatever the number of things."""

from typing import Final

_SUBDIVISION_BITS: Final = 4
"""16 classes to each doubling: a figure read from the histogram is at most 1/16 too large."""
_CLASSES: Final = 1 << _SUBDIVISION_BITS


class Lateness:
    """Durations in nanoseconds; what is early counts as 0."""

    def __init__(self) -> None:
        self.count = 0
        self.max_ns = 0
        self._counts: dict[int, int] = {}

    def add(self, late_ns: int) -> None:
        """Take in one more."""
        late_ns = max(late_ns, 0)
        self.count += 1
        self.max_ns = max(self.max_ns, late_ns)
        number = _class_of(late_ns)
        self._counts[number] = self._counts.get(number, 0) + 1

    def percentile_ns(self, percent: float) -> int:
        """What so many percent of all do not exceed, to the upper end of its class; 0 without any."""
        seen = 0
        for number in sorted(self._counts):
            seen += self._counts[number]
            if 100 * seen >= percent * self.count:
                return min(_upper_end_ns(number), self.max_ns)
        return self.max_ns


def _class_of(late_ns: int) -> int:
    """Below 32 ns each has a class of its own; above, they go by the first five bits."""
    shift = max(late_ns.bit_length() - _SUBDIVISION_BITS - 1, 0)
    return shift * _CLASSES + (late_ns >> shift)


def _upper_end_ns(number: int) -> int:
    shift = max(number // _CLASSES - 1, 0)
    return (number - shift * _CLASSES + 1 << shift) - 1
