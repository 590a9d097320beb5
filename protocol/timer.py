"""Frequency of the board's timer. Instants and durations on the board are in its counts."""

from typing import Final

COUNTS_PER_US: Final = 72
"""The STM32F103 clocks its timers at 72 MHz (RM0008, section 7.2)."""
COUNTS_PER_MS: Final = 1000 * COUNTS_PER_US
COUNTS_PER_SECOND: Final = 1000 * COUNTS_PER_MS


def counts_of_ns(duration_ns: int) -> int:
    """Convert a minimum time to timer counts, rounded up."""
    return -(-duration_ns * COUNTS_PER_US // 1000)
