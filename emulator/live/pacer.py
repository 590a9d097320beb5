"""Convert between instants of the wall clock and counts of the board's 72 MHz clock, which may stand for a while."""

from fractions import Fraction
from typing import Final

from steptwin.protocol.timer import COUNTS_PER_SECOND

SPEED_MIN: Final = 0.001
SPEED_MAX: Final = 1000.0
_NS_PER_SECOND: Final = 1_000_000_000
_SPEED_PARTS: Final = 1_000_000


class Pacer:
    """Counts since the boards were switched on at `start_ns`; `speed` simulated seconds pass in a second.

    It computes in integers, so that nothing drifts.

    Raises:
        ValueError: the speed is not from SPEED_MIN to SPEED_MAX.
    """

    def __init__(self, start_ns: int, speed: float = 1.0) -> None:
        if not SPEED_MIN <= speed <= SPEED_MAX:
            raise ValueError(f"speed {speed:g} is not from {SPEED_MIN:g} to {SPEED_MAX:g}")
        rate = Fraction(speed).limit_denominator(_SPEED_PARTS) * Fraction(COUNTS_PER_SECOND, _NS_PER_SECOND)
        self.start_ns = start_ns
        """Instant when the boards are switched on; may be set later until then."""
        self.stood_ns: int = 0
        """Wall time for which the boards' clock has stood since."""
        self.speed = speed
        self._counts, self._per_ns = rate.numerator, rate.denominator

    def stand(self, dt_ns: int) -> None:
        """Leave a duration of the wall clock out: every count begins later by it than it would have.

        An instant before the end of that duration then belongs to an earlier count than before the call.
        """
        self.stood_ns += dt_ns

    def counts_at(self, now_ns: int) -> int:
        """Return the last count that has begun at an instant."""
        return (now_ns - self.start_ns - self.stood_ns) * self._counts // self._per_ns

    def ns_at(self, counts: int) -> int:
        """Return the first nanosecond of a count."""
        return self.start_ns + self.stood_ns - (-counts * self._per_ns // self._counts)
