"""The container MCAP: schemas, channels, chunks of messages, and a summary to find them by (https://mcap.dev/spec).

The library writes message by message, most of it in Python; here numpy makes the bytes of a whole chunk at once.
"""

from collections import Counter
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from enum import IntEnum
from struct import pack
from typing import BinaryIO, Final
from zlib import crc32

import numpy as np
from numpy.typing import NDArray

from host.verify.evidence import Int64Array
from host.waveforms.text import Text

_MAGIC: Final = b"\x89MCAP0\r\n"

_MESSAGE: Final = np.dtype(
    [
        ("opcode", "u1"),
        ("content_bytes", "<u8"),
        ("channel", "<u2"),
        ("sequence", "<u4"),
        ("log_time_ns", "<u8"),
        ("publish_time_ns", "<u8"),
    ]
)
"""A message's record up to its data."""
_MESSAGE_CONTENT_BYTES: Final = _MESSAGE.itemsize - 9
"""What its length counts without the data: all behind itself."""
_FOOTER_CONTENT_BYTES: Final = 8 + 8 + 4


class Opcode(IntEnum):
    """What a record is."""

    HEADER = 0x01
    FOOTER = 0x02
    SCHEMA = 0x03
    CHANNEL = 0x04
    MESSAGE = 0x05
    CHUNK = 0x06
    MESSAGE_INDEX = 0x07
    CHUNK_INDEX = 0x08
    STATISTICS = 0x0B
    SUMMARY_OFFSET = 0x0E
    DATA_END = 0x0F


@dataclass(frozen=True, slots=True)
class Messages:
    """Some messages in order of time, one at least.

    Attributes:
        channels: shape (n,), their channels' numbers.
        times_ns: shape (n,), none negative.
        data: shape (n, width), the text of each.
    """

    channels: NDArray[np.uint16]
    times_ns: Int64Array
    data: Text

    def times(self) -> bytes:
        """When the first and the last one were."""
        return pack("<QQ", self.times_ns[0], self.times_ns[-1])


class McapWriter:
    """A file that grows: schemas, then channels, then chunks; it need not be one that can be sought in."""

    def __init__(self, file: BinaryIO, library: str, compression: str, compress: Callable[[bytes], bytes]) -> None:
        """Begin a file of a library; `compression` is the name in the specification's registry of what is done."""
        self._file = file
        self._compression = compression
        self._compress = compress
        self._written_bytes = 0
        self._schemas: list[bytes] = []
        self._channels: list[bytes] = []
        self._chunk_indexes: list[bytes] = []
        """These three are records of the summary."""
        self._message_counts: Counter[int] = Counter()
        self._begin_ns = self._end_ns = 0
        self._write(_MAGIC + _record(Opcode.HEADER, _prefixed(""), _prefixed(library)))

    def add_schema(self, name: str, encoding: str, data: str) -> int:
        """A shape of messages; return its number."""
        number = len(self._schemas) + 1
        self._schemas.append(
            _record(Opcode.SCHEMA, pack("<H", number), _prefixed(name), _prefixed(encoding), _prefixed(data))
        )
        self._write(self._schemas[-1])
        return number

    def add_channel(self, topic: str, encoding: str, schema: int) -> int:
        """A source of messages; return its number."""
        number = len(self._channels) + 1
        metadata = _prefixed("")
        self._channels.append(
            _record(Opcode.CHANNEL, pack("<HH", number, schema), _prefixed(topic), _prefixed(encoding), metadata)
        )
        self._write(self._channels[-1])
        return number

    def add_chunk(self, messages: Messages) -> None:
        """Messages, none of them before those of an earlier chunk."""
        content, offsets = _message_records(messages)
        packed = self._compress(content)
        chunk_begin = self._write(
            _record(
                Opcode.CHUNK,
                messages.times(),
                pack("<QI", len(content), crc32(content)),
                _prefixed(self._compression),
                pack("<Q", len(packed)),
                packed,
            )
        )
        indexes_begin = self._written_bytes
        places = {
            channel: self._write(_record(Opcode.MESSAGE_INDEX, pack("<HI", channel, len(entries)), entries))
            for channel, entries in _entries(messages, offsets).items()
        }
        self._chunk_indexes.append(
            _record(
                Opcode.CHUNK_INDEX,
                messages.times(),
                pack("<QQ", chunk_begin, indexes_begin - chunk_begin),
                _by_channel(places),
                pack("<Q", self._written_bytes - indexes_begin),
                _prefixed(self._compression),
                pack("<QQ", len(packed), len(content)),
            )
        )
        if not self._message_counts:
            self._begin_ns = int(messages.times_ns[0])
        self._end_ns = int(messages.times_ns[-1])
        self._message_counts.update(_message_counts(messages))

    def finish(self) -> None:
        """The summary, without which a reader would have to read everything."""
        self._write(_record(Opcode.DATA_END, pack("<I", 0)))
        summary_begin, summary, offsets = self._written_bytes, b"", b""
        groups = (
            (Opcode.SCHEMA, self._schemas),
            (Opcode.CHANNEL, self._channels),
            (Opcode.STATISTICS, [self._statistics()]),
            (Opcode.CHUNK_INDEX, self._chunk_indexes),
        )
        for opcode, records in groups:
            group = b"".join(records)
            begin = summary_begin + len(summary)
            offsets += _record(Opcode.SUMMARY_OFFSET, pack("<BQQ", opcode, begin, len(group)))
            summary += group
        footer = pack("<BQQQ", Opcode.FOOTER, _FOOTER_CONTENT_BYTES, summary_begin, summary_begin + len(summary))
        checked = summary + offsets + footer
        self._write(checked + pack("<I", crc32(checked)) + _MAGIC)

    def _statistics(self) -> bytes:
        return _record(
            Opcode.STATISTICS,
            pack("<QHI", self._message_counts.total(), len(self._schemas), len(self._channels)),
            pack("<III", 0, 0, len(self._chunk_indexes)),  # neither attachments nor metadata
            pack("<QQ", self._begin_ns, self._end_ns),
            _by_channel(self._message_counts),
        )

    def _write(self, data: bytes) -> int:
        """Return where in the file it begins."""
        begin = self._written_bytes
        self._file.write(data)
        self._written_bytes += len(data)
        return begin


def _record(opcode: Opcode, *content: bytes) -> bytes:
    return b"".join((pack("<BQ", opcode, sum(map(len, content))), *content))


def _prefixed(text: str) -> bytes:
    """With its length in front; an empty map looks like an empty text."""
    data = text.encode()
    return pack("<I", len(data)) + data


def _by_channel(values: Mapping[int, int]) -> bytes:
    pairs = b"".join(pack("<HQ", channel, value) for channel, value in values.items())
    return pack("<I", len(pairs)) + pairs


def _message_records(messages: Messages) -> tuple[bytes, Int64Array]:
    """All records, and where each begins in them."""
    written = messages.data != 0
    heads = np.zeros(len(written), _MESSAGE)
    heads["opcode"] = Opcode.MESSAGE
    heads["content_bytes"] = _MESSAGE_CONTENT_BYTES + np.count_nonzero(written, axis=1)
    heads["channel"] = messages.channels
    heads["log_time_ns"] = heads["publish_time_ns"] = messages.times_ns
    columns = heads.view(np.uint8).reshape(len(heads), _MESSAGE.itemsize)
    kept = np.concatenate([np.ones(columns.shape, np.bool_), written], axis=1)
    records = np.concatenate([columns, messages.data], axis=1)[kept]
    ends = np.cumsum(np.count_nonzero(kept, axis=1), dtype=np.int64)
    return records.tobytes(), np.concatenate([[0], ends[:-1]])


def _entries(messages: Messages, offsets: Int64Array) -> dict[int, bytes]:
    """For each channel the times and offsets of its messages."""
    order = np.argsort(messages.channels, kind="stable")
    pairs = np.column_stack([messages.times_ns, offsets])[order].astype("<u8")
    counts = _message_counts(messages)
    groups = np.split(pairs, np.cumsum([*counts.values()])[:-1])
    return {channel: group.tobytes() for channel, group in zip(counts, groups, strict=True)}


def _message_counts(messages: Messages) -> dict[int, int]:
    """How many each channel has that has any, in the order of their numbers."""
    return {channel: count for channel, count in enumerate(np.bincount(messages.channels).tolist()) if count}
