"""Single-frame SDO requests and responses (CiA 301, section 7.2.4.3), and the SDO abort codes (table 22).

A request names an object. A value of up to four bytes is in the same frame (expedited transfer). Longer values are
transferred by the server, sdo_server.py, and by the client's library.
"""

from enum import IntEnum
from typing import Final, NamedTuple

from steptwin.protocol.od import address_of, index_and_subindex


class AbortCode(IntEnum):
    """Reason of an SDO abort."""

    TOGGLE_NOT_ALTERNATED = 0x0503_0000
    COMMAND_UNKNOWN = 0x0504_0001
    BLOCK_SIZE_INVALID = 0x0504_0002
    SEQUENCE_INVALID = 0x0504_0003
    CRC_WRONG = 0x0504_0004
    WRITE_ONLY = 0x0601_0001
    READ_ONLY = 0x0601_0002
    NO_OBJECT = 0x0602_0000
    CANNOT_BE_MAPPED = 0x0604_0041
    PDO_TOO_LONG = 0x0604_0042
    INCOMPATIBLE = 0x0604_0043
    LENGTH_MISMATCH = 0x0607_0010
    LENGTH_TOO_HIGH = 0x0607_0012
    LENGTH_TOO_LOW = 0x0607_0013
    NO_SUBINDEX = 0x0609_0011
    VALUE_RANGE = 0x0609_0030
    VALUE_TOO_HIGH = 0x0609_0031
    VALUE_TOO_LOW = 0x0609_0032
    MAX_BELOW_MIN = 0x0609_0036
    NOT_STORED = 0x0800_0020
    DEVICE_STATE = 0x0800_0022
    NO_DATA = 0x0800_0024


class SdoAbortError(Exception):
    """Refusal of an access to the object dictionary. SDO answers with the code; a PDO drops the value."""

    def __init__(self, code: AbortCode) -> None:
        super().__init__(f"{code.name} (0x{code:08X})")
        self.code = code


SDO_BYTES: Final = 8
OBJECT: Final = slice(1, 4)
"""Bytes of the object's index and sub-index, in the first request of a transfer and its answer."""
EXPEDITED: Final = 0x02
SIZE_INDICATED: Final = 0x01
SPECIFIER: Final = 0xE0
"""Bits of the first byte that hold the command specifier."""
DOWNLOAD: Final = 0x20
"""Client's specifier: write."""
UPLOAD: Final = 0x40
"""Client's specifier: read. It is also the server's specifier in the answer with the value."""
ABORT: Final = 0x80
"""Specifier of both sides: abort. The last four bytes give the reason."""
EXPEDITED_BYTES_MAX: Final = 4
"""Longest value of an expedited transfer."""


class ObjectValue(NamedTuple):
    """An object's address and the bytes of its value."""

    address: int
    data: bytes


def object_bytes(address: int) -> bytes:
    """Return an object's bytes in a frame: the index, low byte first, and the sub-index."""
    index, subindex = index_and_subindex(address)
    return index.to_bytes(2, "little") + bytes((subindex,))


def named_address(frame: bytes) -> int:
    """Return the address of the object that a frame names; the frame has at least four bytes."""
    return address_of(int.from_bytes(frame[1:3], "little"), frame[3])


def upload_request(address: int) -> bytes:
    """Return the request that reads an object."""
    return bytes((UPLOAD,)) + object_bytes(address) + bytes(EXPEDITED_BYTES_MAX)


def download_request(address: int, data: bytes) -> bytes:
    """Return the request that writes an object of one to four bytes.

    Raises:
        ValueError: the data are empty or do not fit into one frame.
    """
    unused = EXPEDITED_BYTES_MAX - len(data)
    if not 0 <= unused < EXPEDITED_BYTES_MAX:
        raise ValueError(f"{len(data)} bytes do not fit a request: 1 to {EXPEDITED_BYTES_MAX} do")
    command = DOWNLOAD | EXPEDITED | SIZE_INDICATED | unused << 2
    return bytes((command,)) + object_bytes(address) + data.ljust(EXPEDITED_BYTES_MAX, b"\0")


def expedited_value(frame: bytes, specifier: int) -> ObjectValue | None:
    """Return the object and the value of an expedited transfer; None for any other frame.

    Args:
        frame: a client's request or a server's response.
        specifier: DOWNLOAD for a request that writes, UPLOAD for a response with a value.
    """
    if len(frame) != SDO_BYTES or frame[0] & (SPECIFIER | EXPEDITED) != specifier | EXPEDITED:
        return None
    return ObjectValue(named_address(frame), value_bytes(frame))


def value_bytes(frame: bytes) -> bytes:
    """Return the value in an expedited frame; all four bytes if the frame does not give their number."""
    unused = frame[0] >> 2 & 3 if frame[0] & SIZE_INDICATED else 0
    return frame[SDO_BYTES - EXPEDITED_BYTES_MAX : SDO_BYTES - unused]
