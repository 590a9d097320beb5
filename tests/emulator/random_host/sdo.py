"""SDO requests as bytes (CiA 301, section 7.2.4.3)."""

import struct

from steptwin.protocol.objects import ENTRIES
from steptwin.protocol.od import index_and_subindex


def download(address: int, value: int) -> bytes:
    """Return the request that writes an entry in an expedited transfer, with the entry's size."""
    size = ENTRIES[address].data_type.size
    data = value.to_bytes(size, "little", signed=value < 0)
    return request(0x23 | (4 - size) << 2, address, data.ljust(4, b"\0"))


def request(command: int, address: int, data: bytes) -> bytes:
    """Return the eight bytes of a request."""
    return struct.pack("<BHB", command, *index_and_subindex(address)) + data
