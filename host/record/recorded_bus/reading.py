"""Read a recorded bus through python-can's readers: logs of candump, Vector's ASC and BLF, PEAK's TRC.

The readers trust their files. Here a file has a limit, a text has whole lines of bounded length, and whatever the
readers raise becomes one line that says where.
"""

import struct
import zlib
from collections import Counter
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Final, NamedTuple, TextIO, cast

from steptwin.host.common.bad_input import prefixed
from steptwin.host.common.errors import InputError
from steptwin.host.common.file_limits import (
    RECORDED_BYTES_MAX,
    RECORDED_FRAMES_MAX,
    RECORDED_LINE_CHARS_MAX,
    check_size,
)
from steptwin.host.record.bus_log import CHANNEL
from steptwin.protocol.frame import COB_ID_MASK, Frame

if TYPE_CHECKING:
    import can

_CANDUMP: Final = ".log"
_BINARY: Final = ".blf"
FORMATS: Final = {
    _CANDUMP: "a log of candump -L",
    ".asc": "Vector's ASC",
    _BINARY: "Vector's BLF",
    ".trc": "PEAK's TRC",
}
"""The formats by the end of a file's name, as python-can knows them."""

_DATA_BYTES_MAX: Final = 8
_LASTS_S_MAX: Final = 86_400
"""Longest recording, in seconds: a day. A jump of the clock, such as from 0 to the time of day, is longer."""


class RecordedFrame(NamedTuple):
    """A frame of a recording.

    Attributes:
        us: its time stamp in whole microseconds; no stamp is before the one of the frame before.
        frame: the frame.
        sent: True if the recording says that its own program sent the frame, False if that it received it.
    """

    us: int
    frame: Frame
    sent: bool


@dataclass(frozen=True, slots=True)
class RecordedBus:
    """A recording.

    Attributes:
        path: its file.
        frames: the data frames with 11-bit identifiers, in the order of the file.
        left_out: how many others there are, by their kind in words.
        cut: True if the file ends within a frame, as when its writer was killed; that frame is missing.
        on_board_clock: True if a time stamp is the instant since power-up at which the frame became valid, as in the
            bus logs that StepTwin writes; False if it is some computer's.
    """

    path: Path
    frames: list[RecordedFrame]
    left_out: Counter[str]
    cut: bool
    on_board_clock: bool


def read_bus(path: Path, channel: str | None = None) -> RecordedBus:
    """Read a recording, or the frames of one of its channels.

    Raises:
        InputError: the file cannot be read, is too large, has none of FORMATS or no frame, or its frames are of several
            channels and none is chosen.
    """
    suffix = path.suffix.lower()
    with prefixed(f"{path}: "):
        if suffix not in FORMATS:
            known = ", ".join(f"{end} ({what})" for end, what in FORMATS.items())
            raise InputError(f"has no known format: a recorded bus is {known}")
        return _Reading(path, FORMATS[suffix]).read(suffix, channel)


class _Lines:
    """The lines of a text, for python-can's readers; a last line without its end is left out."""

    def __init__(self, file: TextIO) -> None:
        self.number = 0
        self.cut = False
        self._file = file

    def __iter__(self) -> Iterator[str]:
        while line := self._file.readline(RECORDED_LINE_CHARS_MAX + 1):
            if not line.endswith("\n"):
                if len(line) > RECORDED_LINE_CHARS_MAX:
                    raise InputError(f"line {self.number + 1}: has more than {RECORDED_LINE_CHARS_MAX} characters")
                self.cut = True
                return
            self.number += 1
            yield line

    def close(self) -> None:
        """Do nothing: whoever has opened the file closes it."""


class _Reading:
    """The reading of one file."""

    def __init__(self, path: Path, form: str) -> None:
        self._path = path
        self._form = form
        self._frames: list[RecordedFrame] = []
        self._left_out: Counter[str] = Counter()
        self._channels: Counter[str] = Counter()
        self._latest_us: int | None = None

    def read(self, suffix: str, channel: str | None) -> RecordedBus:
        try:
            check_size(self._path.stat().st_size, RECORDED_BYTES_MAX)
            if suffix == _BINARY:
                cut = self._read_binary(channel)
            else:
                with self._path.open(encoding="ascii", errors="replace", newline=None) as file:
                    lines = _Lines(file)
                    with self._saying(lambda: f"line {lines.number}"):
                        self._take_all(_text_reader(suffix, lines), channel)
                    cut = lines.cut
        except OSError as error:
            raise InputError(error.strerror or "cannot be read") from error
        if channel is None and len(self._channels) > 1:
            names = ", ".join(map(str, self._channels))
            raise InputError(f"has frames of the channels {names}: channel=NAME chooses one")
        if not self._frames:
            raise InputError(self._nothing(channel))
        self._check_length()
        own = suffix == _CANDUMP and set(self._channels) == {CHANNEL}
        return RecordedBus(self._path, self._frames, self._left_out, cut, own)

    def _read_binary(self, channel: str | None) -> bool:
        from can import BLFReader

        with self._path.open("rb") as file, self._saying(lambda: f"after {len(self._frames)} frames"):
            reader = BLFReader(file)
            said_bytes: int = reader.file_size
            self._take_all(reader, channel)
            return self._path.stat().st_size < said_bytes

    @contextmanager
    def _saying(self, where: Callable[[], str]) -> Iterator[None]:
        """Turn what python-can's readers raise into one line."""
        from can.io.blf import BLFParseError

        try:
            yield
        except InputError:
            raise
        except (*_JUNK, BLFParseError) as error:
            raise InputError(f"{where()}: is not in the format of {self._form}") from error

    def _take_all(self, messages: "Iterable[can.Message]", channel: str | None) -> None:
        for message in messages:
            name = str(message.channel)
            if kind := _other_kind(message):
                self._left_out[kind] += 1
            elif channel is not None and name != channel:
                self._left_out[f"of channel {name}"] += 1
            else:
                self._channels[name] += 1
                self._take(message)

    def _take(self, message: "can.Message") -> None:
        frame = Frame(message.arbitration_id, bytes(message.data))
        if frame.cob_id > COB_ID_MASK or len(frame.data) > _DATA_BYTES_MAX:
            raise ValueError(frame)
        if len(self._frames) == RECORDED_FRAMES_MAX:
            raise InputError(f"has more than {RECORDED_FRAMES_MAX} frames: record or cut out a shorter part")
        us = round(1e6 * message.timestamp)
        if self._latest_us is not None and us < self._latest_us:
            us = self._latest_us
        self._latest_us = us
        self._frames.append(RecordedFrame(us, frame, not message.is_rx))

    def _nothing(self, channel: str | None) -> str:
        if channel is not None and self._left_out:
            others = ", ".join(f"{count} {kind}" for kind, count in sorted(self._left_out.items()))
            return f"channel={channel}: has no data frame with an 11-bit identifier; there are {others}"
        others = "".join(f", but {count} {kind}" for kind, count in self._left_out.items())
        return f"holds no data frame with an 11-bit identifier{others}"

    def _check_length(self) -> None:
        lasts_s = (self._frames[-1].us - self._frames[0].us) / 1e6
        if lasts_s > _LASTS_S_MAX:
            raise InputError(f"lasts {lasts_s:.0f} s by its time stamps: at most {_LASTS_S_MAX} s are replayed")


_JUNK: Final = (
    *(ValueError, IndexError, KeyError, TypeError, OverflowError, NotImplementedError, EOFError),
    *(struct.error, zlib.error),
)
"""What python-can's readers raise for files of another format."""


def _text_reader(suffix: str, lines: _Lines) -> "Iterable[can.Message]":
    from can import ASCReader, CanutilsLogReader, TRCReader

    readers: dict[str, Callable[[TextIO], Iterable[can.Message]]] = {
        _CANDUMP: CanutilsLogReader,
        ".asc": ASCReader,
        ".trc": TRCReader,
    }
    return readers[suffix](cast(TextIO, lines))


def _other_kind(message: "can.Message") -> str | None:
    """Return the kind of a frame that the board does not hear, in words; None for a data frame that it may hear."""
    if message.is_error_frame:
        return "error frames"
    if message.is_remote_frame:
        return "remote frames"
    if message.is_fd:
        return "CAN FD frames"
    if message.is_extended_id:
        return "frames with 29-bit identifiers"
    return None
