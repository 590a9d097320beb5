"""The bus log in the format of `candump -L`, which can-utils, cantools and Wireshark read."""

from collections.abc import Iterable

from controller.motion import COUNTS_PER_US
from protocol.frame import Frame

CHANNEL = "steptwin0"


def candump_lines(log: Iterable[tuple[int, Frame]]) -> Iterable[str]:
    """One line a frame, with the simulated time at which it became valid, to the microsecond."""
    for counts, frame in log:
        us = counts // COUNTS_PER_US
        yield f"({us // 1_000_000:010d}.{us % 1_000_000:06d}) {CHANNEL} {frame.cob_id:03X}#{frame.data.hex().upper()}\n"
