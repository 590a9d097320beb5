"""Write and read the bus log, one line a frame, in the format of `candump -L`.

can-utils, cantools and Wireshark read it too. An instant is the simulated time at which the frame became valid.
"""

import re
from collections.abc import Iterator
from pathlib import Path
from typing import Final

from steptwin.host.common.errors import InputError
from steptwin.protocol.frame import Frame
from steptwin.protocol.timer import COUNTS_PER_US

CHANNEL: Final = "steptwin0"

_LINE: Final = re.compile(r"\((\d+)\.(\d{6})\) \S+ ([0-9A-F]{3})#([0-9A-F]*)\n?")


def log_line(counts: int, frame: Frame) -> str:
    """Return the line of a frame, its instant rounded down to the microsecond."""
    us = counts // COUNTS_PER_US
    return f"({us // 1_000_000:010d}.{us % 1_000_000:06d}) {CHANNEL} {frame.cob_id:03X}#{frame.data.hex().upper()}\n"


def read_frames(log: Path) -> Iterator[tuple[int, Frame]]:
    """Yield each frame with its instant in counts since power-up.

    Raises:
        InputError: a line is not in candump's format; the message names file and line.
    """
    with log.open(encoding="ascii", errors="replace") as lines:
        for number, line in enumerate(lines, start=1):
            match = _LINE.fullmatch(line)
            if not match or len(match[4]) % 2:
                raise InputError(f"{log}: line {number}: is not in candump's format")
            us = int(match[1]) * 1_000_000 + int(match[2])
            yield us * COUNTS_PER_US, Frame(int(match[3], 16), bytes.fromhex(match[4]))


def count_frames(log: Path) -> int:
    """Return the number of frames, without looking at them."""
    with log.open("rb") as lines:
        return sum(1 for _ in lines)
