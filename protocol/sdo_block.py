"""Serve SDO block transfers after their initiation (CiA 301, sections 7.2.4.3.9 to 7.2.4.3.16).

Blocks of up to 127 segments go one way and each block is acknowledged; a CRC-16-CCITT ends the transfer if the client
asked for one. The first byte of a segment is its number in the block, with bit 7 set in the last segment of all; other
frames have their command there. Download blocks are kept so short that no segment number looks like a command that
initiates a transfer, so that a client may begin a new transfer in the middle of a block.
"""

from binascii import crc_hqx

from steptwin.protocol.abort import AbortCode, SdoAbortError

SEGMENT_BYTES = 7
BLOCK_SIZE_MAX = 127
DOWNLOAD_BLOCK_SIZE = 31
"""Largest size for which first bytes of segments, 01h..1Fh and 81h..9Fh, differ from initiations, 20h.. and A0h.."""

_ACKNOWLEDGEMENT, _UPLOAD_END = 0xA2, 0xC1
_LAST = 0x80
_SEQUENCE = 0x7F


def is_segment(request: bytes) -> bool:
    """Return True if a frame that arrives within a block can be one of its segments."""
    return 1 <= request[0] & _SEQUENCE <= DOWNLOAD_BLOCK_SIZE


class BlockDownload:
    """A block download in progress: data from the client."""

    def __init__(self, index: int, subindex: int, limit: int, announced: int | None, *, with_crc: bool) -> None:
        self.index = index
        self.subindex = subindex
        self.receiving = True
        """True while segments are due; False when the last has come and the end of the transfer is due."""
        self._limit = limit
        self._announced = announced
        self._with_crc = with_crc
        self._data = bytearray()
        self._received = 0

    def segment(self, request: bytes) -> list[bytes]:
        """Take a segment; return the acknowledgement if it is the last of its block, else nothing.

        A segment out of order is dropped; the acknowledgement makes the client send again from the missing one on.
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
        """End the transfer with the client's last request, which has the fill bytes and the CRC; return the data."""
        if self.receiving:
            raise SdoAbortError(AbortCode.COMMAND_UNKNOWN)
        data = bytes(self._data[: len(self._data) - (request[0] >> 2 & 7)])
        if self._with_crc and crc_hqx(data, 0) != int.from_bytes(request[1:3], "little"):
            raise SdoAbortError(AbortCode.CRC_WRONG)
        if self._announced not in (None, len(data)):
            raise SdoAbortError(AbortCode.LENGTH_MISMATCH)
        return data


class BlockUpload:
    """A block upload in progress: data to the client."""

    def __init__(self, index: int, subindex: int, data: bytes, block_size: int, *, with_crc: bool) -> None:
        self.index = index
        self.subindex = subindex
        self._crc = crc_hqx(data, 0) if with_crc else 0
        self._left = data
        self._started = False
        self._sent = 0
        """Number of segments in the block under way; 0 before the first block and after the last."""
        self._set_block_size(block_size)

    def _set_block_size(self, block_size: int) -> None:
        if not 1 <= block_size <= BLOCK_SIZE_MAX:
            raise SdoAbortError(AbortCode.BLOCK_SIZE_INVALID)
        self._block_size = block_size

    def _block(self) -> list[bytes]:
        """Return the segments of the next block, from the first byte that is not acknowledged."""
        parts = [self._left[i : i + SEGMENT_BYTES] for i in range(0, len(self._left), SEGMENT_BYTES)] or [b""]
        parts, rest = parts[: self._block_size], parts[self._block_size :]
        self._sent = len(parts)
        segments = [bytes((number,)) + part.ljust(SEGMENT_BYTES, b"\0") for number, part in enumerate(parts, start=1)]
        if not rest:
            segments[-1] = bytes((segments[-1][0] | _LAST,)) + segments[-1][1:]
        return segments

    def start(self) -> list[bytes]:
        """Return the first block, for which the client is ready."""
        if self._started:
            raise SdoAbortError(AbortCode.COMMAND_UNKNOWN)
        self._started = True
        return self._block()

    def acknowledge(self, request: bytes) -> list[bytes]:
        """Take the acknowledgement of a block; return the next block, or the end of the transfer."""
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
