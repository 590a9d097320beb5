"""A CAN frame and the identifiers of CANopen's predefined connection set (CiA 301, section 7.3.5)."""

from typing import Final, NamedTuple


class Frame(NamedTuple):
    """One classical CAN frame with an 11-bit identifier and 0 to 8 bytes.

    A remote frame has the bit REMOTE in `cob_id`, as in SocketCAN, and no bytes.
    """

    cob_id: int
    data: bytes


BITRATES: Final = (125_000, 250_000, 500_000, 1_000_000)
"""Bit rates, in bit/s, that the board's CAN controller supports."""
DEFAULT_BITRATE: Final = BITRATES[-1]
"""Bit rate of a robot whose file gives none: the highest of classical CAN. [A]"""

REMOTE: Final = 1 << 30
"""Bit of a frame's `cob_id`: a remote frame, which requests the data frame of its identifier."""

COB_NMT: Final = 0x000
COB_SYNC: Final = 0x080
COB_TIME: Final = 0x100
COB_EMCY: Final = 0x080
"""The node id is added to this COB-ID and to those below; 080h itself is SYNC."""
COB_TPDO: Final = (0x180, 0x280, 0x380, 0x480)
COB_RPDO: Final = (0x200, 0x300, 0x400, 0x500)
COB_SDO_RESPONSE: Final = 0x580
COB_SDO_REQUEST: Final = 0x600
COB_HEARTBEAT: Final = 0x700
FROM_NODE: Final = (COB_EMCY, *COB_TPDO, COB_SDO_RESPONSE, COB_HEARTBEAT)
"""COB-IDs, without the node id, of frames that a node sends."""
TO_NODE: Final = (*COB_RPDO, COB_SDO_REQUEST)
"""COB-IDs, without the node id, of frames that a host sends to a node."""

FIRST_NODE_ID: Final = 0x10
"""Default node id of a board's first axis; the other axes have the next ones."""
NODE_ID_MAX: Final = 0x7F

HOST_NODE_ID: Final = 0x7F
"""Node id of the host's heartbeat: the highest one, which no axis uses."""

COB_ID_INVALID: Final = 1 << 31
"""Bit of a PDO's or EMCY's COB-ID entry: the object does not exist."""
COB_ID_NO_RTR: Final = 1 << 30
"""Bit of a TPDO's COB-ID entry: a remote frame cannot request it."""
COB_ID_MASK: Final = 0x7FF
