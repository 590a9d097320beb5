"""Count the stalls of a live board: for how long its clock stood because the computer was too slow."""

from typing import Final

STALL_NS: Final = 10_000_000
"""Lateness of the loop, in wall time, that the board catches up; for what is beyond it the board's clock stands.

It is well below the times within which CANopen programs notice a loss, some tens of milliseconds, and well above the
usual lateness of a process that is not starved.
"""


class Stalls:
    """Number, sum and maximum of the stalls."""

    def __init__(self) -> None:
        self.count = 0
        self.total_ns = 0
        self.longest_ns = 0

    def add(self, dt_ns: int) -> None:
        """Add a stall."""
        self.count += 1
        self.total_ns += dt_ns
        self.longest_ns = max(self.longest_ns, dt_ns)
