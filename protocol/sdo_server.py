"""The device's SDO server: expedited and segmented transfers (CiA 301, section 7.2.4.3), bytes in, bytes out."""

from dataclasses import dataclass

from protocol.abort import AbortCode, SdoAbortError
from protocol.dictionary import ObjectDictionary

# Client command specifiers, bits 7..5 of the first byte.
_DOWNLOAD_SEGMENT = 0
_DOWNLOAD_INITIATE = 1
_UPLOAD_INITIATE = 2
_UPLOAD_SEGMENT = 3
_ABORT = 4

_EXPEDITED = 0x02
_SIZE_INDICATED = 0x01
_TOGGLE = 0x10
_LAST_SEGMENT = 0x01
_SEGMENT_BYTES = 7


@dataclass(slots=True)
class _Transfer:
    """A segmented transfer under way: what is still to send, or what has arrived."""

    index: int
    subindex: int
    upload: bool
    data: bytes
    limit: int = 0
    """Bytes that a download may have in all."""
    toggle: int = 0


class SdoServer:
    """One server on one object dictionary; a new initiate replaces a transfer that was left unfinished."""

    def __init__(self, dictionary: ObjectDictionary) -> None:
        self._dictionary = dictionary
        self._transfer: _Transfer | None = None
        self.dropped = 0
        """Requests that were no SDO at all (not 8 bytes) and got no answer."""

    def reset(self) -> None:
        """Forget a transfer under way, as a communication reset does."""
        self._transfer = None

    def handle(self, request: bytes) -> bytes | None:
        """Answer one request; None where the standard prescribes silence."""
        if len(request) != 8:
            self.dropped += 1
            return None
        command = request[0] >> 5
        if command == _ABORT:
            self._transfer = None
            return None
        index, subindex = int.from_bytes(request[1:3], "little"), request[3]
        if command in (_DOWNLOAD_SEGMENT, _UPLOAD_SEGMENT) and self._transfer:
            index, subindex = self._transfer.index, self._transfer.subindex
        try:
            return self._answer(command, request, index, subindex)
        except SdoAbortError as error:
            self._transfer = None
            head = bytes((0x80, index & 0xFF, index >> 8, subindex))
            return head + error.code.to_bytes(4, "little")

    def _answer(self, command: int, request: bytes, index: int, subindex: int) -> bytes:
        if command == _DOWNLOAD_INITIATE:
            return self._download_initiate(request, index, subindex)
        if command == _UPLOAD_INITIATE:
            return self._upload_initiate(index, subindex)
        if command == _DOWNLOAD_SEGMENT:
            return self._download_segment(request)
        if command == _UPLOAD_SEGMENT:
            return self._upload_segment(request)
        raise SdoAbortError(AbortCode.COMMAND_UNKNOWN)

    def _download_initiate(self, request: bytes, index: int, subindex: int) -> bytes:
        command = request[0]
        if command & _EXPEDITED:
            size = 4 - (command >> 2 & 3) if command & _SIZE_INDICATED else self._entry_size(index, subindex)
            self._transfer = None
            self._dictionary.write(index, subindex, request[4 : 4 + size])
        else:
            limit = self._entry_size(index, subindex)
            if command & _SIZE_INDICATED and int.from_bytes(request[4:8], "little") > limit:
                raise SdoAbortError(AbortCode.LENGTH_TOO_HIGH)
            self._transfer = _Transfer(index, subindex, upload=False, data=b"", limit=limit)
        return bytes((0x60,)) + request[1:4] + bytes(4)

    def _entry_size(self, index: int, subindex: int) -> int:
        """How many bytes the entry takes; 4 for what does not exist, so that the write itself says why."""
        entry = self._dictionary.entries.get(index << 8 | subindex)
        return entry.data_type.size if entry else 4

    def _download_segment(self, request: bytes) -> bytes:
        transfer = self._checked(request, upload=False)
        length = _SEGMENT_BYTES - (request[0] >> 1 & 7)
        transfer.data += request[1 : 1 + length]
        if len(transfer.data) > transfer.limit:
            raise SdoAbortError(AbortCode.LENGTH_TOO_HIGH)
        if request[0] & _LAST_SEGMENT:
            self._transfer = None
            self._dictionary.write(transfer.index, transfer.subindex, transfer.data)
        answer = 0x20 | transfer.toggle
        transfer.toggle ^= _TOGGLE
        return bytes((answer,)) + bytes(7)

    def _upload_initiate(self, index: int, subindex: int) -> bytes:
        data = self._dictionary.read(index, subindex)
        head = index.to_bytes(2, "little") + bytes((subindex,))
        if 0 < len(data) <= 4:
            self._transfer = None
            command = 0x40 | (4 - len(data)) << 2 | _EXPEDITED | _SIZE_INDICATED
            return bytes((command,)) + head + data.ljust(4, b"\0")
        self._transfer = _Transfer(index, subindex, upload=True, data=data)
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

    def _checked(self, request: bytes, *, upload: bool) -> _Transfer:
        transfer = self._transfer
        if transfer is None or transfer.upload is not upload:
            raise SdoAbortError(AbortCode.COMMAND_UNKNOWN)
        if request[0] & _TOGGLE != transfer.toggle:
            raise SdoAbortError(AbortCode.TOGGLE_NOT_ALTERNATED)
        return transfer
