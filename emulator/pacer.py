"""The wall clock as the board's clock: which count of 72 MHz it is at an instant, and the other way round."""

from fractions import Fraction
from typing import Final

from steptwin.protocol.timer import COUNTS_PER_SECOND

SPEED_MIN: Final = 0.001
SPEED_MAX: Final = 1000.0
_NS_PER_SECOND: Final = 1_000_000_000
_SPEED_PARTS: Final = 1_000_000


class Pacer:
    """Counts since the board was switched on at `start_ns`; `speed` simulated seconds go by in a second.

    All in integers, so that nothing drifts.

    Raises:
        ValueError: a speed that is not from SPEED_MIN to SPEED_MAX.
    """

    def __init__(self, start_ns: int, speed: float = 1.0) -> None:
        if not SPEED_MIN <= speed <= SPEED_MAX:
            raise ValueError(f"speed {speed:g} is not from {SPEED_MIN:g} to {SPEED_MAX:g}")
        rate = Fraction(speed).limit_denominator(_SPEED_PARTS) * Fraction(COUNTS_PER_SECOND, _NS_PER_SECOND)
        self.start_ns = start_ns
        """When the boards are switched on; may be put off until then."""
        self.speed = speed
        self._counts, self._per_ns = rate.numerator, rate.denominator

    def counts_at(self, now_ns: int) -> int:
        """The last count that has begun."""
        return (now_ns - self.start_ns) * self._counts // self._per_ns

    def ns_at(self, counts: int) -> int:
        """The first nanosecond of a count."""
        return self.start_ns - (-counts * self._per_ns // self._counts)
