"""SDO block transfers, server side, after their initiation (CiA 301, sections 7.2.4.3.9 to 7.2.4.3.16).

Blocks of up to 127 segments go one way, one acknowledgement comes back per block, and a CRC-16-CCITT closes the whole,
if the client asked for one. A segment's first byte is its number in the block, with bit 7 set in the last of all, where
other frames have their command. Blocks that come in here are so short that no number looks like a command that
initiates a transfer: a client that begins anew in the middle of a block is understood.
"""

from binascii import crc_hqx

from steptwin.protocol.abort import AbortCode, SdoAbortError

SEGMENT_BYTES = 7
BLOCK_SIZE_MAX = 127
DOWNLOAD_BLOCK_SIZE = 31
"""The largest size for which segments, 0x01..0x1F and 0x81..0x9F, and initiations, from 0x20 and 0xA0 on, differ."""

_ACKNOWLEDGEMENT, _UPLOAD_END = 0xA2, 0xC1
_LAST = 0x80
_SEQUENCE = 0x7F


def is_segment(request: bytes) -> bool:
    """Whether a frame that arrives within a block can be one of its segments."""
    return 1 <= request[0] & _SEQUENCE <= DOWNLOAD_BLOCK_SIZE


class BlockDownload:
    """Data coming in."""

    def __init__(self, index: int, subindex: int, limit: int, announced: int | None, *, with_crc: bool) -> None:
        self.index = index
        self.subindex = subindex
        self.receiving = True
        """Whether segments are due; False once the last has come and the end is due."""
        self._limit = limit
        self._announced = announced
        self._with_crc = with_crc
        self._data = bytearray()
        self._received = 0

    def segment(self, request: bytes) -> list[bytes]:
        """Take a segment; the one that closes a block is answered.

        Out of order it is dropped; the acknowledgement then makes the client send again from the one that is missing.
        """
        number, last = request[0] & _SEQUENCE, bool(request[0] & _LAST)
        if number == self._received + 1:
            self._received = number
            self._data += request[1:]
            if len(self._data) >= self._limit + SEGMENT_BYTES:
                raise SdoAbortError(AbortCode.LENGTH_TOO_HIGH)
            self.receiving = not last
        if number < DOWNLOAD_BLOCK_SIZE and not last:
            return []
        received, self._received = self._received, 0
        return [bytes((_ACKNOWLEDGEMENT, received, DOWNLOAD_BLOCK_SIZE)) + bytes(5)]

    def end(self, request: bytes) -> bytes:
        """The client says how much of the last segment is filling and what the CRC is; return the data."""
        if self.receiving:
            raise SdoAbortError(AbortCode.COMMAND_UNKNOWN)
        data = bytes(self._data[: len(self._data) - (request[0] >> 2 & 7)])
        if self._with_crc and crc_hqx(data, 0) != int.from_bytes(request[1:3], "little"):
            raise SdoAbortError(AbortCode.CRC_WRONG)
        if self._announced not in (None, len(data)):
            raise SdoAbortError(AbortCode.LENGTH_MISMATCH)
        return data


class BlockUpload:
    """Data going out."""

    def __init__(self, index: int, subindex: int, data: bytes, block_size: int, *, with_crc: bool) -> None:
        self.index = index
        self.subindex = subindex
        self._crc = crc_hqx(data, 0) if with_crc else 0
        self._left = data
        self._started = False
        self._sent = 0
        """Segments of the block under way; 0 before the first block and after the last."""
        self._set_block_size(block_size)

    def _set_block_size(self, block_size: int) -> None:
        if not 1 <= block_size <= BLOCK_SIZE_MAX:
            raise SdoAbortError(AbortCode.BLOCK_SIZE_INVALID)
        self._block_size = block_size

    def _block(self) -> list[bytes]:
        """The next block, from the first byte that is not acknowledged."""
        parts = [self._left[i : i + SEGMENT_BYTES] for i in range(0, len(self._left), SEGMENT_BYTES)] or [b""]
        parts, rest = parts[: self._block_size], parts[self._block_size :]
        self._sent = len(parts)
        segments = [bytes((number,)) + part.ljust(SEGMENT_BYTES, b"\0") for number, part in enumerate(parts, start=1)]
        if not rest:
            segments[-1] = bytes((segments[-1][0] | _LAST,)) + segments[-1][1:]
        return segments

    def start(self) -> list[bytes]:
        """The client is ready for the first block."""
        if self._started:
            raise SdoAbortError(AbortCode.COMMAND_UNKNOWN)
        self._started = True
        return self._block()

    def acknowledge(self, request: bytes) -> list[bytes]:
        """The client has so many segments of the block: send what follows, or the end."""
        if not self._sent:
            raise SdoAbortError(AbortCode.COMMAND_UNKNOWN)
        received = request[1]
        if received > self._sent:
            raise SdoAbortError(AbortCode.SEQUENCE_INVALID)
        self._set_block_size(request[2])
        taken = received * SEGMENT_BYTES
        if received and taken >= len(self._left):
            filling = taken - len(self._left)
            self._sent = 0
            return [bytes((_UPLOAD_END | filling << 2,)) + self._crc.to_bytes(2, "little") + bytes(5)]
        self._left = self._left[taken:]
        return self._block()
