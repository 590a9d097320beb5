"""Let a switch's contact bounce: after each change it falls back a number of times, at instants drawn from a seed.

The firmware reads its inputs at the start of each servo tick, so it sees a bounce only if one of these falls into it.
"""

from bisect import bisect_right
from random import Random

from steptwin.controller.kernel import TICK_COUNTS
from steptwin.protocol.timer import COUNTS_PER_US


class Bouncer:
    """The bouncing contact of one switch; it is asked at the start of ticks."""

    def __init__(self, bounces: int, within_us: int, seed: int, *, closed: bool) -> None:
        self._bounces = bounces
        self._within_counts = within_us * COUNTS_PER_US
        self._random = Random(seed)
        self._closed = closed
        self._turns: list[int] = []
        """Instants at which the contact turns over after its last change, in order."""

    def inverted(self, tick: int, *, closed: bool) -> bool:
        """Return whether the input shows the opposite at a tick, at which the position has the switch closed or not."""
        now_counts = tick * TICK_COUNTS
        if closed != self._closed:
            self._closed = closed
            turns = self._random.sample(range(1, self._within_counts), 2 * self._bounces)
            self._turns = sorted(now_counts + turn for turn in turns)
        return bisect_right(self._turns, now_counts) % 2 == 1

    def next_tick(self, tick: int) -> int | None:
        """Return the next tick, after one, at which the input may show something else; None if it has come to rest."""
        if not self._turns or self._turns[-1] <= tick * TICK_COUNTS:
            return None
        turn = self._turns[bisect_right(self._turns, tick * TICK_COUNTS)]
        return -(-turn // TICK_COUNTS)
