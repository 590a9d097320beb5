"""Convert between the simulation's time and the time of a board with a crystal error.

A crystal with an error of p ppm makes 10^6 + p counts while the simulation makes 10^6. All counts are integers:
`local_counts` is rounded down, and `instants` returns the first instant with a given local count.
"""

from typing import Final

from steptwin.emulator.board.edges import Int64Array

PPM: Final = 1_000_000
CRYSTAL_PPM_MAX: Final = 1000
"""Highest crystal error: far above that of real crystals, far below the 5000 ppm that CAN tolerates (ISO 11898-1)."""


class LocalClock:
    """A board's 72 MHz counter, and the board's present instant."""

    def __init__(self, ppm: int) -> None:
        """Begin at 0 together with the simulation; `ppm` is positive for a fast crystal."""
        self._rate = PPM + ppm
        self.now_counts: int = 0
        """Instant of the simulation that the board has reached."""
        self._now_local_counts = 0
        """Board's count at that instant: its `local_counts`, or a lower count if the board has stopped before it."""

    def local_counts(self, counts: int) -> int:
        """Convert an instant of the simulation to the board's count."""
        return counts * self._rate // PPM

    def instant(self, local_counts: int) -> int:
        """Convert a board's count to the first instant of the simulation with this count."""
        return -(-local_counts * PPM // self._rate)

    def instants(self, local_counts: Int64Array) -> Int64Array:
        """Convert an array of board's counts to instants, without overflow."""
        whole, rest = local_counts // self._rate, local_counts % self._rate
        first: Int64Array = whole * PPM - (-rest * PPM // self._rate)
        return first

    def enter(self, counts: int) -> int:
        """Advance to an instant of the simulation and return the board's time, which never decreases."""
        if counts > self.now_counts:
            self.go_to(counts, self.local_counts(counts))
        return self._now_local_counts

    def go_to(self, counts: int, local_counts: int) -> None:
        """Advance to an instant of the simulation and a count of the board."""
        self.now_counts, self._now_local_counts = counts, local_counts
