"""Read a recorded bus with python-can's readers: logs of candump, Vector's ASC and BLF, PEAK's TRC.

The readers trust their files. Here files have a size limit, texts have whole lines of bounded length, and the readers'
exceptions become one line with the place.

The sender of a frame follows from its identifier (CiA 301, section 7.3.5). Hosts may move the identifiers of a board's
PDOs and EMCY by SDO, which is tracked. For identifiers without a service the direction decides, if the recording
program was the host or the board.
"""

import struct
import zlib
from collections import Counter
from collections.abc import Callable, Collection, Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from enum import Enum
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
from steptwin.host.common.own_files import only_files
from steptwin.host.record.bus_log import CHANNEL, SHOWN_BY_CANDUMP, is_shown_by_candump
from steptwin.protocol.frame import (
    COB_HEARTBEAT,
    COB_ID_INVALID,
    COB_ID_MASK,
    COB_NMT,
    COB_SDO_REQUEST,
    COB_SYNC,
    COB_TPDO,
    FROM_NODE,
    NODE_ID_MAX,
    TO_NODE,
    Frame,
)
from steptwin.protocol.od import address_of
from steptwin.protocol.sdo_frames import DOWNLOAD, expedited_value

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
"""Formats by file suffix, as in python-can."""

_DATA_BYTES_MAX: Final = 8
_LASTS_S_MAX: Final = 86_400
"""Longest recording in seconds: a day. A jump of the clock, such as from 0 to the time of day, is longer."""


_BACK_US: Final = 200_000
"""Largest time by which frames of several interfaces may be out of order; a larger step means a reset clock."""
_FOLLOWS_US: Final = 10_000
"""Assumed time between two frames whose stamps do not give it."""


class RecordedFrame(NamedTuple):
    """A frame of a recording.

    Attributes:
        us: its time stamp in whole microseconds, not before that of the frame before.
        frame: the frame.
        sent: True if the recording marks the frame as sent by its own program, False if as received.
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
        left_out: number of other frames by kind.
        cut: True if the file ends within a frame, as when its writer was killed; that frame is missing.
        steps_back: number of resets of the stamps' clock; later frames are shifted to follow closely.
        on_board_clock: True if a time stamp is the instant since power-up when the frame became valid, as in
            StepTwin's bus logs; False for a computer's clock.
    """

    path: Path
    frames: list[RecordedFrame]
    left_out: Counter[str]
    cut: bool
    steps_back: int
    on_board_clock: bool


def read_bus(path: Path, channel: str | None = None) -> RecordedBus:
    """Read a recording, or the frames of one of its channels.

    Raises:
        InputError: the file is unreadable, too large, of no known format or without frames, or its frames are of
            several channels and none is chosen.
    """
    suffix = path.suffix.lower()
    with prefixed(f"{path}: "):
        if suffix not in FORMATS:
            known = ", ".join(f"{end} ({what})" for end, what in FORMATS.items())
            raise InputError(f"has no known format: a recorded bus is {known}")
        return _Reading(path, FORMATS[suffix]).read(suffix, channel)


class _Lines:
    """Lines of a text for python-can's readers; an incomplete last line is left out."""

    def __init__(self, file: TextIO) -> None:
        self.number, self.last = 0, ""
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
            self.last = line
            yield line

    def close(self) -> None:
        """Do nothing; the caller closes the file."""


class _Reading:
    """The reading of one file."""

    def __init__(self, path: Path, form: str) -> None:
        self._path = path
        self._form = form
        self._frames: list[RecordedFrame] = []
        self._left_out: Counter[str] = Counter()
        self._channels: Counter[str] = Counter()
        self._latest_us: int | None = None
        self._shift_us = 0
        """Shift of the stamps since their clock was reset."""
        self._steps_back = 0

    def read(self, suffix: str, channel: str | None) -> RecordedBus:
        try:
            check_size(self._path.stat().st_size, RECORDED_BYTES_MAX)
            if suffix == _BINARY:
                cut = self._read_binary(channel)
            else:
                with open(self._path, encoding="ascii", errors="replace", newline=None, opener=only_files) as file:
                    lines = _Lines(file)
                    with self._saying(lambda: f"line {lines.number}", lambda: lines.last):
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
        return RecordedBus(self._path, self._frames, self._left_out, cut, self._steps_back, own)

    def _read_binary(self, channel: str | None) -> bool:
        from can import BLFReader

        with (
            open(self._path, "rb", opener=only_files) as file,
            self._saying(lambda: f"after {len(self._frames)} frames"),
        ):
            reader = BLFReader(file)
            said_bytes: int = reader.file_size
            self._take_all(reader, channel)
            return self._path.stat().st_size < said_bytes

    @contextmanager
    def _saying(self, where: Callable[[], str], line: Callable[[], str] = str) -> Iterator[None]:
        """Convert exceptions of python-can's readers to one line."""
        from can.io.blf import BLFParseError

        try:
            yield
        except InputError:
            raise
        except (*_JUNK, BLFParseError) as error:
            why = SHOWN_BY_CANDUMP if is_shown_by_candump(line()) else f"is not in the format of {self._form}"
            raise InputError(f"{where()}: {why}") from error

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
        us = round(1e6 * message.timestamp) + self._shift_us
        if self._latest_us is not None and us < self._latest_us:
            if us < self._latest_us - _BACK_US:
                self._steps_back += 1
                self._shift_us += self._latest_us + _FOLLOWS_US - us
                us = self._latest_us + _FOLLOWS_US
            us = max(us, self._latest_us)
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
    *(ValueError, IndexError, KeyError, OverflowError, NotImplementedError, EOFError),
    *(struct.error, zlib.error),
)
"""Exceptions of python-can's readers for files of another format. A TypeError has another cause."""


def _text_reader(suffix: str, lines: _Lines) -> "Iterable[can.Message]":
    from can import ASCReader, CanutilsLogReader, TRCReader

    readers: dict[str, Callable[[TextIO], Iterable[can.Message]]] = {
        _CANDUMP: CanutilsLogReader,
        ".asc": ASCReader,
        ".trc": TRCReader,
    }
    return readers[suffix](cast(TextIO, lines))


def _other_kind(message: "can.Message") -> str | None:
    """Return the kind of a frame that the board cannot receive, as text; None for a data frame that it may receive."""
    if message.is_error_frame:
        return "error frames"
    if message.is_remote_frame:
        return "remote frames"
    if message.is_fd:
        return "CAN FD frames"
    if message.is_extended_id:
        return "frames with 29-bit identifiers"
    return None


_COB_TIME: Final = 0x100
_MOVABLE: Final = frozenset((address_of(0x1014), *(address_of(0x1800 + i, 1) for i in range(len(COB_TPDO)))))
"""Objects with the identifiers of a node's own frames."""


class Sender(Enum):
    """Sender of a frame."""

    BOARD = "board"
    HOST = "host"
    """A host, or another station with a heartbeat that a board may watch."""
    OTHER = "other"
    """A node of another board, or a host that talks to one."""


def senders_of(frames: Sequence[RecordedFrame], node_ids: Collection[int]) -> list[Sender]:
    """Return the sender of each frame of a recording, for a board with these nodes."""
    identifiers = Identifiers(node_ids)
    by_identifier = [identifiers.sender_of(recorded.frame) for recorded in frames]
    host_sent = _host_was_recording(frames, by_identifier)
    return [
        sender or (Sender.OTHER if host_sent is not None and frame.sent != host_sent else Sender.HOST)
        for frame, sender in zip(frames, by_identifier, strict=True)
    ]


class Identifiers:
    """Determines senders by identifiers, frame by frame: a request may change the identifier of a node's frames."""

    def __init__(self, node_ids: Collection[int]) -> None:
        """Start with the identifiers of a board's nodes after power-up."""
        self._node_ids = node_ids
        self._boards = {base + node for base in FROM_NODE for node in node_ids}
        self._known: dict[int, Sender | None] = {}

    def sender_of(self, frame: Frame) -> Sender | None:
        """Return the sender of the next frame; None for an identifier without a service."""
        known, cob_id = self._known, frame.cob_id
        if cob_id not in known:
            known[cob_id] = Sender.BOARD if cob_id in self._boards else _of_no_board(cob_id, self._node_ids)
        moved = _moved_identifier(frame, self._node_ids)
        if moved is not None:
            known[moved] = Sender.BOARD
        return known[cob_id]


def _of_no_board(cob_id: int, node_ids: Collection[int]) -> Sender | None:
    if cob_id in (COB_NMT, COB_SYNC, _COB_TIME):
        return Sender.HOST
    base, node_id = cob_id & ~NODE_ID_MAX, cob_id & NODE_ID_MAX
    if not node_id:
        return None
    if base == COB_HEARTBEAT:
        return Sender.HOST
    if base in TO_NODE:
        return Sender.HOST if node_id in node_ids else Sender.OTHER
    return Sender.OTHER if base in FROM_NODE else None


def _moved_identifier(frame: Frame, node_ids: Collection[int]) -> int | None:
    """Return the new identifier of a board's PDO or EMCY in an SDO request; None for any other frame."""
    if frame.cob_id - COB_SDO_REQUEST not in node_ids:
        return None
    written = expedited_value(frame.data, DOWNLOAD)
    if written is None or written.address not in _MOVABLE:
        return None
    value = int.from_bytes(written.data, "little")
    return None if value & COB_ID_INVALID else value & COB_ID_MASK


def _host_was_recording(frames: Sequence[RecordedFrame], senders: Sequence[Sender | None]) -> bool | None:
    """Return whether the recording program sent the hosts' frames; None if directions do not show it."""
    sides = {
        side: {frame.sent for frame, sender in zip(frames, senders, strict=True) if sender is side}
        for side in (Sender.HOST, Sender.BOARD)
    }
    hosts, boards = sides[Sender.HOST], sides[Sender.BOARD]
    return hosts.pop() if len(hosts) == len(boards) == 1 and hosts != boards else None
