"""Intervals of integers: what a width promises, what arithmetic makes of it, and which C type holds it."""

from dataclasses import dataclass
from typing import Final

_STORAGE: Final = (("uint8_t", 0, 8, 1), ("uint16_t", 0, 16, 2), ("int32_t", 32, 31, 4), ("int64_t", 64, 63, 8))
"""C type, its bits if signed, the bits of its largest value, its size. Unsigned only where it is promoted to int."""


@dataclass(frozen=True, slots=True)
class Range:
    """All integers from `low` to `high`, both included."""

    low: int
    high: int

    def union(self, other: "Range") -> "Range":
        """Return the smallest range that contains both."""
        return Range(min(self.low, other.low), max(self.high, other.high))

    def within(self, other: "Range") -> bool:
        """Return whether all of it is in another range."""
        return other.low <= self.low and self.high <= other.high

    @property
    def bits(self) -> int:
        """Width of the C integer for arithmetic, 32 or 64; raise OverflowError if there is none."""
        for bits in (32, 64):
            if self.within(Range(-(1 << bits - 1), (1 << bits - 1) - 1)):
                return bits
        raise OverflowError(f"from {self.low} to {self.high} does not fit 64 bits")

    @property
    def storage(self) -> tuple[str, int]:
        """The smallest C type that holds it, and its size in bytes."""
        for name, signed_bits, high_bits, size in _STORAGE:
            low = -(1 << signed_bits - 1) if signed_bits else 0
            if self.within(Range(low, (1 << high_bits) - 1)):
                return name, size
        raise OverflowError(f"from {self.low} to {self.high} does not fit 64 bits")


def promised(width: str) -> Range:
    """Return what a name of `controller.motion.widths` promises: U<n>, I<n> or Q<n>; raise ValueError for others."""
    kind, bits = width[:1], width[1:]
    if kind not in {"U", "I", "Q"} or not bits.isdigit():
        raise ValueError(f"{width} is no width: U<n>, I<n> or Q<n>")
    n = int(bits)
    return {
        "U": Range(0, (1 << n) - 1),
        "I": Range(-(1 << n >> 1), (1 << n >> 1) - 1),
        "Q": Range(-(1 << n), 1 << n),
    }[kind]


def corners(left: Range, right: Range) -> Range:
    """Return the range of the products."""
    products = [x * y for x in (left.low, left.high) for y in (right.low, right.high)]
    return Range(min(products), max(products))
