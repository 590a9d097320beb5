"""Make the SDO requests of benchmarks that have no CANopen master."""

import struct

from steptwin.protocol import od
from steptwin.protocol.frame import COB_SDO_REQUEST, FIRST_NODE_ID, Frame

_WRITE = 0x22
"""Expedited download without a size: the node takes as many bytes as the entry has."""


def sdo_write(axis: int, address: int, value: int) -> Frame:
    """Request that an axis writes `value` to an entry."""
    data = struct.pack("<BHBi", _WRITE, *od.index_and_subindex(address), value)
    return Frame(COB_SDO_REQUEST + FIRST_NODE_ID + axis, data)
