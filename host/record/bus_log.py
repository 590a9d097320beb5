"""Write and read the bus log, one line a frame, in the format of `candump -L`.

can-utils, cantools and Wireshark read it too. An instant is the simulated time when the frame became valid.
"""

import re
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Final

from steptwin.host.common.errors import InputError, RecordingError
from steptwin.host.common.file_limits import LOG_LINE_CHARS_MAX
from steptwin.host.common.own_files import growing_file, only_files
from steptwin.protocol.frame import COB_ID_MASK, REMOTE, Frame
from steptwin.protocol.timer import COUNTS_PER_US

CHANNEL: Final = "steptwin0"

SHOWN_BY_CANDUMP: Final = "is what candump shows to people: `candump -L can0 > bus.log` writes what is read"
_SHOWN: Final = re.compile(r"\s*(\([^)]*\)\s+)?\S+\s+([RT]X\s.*)?[0-9A-Fa-f]{3,8}\s+\[[0-9]{1,2}\]")
_LINE: Final = re.compile(r"\((\d{1,10})\.(\d{6})\) \S+ ([0-7][0-9A-F]{2})#(R|(?:[0-9A-F]{2}){0,8})\n?")
"""A frame with an 11-bit identifier; ten digits of seconds are 317 years, which int64 holds in counts."""

_CHUNK_BYTES: Final = 1 << 20


def log_line(counts: int, frame: Frame) -> str:
    """Return the line of a frame, its instant rounded down to the microsecond."""
    us = counts // COUNTS_PER_US
    content = "R" if frame.cob_id & REMOTE else frame.data.hex().upper()
    return f"({us // 1_000_000:010d}.{us % 1_000_000:06d}) {CHANNEL} {frame.cob_id & COB_ID_MASK:03X}#{content}\n"


class BusLog:
    """A bus log that is written while it grows. An error ends the log without an exception; `failure` has it.

    Attributes:
        failure: why the log has ended early; None if it has not.
    """

    def __init__(self, path: Path) -> None:
        """Begin the log in a file, a pipe or a device; raise OSError if it cannot be opened."""
        self.failure: RecordingError | None = None
        self._path = path
        self._file = growing_file(path)  # unbuffered: a killed process loses no lines
        self._until_s = 0.0

    def append(self, lines: Iterable[str], until_s: float) -> None:
        """Write the frames up to an instant; do nothing once the log has ended."""
        if self.failure:
            return
        try:
            self._write("".join(lines).encode())
            self._until_s = until_s
        except OSError as error:
            self.failure = RecordingError(f"{self._path}: {error.strerror}: the bus log ends at {self._until_s:.3f} s")

    def close(self) -> None:
        """End the log."""
        self._file.close()

    def _write(self, data: bytes) -> None:
        rest = memoryview(data)
        while rest:
            rest = rest[self._file.write(rest) :]


def read_frames(log: Path, frames: int | None = None) -> Iterator[tuple[int, Frame]]:
    """Yield each frame, or the first `frames` of them, with its instant in counts since power-up.

    Raises:
        InputError: a line is not in candump's format; the message names file and line.
    """
    with open(log, encoding="ascii", errors="replace", opener=only_files) as lines:
        number = 0
        while number != frames and (line := lines.readline(LOG_LINE_CHARS_MAX + 1)):
            number += 1
            match = _LINE.fullmatch(line)
            if not match:
                why = SHOWN_BY_CANDUMP if is_shown_by_candump(line) else "is not in candump's format"
                raise InputError(f"{log}: line {number}: {why}")
            us = int(match[1]) * 1_000_000 + int(match[2])
            remote = match[4] == "R"
            frame = Frame(int(match[3], 16) | (REMOTE if remote else 0), b"" if remote else bytes.fromhex(match[4]))
            yield us * COUNTS_PER_US, frame


def is_shown_by_candump(line: str) -> bool:
    """Return whether a line has candump's format for people."""
    return _SHOWN.match(line) is not None


def count_frames(log: Path) -> int:
    """Return the number of frames, which is that of lines of any content; the last line may lack its end."""
    frames, last = 0, b"\n"
    with open(log, "rb", opener=only_files) as file:
        while chunk := file.read(_CHUNK_BYTES):
            frames += chunk.count(b"\n")
            last = chunk[-1:]
    return frames + (last != b"\n")
