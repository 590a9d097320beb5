"""Serve SDO requests: expedited, segmented and block transfers (CiA 301, section 7.2.4.3), bytes in, bytes out."""

from dataclasses import dataclass
from typing import Final

from steptwin.protocol.abort import AbortCode, SdoAbortError
from steptwin.protocol.dictionary import ObjectDictionary
from steptwin.protocol.od import address_of
from steptwin.protocol.sdo_block import DOWNLOAD_BLOCK_SIZE, BlockDownload, BlockUpload, is_segment

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
        if in_block or not _initiates(request[0]):
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
            if command & _SIZE_INDICATED and int.from_bytes(request[4:8], "little") > limit:
                raise SdoAbortError(AbortCode.LENGTH_TOO_HIGH)
            self._transfer = _Segmented(index, subindex, upload=False, data=b"", limit=limit)
        return bytes((0x60,)) + request[1:4] + bytes(4)

    def _download_segment(self, request: bytes) -> bytes:
        transfer = self._checked(request, upload=False)
        length = _SEGMENT_BYTES - (request[0] >> 1 & 7)
        transfer.data += request[1 : 1 + length]
        if len(transfer.data) > transfer.limit:
            raise SdoAbortError(AbortCode.LENGTH_TOO_HIGH)
        if request[0] & _LAST_SEGMENT:
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


def _initiates(first_byte: int) -> bool:
    """Return True if a request begins a transfer, and so names an object."""
    command = first_byte >> 5
    if command == _BLOCK_DOWNLOAD:
        return not first_byte & _BLOCK_DOWNLOAD_END
    if command == _BLOCK_UPLOAD:
        return first_byte & _BLOCK_UPLOAD_COMMAND == _INITIATE
    return command in (_DOWNLOAD_INITIATE, _UPLOAD_INITIATE)
