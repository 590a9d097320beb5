"""Layer setting services (CiA 305): frames with which a master finds nodes and assigns their node ids.

A master sends requests on 7E5h to all nodes of the bus; a node answers on 7E4h. Both frames have eight bytes: the
command, its data in little-endian order, then zeros.
"""

import struct
from enum import IntEnum
from typing import Final, NamedTuple

COB_LSS_RESPONSE: Final = 0x7E4
COB_LSS_REQUEST: Final = 0x7E5
UNCONFIGURED: Final = 0xFF
"""Node id of a node that has none yet; it only uses LSS."""
LSS_BYTES: Final = 8
FAST_SCAN_START: Final = 0x80
"""Bit number that starts a fast scan: every node without a node id answers."""
BIT_TIMINGS: Final = {0: 1_000_000, 2: 500_000, 3: 250_000, 4: 125_000}
"""Bit rates of a board, in bit/s, by their index in the bit timing table of CiA 305 (table 0)."""


class LssCommand(IntEnum):
    """Command specifiers, the first byte of a frame."""

    SWITCH_GLOBAL = 0x04
    CONFIGURE_NODE_ID = 0x11
    CONFIGURE_BIT_TIMING = 0x13
    ACTIVATE_BIT_TIMING = 0x15
    STORE = 0x17
    SELECT_VENDOR = 0x40
    SELECT_PRODUCT = 0x41
    SELECT_REVISION = 0x42
    SELECT_SERIAL = 0x43
    SELECTED = 0x44
    """Answer of the node that all four SELECT commands have selected."""
    IDENTIFY_VENDOR = 0x46
    IDENTIFY_PRODUCT = 0x47
    IDENTIFY_REVISION_LOW = 0x48
    IDENTIFY_REVISION_HIGH = 0x49
    IDENTIFY_SERIAL_LOW = 0x4A
    IDENTIFY_SERIAL_HIGH = 0x4B
    IDENTIFY_UNCONFIGURED = 0x4C
    IDENTIFIED = 0x4F
    """Answer of a node within the identified ranges, or of a node that a fast scan has not excluded."""
    UNCONFIGURED_IDENTIFIED = 0x50
    FAST_SCAN = 0x51
    INQUIRE_VENDOR = 0x5A
    INQUIRE_PRODUCT = 0x5B
    INQUIRE_REVISION = 0x5C
    INQUIRE_SERIAL = 0x5D
    INQUIRE_NODE_ID = 0x5E


class ConfigureError(IntEnum):
    """Error codes of "configure node-id", "configure bit timing" and "store"."""

    NONE = 0
    REFUSED = 1
    """The node id is out of range, or the bit timing is not supported."""
    STORAGE = 2
    """Of "store": the memory has failed."""


class LssRequest(NamedTuple):
    """A request: its command, the number after it (as a byte and as 32 bits), and the last bytes of a fast scan."""

    command: LssCommand
    byte: int
    number: int
    bit: int
    part: int
    next_part: int

    @property
    def word(self) -> int:
        """The first two bytes after the command."""
        return self.number & 0xFFFF

    @property
    def second_byte(self) -> int:
        """The byte after `byte`."""
        return self.word >> 8


def decode_request(data: bytes) -> LssRequest | None:
    """Decode a request; return None if the frame's length is wrong or its command unknown."""
    if len(data) != LSS_BYTES or data[0] not in _COMMANDS:
        return None
    command, number, bit, part, next_part = struct.unpack("<BIBBB", data)
    return LssRequest(LssCommand(command), data[1], number, bit, part, next_part)


def encode_answer(command: LssCommand, data: bytes = b"") -> bytes:
    """Encode an answer of eight bytes."""
    return (bytes((command,)) + data).ljust(LSS_BYTES, b"\0")


_COMMANDS: Final = frozenset(LssCommand)
