"""The bus log in the format of `candump -L`, which can-utils, cantools and Wireshark read."""

from collections.abc import Iterable

from steptwin.protocol.frame import Frame
from steptwin.protocol.timer import COUNTS_PER_US

CHANNEL = "steptwin0"


def candump_lines(log: Iterable[tuple[int, Frame]]) -> Iterable[str]:
    """One line a frame, with the simulated time at which it became valid."""
    for counts, frame in log:
        yield candump_line(frame, counts)


def candump_line(frame: Frame, counts: int) -> str:
    """A frame with its simulated time, to the microsecond."""
    us = counts // COUNTS_PER_US
    return f"({us // 1_000_000:010d}.{us % 1_000_000:06d}) {CHANNEL} {frame.cob_id:03X}#{frame.data.hex().upper()}\n"
