"""SDO requests and responses of one frame (CiA 301, section 7.2.4.3), and the codes with which a transfer is aborted.

A request names an object; a value of up to four bytes goes in the same frame, as an expedited transfer. Longer values
are the matter of the server, sdo_server.py, and of the client's library. The abort codes are those of CiA 301 table 22.
"""

from enum import IntEnum
from typing import Final, NamedTuple

from steptwin.protocol.od import address_of, index_and_subindex


class AbortCode(IntEnum):
    """Reason why an SDO transfer is aborted."""

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
    """Refusal of an access to the object dictionary: SDO answers with the code, a PDO drops the value."""

    def __init__(self, code: AbortCode) -> None:
        super().__init__(f"{code.name} (0x{code:08X})")
        self.code = code


SDO_BYTES: Final = 8
OBJECT: Final = slice(1, 4)
"""The bytes of a frame that name its object, in requests that begin a transfer and in their answers."""
EXPEDITED: Final = 0x02
SIZE_INDICATED: Final = 0x01
SPECIFIER: Final = 0xE0
"""Bits of the first byte that hold the command specifier."""
DOWNLOAD: Final = 0x20
"""Client's specifier: write."""
UPLOAD: Final = 0x40
"""Client's specifier: read. The server's answer with the value has the same."""
ABORT: Final = 0x80
"""Either side's specifier: the transfer ends, for the reason in the last four bytes."""
EXPEDITED_BYTES_MAX: Final = 4
"""Length of the longest value that goes in the frame itself."""


class ObjectValue(NamedTuple):
    """An object and the bytes of its value, from one frame."""

    address: int
    data: bytes


def object_bytes(address: int) -> bytes:
    """Return an object as frames name it: the index, low byte first, and the sub-index."""
    index, subindex = index_and_subindex(address)
    return index.to_bytes(2, "little") + bytes((subindex,))


def named_address(frame: bytes) -> int:
    """Return the address of the object that a frame names; the frame has at least four bytes."""
    return address_of(int.from_bytes(frame[1:3], "little"), frame[3])


def upload_request(address: int) -> bytes:
    """Return the request that asks for an object's value."""
    return bytes((UPLOAD,)) + object_bytes(address) + bytes(EXPEDITED_BYTES_MAX)


def download_request(address: int, data: bytes) -> bytes:
    """Return the request that writes an object of one to four bytes.

    Raises:
        ValueError: the data are empty, or do not fit one frame.
    """
    unused = EXPEDITED_BYTES_MAX - len(data)
    if not 0 <= unused < EXPEDITED_BYTES_MAX:
        raise ValueError(f"{len(data)} bytes do not fit a request: 1 to {EXPEDITED_BYTES_MAX} do")
    command = DOWNLOAD | EXPEDITED | SIZE_INDICATED | unused << 2
    return bytes((command,)) + object_bytes(address) + data.ljust(EXPEDITED_BYTES_MAX, b"\0")


def expedited_value(frame: bytes, specifier: int) -> ObjectValue | None:
    """Return the object and the value in a frame; None if the frame is another, or has no value in it.

    Args:
        frame: a client's request or a server's response.
        specifier: DOWNLOAD for a request that writes, UPLOAD for a response with a value.
    """
    if len(frame) != SDO_BYTES or frame[0] & (SPECIFIER | EXPEDITED) != specifier | EXPEDITED:
        return None
    return ObjectValue(named_address(frame), value_bytes(frame))


def value_bytes(frame: bytes) -> bytes:
    """Return the value in an expedited frame: all four bytes where the frame does not say how many count."""
    unused = frame[0] >> 2 & 3 if frame[0] & SIZE_INDICATED else 0
    return frame[SDO_BYTES - EXPEDITED_BYTES_MAX : SDO_BYTES - unused]
