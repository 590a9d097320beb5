"""Make the SDO requests of benchmarks that have no CANopen master."""

import struct

from steptwin.protocol import od
from steptwin.protocol.frame import COB_SDO_REQUEST, FIRST_NODE_ID, Frame

_WRITE = 0x22
"""Expedited download without a size: the node takes as many bytes as the entry has."""


def sdo_write(axis: int, address: int, value: int) -> Frame:
    """Return the SDO request that writes `value` to an entry of an axis."""
    data = struct.pack("<BHBi", _WRITE, *od.index_and_subindex(address), value)
    return Frame(COB_SDO_REQUEST + FIRST_NODE_ID + axis, data)
