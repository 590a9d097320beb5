"""Serve SDO requests: expedited, segmented and block transfers (CiA 301, section 7.2.4.3), bytes in, bytes out.

Blocks of up to 127 segments go one way and each block is acknowledged; a CRC-16-CCITT ends the transfer if the client
asked for one. The first byte of a segment is its number in the block, with bit 7 set in the last segment of all; other
frames have their command there. Download blocks are kept so short that no segment number looks like a command that
initiates a transfer, so that a client may begin a new transfer in the middle of a block.
"""

from binascii import crc_hqx
from dataclasses import dataclass
from typing import Final

from steptwin.protocol.abort import AbortCode, SdoAbortError
from steptwin.protocol.dictionary import ObjectDictionary
from steptwin.protocol.od import address_of

SEGMENT_BYTES = 7
BLOCK_SIZE_MAX = 127
DOWNLOAD_BLOCK_SIZE = 31
"""Largest size whose first bytes of segments, 01h..1Fh and 81h..9Fh, differ from initiations, 20h.. and A0h.."""

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
        """Return the first block: the client is ready for it."""
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


# Client command specifiers, bits 7..5 of the first byte.
_DOWNLOAD_SEGMENT: Final = 0
_DOWNLOAD_INITIATE: Final = 1
_UPLOAD_INITIATE: Final = 2
_UPLOAD_SEGMENT: Final = 3
_ABORT: Final = 4
_BLOCK_UPLOAD: Final = 5
_BLOCK_DOWNLOAD: Final = 6

_EXPEDITED: Final = 0x02
_SIZE_INDICATED: Final = 0x01
_TOGGLE: Final = 0x10
_LAST_SEGMENT: Final = 0x01
_SEGMENT_BYTES: Final = 7

# Block transfers: bits of the first byte.
_CRC: Final = 0x04
_BLOCK_SIZE_INDICATED: Final = 0x02
_BLOCK_DOWNLOAD_END: Final = 0x01
_BLOCK_UPLOAD_COMMAND: Final = 0x03
_INITIATE, _END, _ACKNOWLEDGE = 0, 1, 2


@dataclass(slots=True)
class _Segmented:
    """A segmented transfer under way; `data` is the part of an upload still to send, or of a download received."""

    index: int
    subindex: int
    upload: bool
    data: bytes
    limit: int = 0
    """Number of bytes that a download may have in all."""
    announced: int | None = None
    """Number of bytes that a download must have, if the client has said it."""
    toggle: int = 0


class SdoServer:
    """One server on one object dictionary; a new initiation replaces a transfer that was left unfinished."""

    def __init__(self, dictionary: ObjectDictionary) -> None:
        self._dictionary = dictionary
        self._transfer: _Segmented | BlockDownload | BlockUpload | None = None
        self.dropped = 0
        """Number of requests that got no answer, because they did not have the 8 bytes of an SDO."""

    def reset(self) -> None:
        """Drop a transfer under way, as a communication reset does."""
        self._transfer = None

    def handle(self, request: bytes) -> list[bytes]:
        """Answer one request: with one frame, with a block of frames, or with none where the standard says so."""
        if len(request) != 8:
            self.dropped += 1
            return []
        transfer = self._transfer
        in_block = isinstance(transfer, BlockDownload) and transfer.receiving and is_segment(request)
        if request[0] >> 5 == _ABORT and not in_block:
            self._transfer = None
            return []
        index, subindex = int.from_bytes(request[1:3], "little"), request[3]
        if in_block or not initiates(request[0]):
            index, subindex = (transfer.index, transfer.subindex) if transfer else (0, 0)
        try:
            if in_block and isinstance(transfer, BlockDownload):
                return transfer.segment(request)
            return self._answer(request, index, subindex)
        except SdoAbortError as error:
            self._transfer = None
            head = bytes((0x80, index & 0xFF, index >> 8, subindex))
            return [head + error.code.to_bytes(4, "little")]

    def _answer(self, request: bytes, index: int, subindex: int) -> list[bytes]:
        command = request[0] >> 5
        if command == _DOWNLOAD_INITIATE:
            return [self._download_initiate(request, index, subindex)]
        if command == _UPLOAD_INITIATE:
            return [self._upload_initiate(index, subindex)]
        if command == _DOWNLOAD_SEGMENT:
            return [self._download_segment(request)]
        if command == _UPLOAD_SEGMENT:
            return [self._upload_segment(request)]
        if command == _BLOCK_DOWNLOAD:
            return [self._block_download(request, index, subindex)]
        if command == _BLOCK_UPLOAD:
            return self._block_upload(request, index, subindex)
        raise SdoAbortError(AbortCode.COMMAND_UNKNOWN)

    # --- expedited and segmented

    def _download_initiate(self, request: bytes, index: int, subindex: int) -> bytes:
        command = request[0]
        limit = self._dictionary.size_to_write(address_of(index, subindex))
        if command & _EXPEDITED:
            size = 4 - (command >> 2 & 3) if command & _SIZE_INDICATED else limit
            self._transfer = None
            self._dictionary.write(address_of(index, subindex), request[4 : 4 + size])
        else:
            announced = int.from_bytes(request[4:8], "little") if command & _SIZE_INDICATED else None
            if announced is not None and announced > limit:
                raise SdoAbortError(AbortCode.LENGTH_TOO_HIGH)
            self._transfer = _Segmented(index, subindex, upload=False, data=b"", limit=limit, announced=announced)
        return bytes((0x60,)) + request[1:4] + bytes(4)

    def _download_segment(self, request: bytes) -> bytes:
        transfer = self._checked(request, upload=False)
        length = _SEGMENT_BYTES - (request[0] >> 1 & 7)
        transfer.data += request[1 : 1 + length]
        if len(transfer.data) > transfer.limit:
            raise SdoAbortError(AbortCode.LENGTH_TOO_HIGH)
        if request[0] & _LAST_SEGMENT:
            if transfer.announced not in (None, len(transfer.data)):
                raise SdoAbortError(AbortCode.LENGTH_MISMATCH)
            self._transfer = None
            self._dictionary.write(address_of(transfer.index, transfer.subindex), transfer.data)
        answer = 0x20 | transfer.toggle
        transfer.toggle ^= _TOGGLE
        return bytes((answer,)) + bytes(7)

    def _upload_initiate(self, index: int, subindex: int) -> bytes:
        data = self._dictionary.read(address_of(index, subindex))
        head = index.to_bytes(2, "little") + bytes((subindex,))
        if 0 < len(data) <= 4:
            self._transfer = None
            command = 0x40 | (4 - len(data)) << 2 | _EXPEDITED | _SIZE_INDICATED
            return bytes((command,)) + head + data.ljust(4, b"\0")
        self._transfer = _Segmented(index, subindex, upload=True, data=data)
        return bytes((0x40 | _SIZE_INDICATED,)) + head + len(data).to_bytes(4, "little")

    def _upload_segment(self, request: bytes) -> bytes:
        transfer = self._checked(request, upload=True)
        part, transfer.data = transfer.data[:_SEGMENT_BYTES], transfer.data[_SEGMENT_BYTES:]
        command = transfer.toggle | (_SEGMENT_BYTES - len(part)) << 1
        if not transfer.data:
            command |= _LAST_SEGMENT
            self._transfer = None
        transfer.toggle ^= _TOGGLE
        return bytes((command,)) + part.ljust(_SEGMENT_BYTES, b"\0")

    def _checked(self, request: bytes, *, upload: bool) -> _Segmented:
        transfer = self._transfer
        if not isinstance(transfer, _Segmented) or transfer.upload is not upload:
            raise SdoAbortError(AbortCode.COMMAND_UNKNOWN)
        if request[0] & _TOGGLE != transfer.toggle:
            raise SdoAbortError(AbortCode.TOGGLE_NOT_ALTERNATED)
        return transfer

    # --- blocks

    def _block_download(self, request: bytes, index: int, subindex: int) -> bytes:
        if request[0] & _BLOCK_DOWNLOAD_END:
            return self._block_download_end(request)
        limit = self._dictionary.size_to_write(address_of(index, subindex))
        announced = int.from_bytes(request[4:8], "little") if request[0] & _BLOCK_SIZE_INDICATED else None
        if announced is not None and announced > limit:
            raise SdoAbortError(AbortCode.LENGTH_TOO_HIGH)
        self._transfer = BlockDownload(index, subindex, limit, announced, with_crc=bool(request[0] & _CRC))
        return bytes((0xA0 | request[0] & _CRC,)) + request[1:4] + bytes((DOWNLOAD_BLOCK_SIZE, 0, 0, 0))

    def _block_download_end(self, request: bytes) -> bytes:
        transfer = self._transfer
        if not isinstance(transfer, BlockDownload):
            raise SdoAbortError(AbortCode.COMMAND_UNKNOWN)
        self._dictionary.write(address_of(transfer.index, transfer.subindex), transfer.end(request))
        self._transfer = None
        return bytes((0xA0 | _END,)) + bytes(7)

    def _block_upload(self, request: bytes, index: int, subindex: int) -> list[bytes]:
        command = request[0] & _BLOCK_UPLOAD_COMMAND
        if command == _INITIATE:
            return [self._block_upload_initiate(request, index, subindex)]
        transfer = self._transfer
        if not isinstance(transfer, BlockUpload):
            raise SdoAbortError(AbortCode.COMMAND_UNKNOWN)
        if command == _END:
            self._transfer = None
            return []
        return transfer.acknowledge(request) if command == _ACKNOWLEDGE else transfer.start()

    def _block_upload_initiate(self, request: bytes, index: int, subindex: int) -> bytes:
        """Initiate an upload; ignore the client's offer of a segmented transfer below a threshold.

        The answer confirms a CRC exactly if the client asked for one, here and for a download: some clients take the
        answer as an agreement.
        """
        data = self._dictionary.read(address_of(index, subindex))
        self._transfer = BlockUpload(index, subindex, data, request[4], with_crc=bool(request[0] & _CRC))
        command = 0xC0 | request[0] & _CRC | _BLOCK_SIZE_INDICATED
        return bytes((command,)) + request[1:4] + len(data).to_bytes(4, "little")


def initiates(first_byte: int) -> bool:
    """Return True if a request begins a transfer, and so names an object."""
    command = first_byte >> 5
    if command == _BLOCK_DOWNLOAD:
        return not first_byte & _BLOCK_DOWNLOAD_END
    if command == _BLOCK_UPLOAD:
        return first_byte & _BLOCK_UPLOAD_COMMAND == _INITIATE
    return command in (_DOWNLOAD_INITIATE, _UPLOAD_INITIATE)
