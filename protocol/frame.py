"""A CAN data frame and the identifiers of CANopen's predefined connection set (CiA 301, section 7.3.5)."""

from typing import Final, NamedTuple


class Frame(NamedTuple):
    """One classical CAN data frame with an 11-bit identifier and 0 to 8 bytes."""

    cob_id: int
    data: bytes


BITRATES: Final = (125_000, 250_000, 500_000, 1_000_000)
"""The bit rates, in bit/s, that the board's CAN controller is set up for."""
DEFAULT_BITRATE: Final = BITRATES[-1]
"""Bit rate of a robot whose file names none: the fastest of classical CAN. [A]"""

COB_NMT: Final = 0x000
COB_SYNC: Final = 0x080
COB_EMCY: Final = 0x080
"""The node id is added to this and to all below; 080h itself is SYNC."""
COB_TPDO: Final = (0x180, 0x280, 0x380, 0x480)
COB_RPDO: Final = (0x200, 0x300, 0x400, 0x500)
COB_SDO_RESPONSE: Final = 0x580
COB_SDO_REQUEST: Final = 0x600
COB_HEARTBEAT: Final = 0x700
FROM_NODE: Final = (COB_EMCY, *COB_TPDO, COB_SDO_RESPONSE, COB_HEARTBEAT)
"""The services of a node that sends."""
TO_NODE: Final = (*COB_RPDO, COB_SDO_REQUEST)
"""The services of a host that addresses a node."""

FIRST_NODE_ID: Final = 0x10
"""Node id of a board's first axis by default; the other axes count on from it."""
NODE_ID_MAX: Final = 0x7F

HOST_NODE_ID: Final = 0x7F
"""Node id of the host's heartbeat: the last one, which no axis has."""

COB_ID_INVALID: Final = 1 << 31
"""Set in a PDO's or EMCY's COB-ID entry: the object does not exist."""
COB_ID_NO_RTR: Final = 1 << 30
"""Set in a TPDO's COB-ID entry: it cannot be requested by a remote frame."""
COB_ID_MASK: Final = 0x7FF
