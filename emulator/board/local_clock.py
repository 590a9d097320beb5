"""Convert between the simulation's time and a board's own, whose crystal is some parts per million off.

A crystal that is fast by p ppm makes 10^6 + p counts while the simulation makes 10^6. All is done with whole counts:
`local_counts` is rounded down, and `instants` are the first when the board has counted so far.
"""

from typing import Final

from steptwin.emulator.board.edges import Int64Array

PPM: Final = 1_000_000
CRYSTAL_PPM_MAX: Final = 1000
"""Far beyond any crystal, and far below what breaks CAN: bit timing tolerates some 5000 ppm (ISO 11898-1)."""


class LocalClock:
    """A board's 72 MHz counter, and the instant when the board is."""

    def __init__(self, ppm: int) -> None:
        """Begin at 0 with the simulation; `ppm` is positive for a crystal that is fast."""
        self._rate = PPM + ppm
        self.now_counts: int = 0
        """Instant of the simulation that the board has come to."""
        self._now_local_counts = 0
        """What the board has counted then: `local_counts` of it, or one less if the board has stopped before."""

    def local_counts(self, counts: int) -> int:
        """Return what the board has counted at an instant of the simulation."""
        return counts * self._rate // PPM

    def instant(self, local_counts: int) -> int:
        """Return the first instant of the simulation when the board has counted so far."""
        return -(-local_counts * PPM // self._rate)

    def instants(self, local_counts: Int64Array) -> Int64Array:
        """Return `instant` of each element, without overflow."""
        whole, rest = local_counts // self._rate, local_counts % self._rate
        first: Int64Array = whole * PPM - (-rest * PPM // self._rate)
        return first

    def enter(self, counts: int) -> int:
        """Return the board's own time at an instant when something happens to it; time never goes back."""
        if counts > self.now_counts:
            self.go_to(counts, self.local_counts(counts))
        return self._now_local_counts

    def go_to(self, counts: int, local_counts: int) -> None:
        """Let time pass up to an instant, and a count of the board."""
        self.now_counts, self._now_local_counts = counts, local_counts
