"""Serve SDO requests: expedited, segmented and block transfers (CiA 301, section 7.2.4.3).

A transfer of several requests is a generator: it yields the answer to a request and receives the next request.

A block transfer sends blocks of up to 127 segments; the receiver acknowledges each block. A CRC-16-CCITT ends the
transfer if the client requested one. The first byte of a segment is its number in the block; bit 7 marks the last
segment of the transfer. In other frames the first byte is the command. Download blocks are short: no segment number
equals a command that initiates a transfer. So a client may begin a new transfer in the middle of a block.
"""

from binascii import crc_hqx
from collections.abc import Generator
from typing import Final, NamedTuple, Protocol, TypeAlias

from steptwin.protocol.sdo_frames import (
    ABORT,
    EXPEDITED,
    OBJECT,
    SDO_BYTES,
    SIZE_INDICATED,
    AbortCode,
    SdoAbortError,
    named_address,
    object_bytes,
)

SEGMENT_BYTES = 7
BLOCK_SIZE_MAX = 127
DOWNLOAD_BLOCK_SIZE = 31
"""Largest block whose segments (first byte 01h..1Fh, 81h..9Fh) differ from initiations (20h.., A0h..)."""

# Client command specifiers, bits 7..5 of the first byte.
_DOWNLOAD_SEGMENT: Final = 0
DOWNLOAD_INITIATE: Final = 1
_UPLOAD_INITIATE: Final = 2
_UPLOAD_SEGMENT: Final = 3
_ABORT: Final = 4
_BLOCK_UPLOAD: Final = 5
_BLOCK_DOWNLOAD: Final = 6

_TOGGLE: Final = 0x10
_LAST_SEGMENT: Final = 0x01

# Block transfers: bits of the first byte, and sub-commands (bits 1..0 of an upload, bit 0 of a download).
_CRC: Final = 0x04
_BLOCK_SIZE_INDICATED: Final = 0x02
_LAST_OF_ALL: Final = 0x80
_NUMBER: Final = 0x7F
_INITIATE, _END, _ACKNOWLEDGE, _START = 0, 1, 2, 3

_Steps: TypeAlias = Generator[list[bytes], bytes, list[bytes]]
"""A transfer: yields the answer to each request, receives the next request, and returns the last answer."""


def is_segment(request: bytes) -> bool:
    """Return whether a frame that arrives within a block can be one of its segments."""
    return 1 <= request[0] & _NUMBER <= DOWNLOAD_BLOCK_SIZE


def initiates(first_byte: int) -> bool:
    """Return whether a request begins a transfer, and therefore names an object."""
    command = first_byte >> 5
    if command == _BLOCK_DOWNLOAD:
        return not first_byte & _END
    if command == _BLOCK_UPLOAD:
        return first_byte & 3 == _INITIATE
    return command in (DOWNLOAD_INITIATE, _UPLOAD_INITIATE)


class ServedObjects(Protocol):
    """The object dictionary of a server. Each method raises SdoAbortError if it refuses the access."""

    def read(self, address: int) -> bytes:
        """Return an entry's bytes."""
        ...

    def write(self, address: int, data: bytes) -> None:
        """Write an entry from its bytes."""
        ...

    def size_to_write(self, address: int) -> int:
        """Return the number of bytes that a write to an entry must have; for a string, may have at most."""
        ...


class _Transfer(NamedTuple):
    """A transfer in progress."""

    address: int
    steps: _Steps


class SdoServer:
    """Serves one object dictionary. A new initiation replaces an unfinished transfer."""

    def __init__(self, dictionary: ServedObjects) -> None:
        self._dictionary = dictionary
        self._transfer: _Transfer | None = None
        self._in_block = False
        """True while segments of a block download are expected."""
        self.dropped: int = 0
        """Number of requests that were dropped because they did not have 8 bytes."""

    def reset(self) -> None:
        """Drop the transfer in progress, as a communication reset does."""
        self._transfer, self._in_block = None, False

    def handle(self, request: bytes) -> list[bytes]:
        """Answer one request with one frame, a block of frames, or none where CiA 301 asks for no answer."""
        if len(request) != SDO_BYTES:
            self.dropped += 1
            return []
        transfer, first = self._transfer, request[0]
        if first >> 5 == _ABORT and not (self._in_block and is_segment(request)):
            self.reset()
            return []
        begins = initiates(first)
        address = transfer.address if transfer else 0
        if begins:
            address = named_address(request)
        try:
            if begins:
                return self._begin(request, address)
            if transfer is None:
                raise SdoAbortError(AbortCode.COMMAND_UNKNOWN)
            return transfer.steps.send(request)
        except StopIteration as end:
            self.reset()
            answer: list[bytes] = end.value
            return answer
        except SdoAbortError as error:
            self.reset()
            return [bytes((ABORT,)) + object_bytes(address) + error.code.to_bytes(4, "little")]

    def _begin(self, request: bytes, address: int) -> list[bytes]:
        """Answer the first request of a transfer; a short one ends with it."""
        self.reset()
        command = request[0] >> 5
        if command == _UPLOAD_INITIATE:
            data = self._dictionary.read(address)
            if 0 < len(data) <= 4:
                return [_answer(0x43 | (4 - len(data)) << 2, request, data)]
            steps = _upload(request, data)
        elif command == _BLOCK_UPLOAD:
            steps = _block_upload(request, self._dictionary.read(address))
        else:
            limit = self._dictionary.size_to_write(address)
            if command == DOWNLOAD_INITIATE and request[0] & EXPEDITED:
                size = 4 - (request[0] >> 2 & 3) if request[0] & SIZE_INDICATED else limit
                self._dictionary.write(address, request[4 : 4 + size])
                return [_answer(0x60, request)]
            download = self._download if command == DOWNLOAD_INITIATE else self._block_download
            steps = download(request, address, limit)
        self._transfer = _Transfer(address, steps)
        return next(steps)

    def _download(self, request: bytes, address: int, limit: int) -> _Steps:
        """Receive an entry's segments, then write the entry."""
        announced = _announced(request, SIZE_INDICATED, limit)
        data, toggle, last = b"", 0, 0
        answer = _answer(0x60, request)
        while not last:
            request = yield [answer]
            _expect(request, _DOWNLOAD_SEGMENT, toggle)
            data += request[1 : 1 + SEGMENT_BYTES - (request[0] >> 1 & 7)]
            if len(data) > limit:
                raise SdoAbortError(AbortCode.LENGTH_TOO_HIGH)
            answer = bytes((0x20 | toggle,)) + bytes(7)
            toggle ^= _TOGGLE
            last = request[0] & _LAST_SEGMENT
        if announced not in (None, len(data)):
            raise SdoAbortError(AbortCode.LENGTH_MISMATCH)
        self._dictionary.write(address, data)
        return [answer]

    def _block_download(self, request: bytes, address: int, limit: int) -> _Steps:
        """Receive an entry's segments in blocks, then write the entry.

        A segment out of order is dropped; the acknowledgement makes the client repeat from the missing one on. The
        client's last request carries the number of fill bytes and the CRC.
        """
        announced = _announced(request, _BLOCK_SIZE_INDICATED, limit)
        with_crc, data, received = request[0] & _CRC, bytearray(), 0
        answer = [_answer(0xA0 | with_crc, request, bytes((DOWNLOAD_BLOCK_SIZE,)))]
        self._in_block = True
        while self._in_block:
            request = yield answer
            if not is_segment(request):
                raise SdoAbortError(AbortCode.COMMAND_UNKNOWN)
            number, last, answer = request[0] & _NUMBER, bool(request[0] & _LAST_OF_ALL), []
            if number == received + 1:
                received = number
                data += request[1:]
                if len(data) >= limit + SEGMENT_BYTES:
                    raise SdoAbortError(AbortCode.LENGTH_TOO_HIGH)
                self._in_block = not last
            if number == DOWNLOAD_BLOCK_SIZE or last:
                answer = [bytes((0xA2, received, DOWNLOAD_BLOCK_SIZE)) + bytes(5)]
                received = 0
        request = yield answer
        if request[0] >> 5 != _BLOCK_DOWNLOAD:
            raise SdoAbortError(AbortCode.COMMAND_UNKNOWN)
        whole = bytes(data[: len(data) - (request[0] >> 2 & 7)])
        if with_crc and crc_hqx(whole, 0) != int.from_bytes(request[1:3], "little"):
            raise SdoAbortError(AbortCode.CRC_WRONG)
        if announced not in (None, len(whole)):
            raise SdoAbortError(AbortCode.LENGTH_MISMATCH)
        self._dictionary.write(address, whole)
        return [bytes((0xA0 | _END,)) + bytes(7)]


def _upload(request: bytes, data: bytes) -> _Steps:
    """Send an entry's bytes in segments."""
    answer, toggle = _answer(0x40 | SIZE_INDICATED, request, len(data).to_bytes(4, "little")), 0
    while True:
        request = yield [answer]
        _expect(request, _UPLOAD_SEGMENT, toggle)
        part, data = data[:SEGMENT_BYTES], data[SEGMENT_BYTES:]
        command = toggle | (SEGMENT_BYTES - len(part)) << 1 | (0 if data else _LAST_SEGMENT)
        answer = bytes((command,)) + part.ljust(SEGMENT_BYTES, b"\0")
        toggle ^= _TOGGLE
        if not data:
            return [answer]


def _block_upload(request: bytes, data: bytes) -> _Steps:
    """Send an entry's bytes in blocks. The client may end the transfer at any time.

    The server ignores the client's offer to use a segmented transfer for short values. It confirms a CRC only if the
    client requested one, because some clients take the answer as an agreement.
    """
    with_crc, block_size = request[0] & _CRC, _block_size(request[4])
    crc = crc_hqx(data, 0) if with_crc else 0
    answer = [_answer(0xC0 | with_crc | _BLOCK_SIZE_INDICATED, request, len(data).to_bytes(4, "little"))]
    expected, taken = _START, 0
    while True:
        request = yield answer
        command = request[0] & 3
        if request[0] >> 5 == _BLOCK_UPLOAD and command == _END:
            return []
        if request[0] >> 5 != _BLOCK_UPLOAD or command != expected:
            raise SdoAbortError(AbortCode.COMMAND_UNKNOWN)
        if command == _ACKNOWLEDGE:
            if request[1] > len(answer):
                raise SdoAbortError(AbortCode.SEQUENCE_INVALID)
            block_size, taken = _block_size(request[2]), request[1] * SEGMENT_BYTES
        if taken and taken >= len(data):
            answer, expected = [bytes((0xC1 | taken - len(data) << 2,)) + crc.to_bytes(2, "little") + bytes(5)], _END
        else:
            data, expected = data[taken:], _ACKNOWLEDGE
            answer = _block(data, block_size)


def _block(data: bytes, block_size: int) -> list[bytes]:
    """Return the segments of the next block; the last segment of the transfer is marked."""
    parts = [data[i : i + SEGMENT_BYTES] for i in range(0, len(data), SEGMENT_BYTES)] or [b""]
    last = len(parts) if len(parts) <= block_size else 0
    return [
        bytes((number | (_LAST_OF_ALL if number == last else 0),)) + part.ljust(SEGMENT_BYTES, b"\0")
        for number, part in enumerate(parts[:block_size], start=1)
    ]


def _block_size(size: int) -> int:
    if not 1 <= size <= BLOCK_SIZE_MAX:
        raise SdoAbortError(AbortCode.BLOCK_SIZE_INVALID)
    return size


def _answer(command: int, request: bytes, data: bytes = b"") -> bytes:
    """Return the answer to a request: command, object, data."""
    return bytes((command,)) + request[OBJECT] + data.ljust(4, b"\0")


def _announced(request: bytes, indicated: int, limit: int) -> int | None:
    """Return the number of bytes that the client announces; None if it announces none."""
    if not request[0] & indicated:
        return None
    announced = int.from_bytes(request[4:8], "little")
    if announced > limit:
        raise SdoAbortError(AbortCode.LENGTH_TOO_HIGH)
    return announced


def _expect(request: bytes, command: int, toggle: int) -> None:
    """Refuse a request that is not the next segment."""
    if request[0] >> 5 != command:
        raise SdoAbortError(AbortCode.COMMAND_UNKNOWN)
    if request[0] & _TOGGLE != toggle:
        raise SdoAbortError(AbortCode.TOGGLE_NOT_ALTERNATED)
