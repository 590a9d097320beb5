"""Make simple nodes from the device descriptions (EDS, CiA 306) of further nodes on the bus."""

from collections.abc import Mapping
from pathlib import Path
from typing import Final

from steptwin.features.nodes.eds_file import read_sections
from steptwin.features.nodes.eds_objects import entries_of
from steptwin.features.nodes.node_objects import PDO_BITS_MAX, RPDOS, TPDOS, NodeDescription, NodeObjects
from steptwin.features.nodes.simple_node import SimpleNode
from steptwin.host.common.bad_input import prefixed
from steptwin.host.common.errors import InputError
from steptwin.host.common.own_files import read_old_text
from steptwin.protocol import od
from steptwin.protocol.frame import FIRST_NODE_ID, HOST_NODE_ID, NODE_ID_MAX

EDS_BYTES_MAX: Final = 4 << 20
"""Largest EDS that is read; those of large drives have some 500 kB."""


def eds_nodes(files: Mapping[int, Path | str], axes: int) -> dict[int, SimpleNode]:
    """Return a node for each id and EDS, for a machine with `axes` axes.

    Raises:
        InputError: an id is taken or invalid, or a file is unreadable, not an EDS, or contradicts itself.
    """
    return {node_id: SimpleNode(read_node(node_id, path, axes)) for node_id, path in files.items()}


def read_node(node_id: int, path: Path | str, axes: int) -> NodeDescription:
    """Return the description of a node from its EDS; raises as `eds_nodes`."""
    given = f"nodes=0x{node_id:02X}={path}: " if node_id >= 0 else f"nodes={node_id}={path}: "
    with prefixed(given):
        _check_id(node_id, axes)
        sections = read_sections(read_old_text(str(path), EDS_BYTES_MAX))
        if "deviceinfo" not in sections:
            raise InputError("has no section [DeviceInfo], so it is no EDS")
        entries = entries_of(sections, node_id)
        if not entries:
            raise InputError("has no objects, so it is no EDS")
        description = NodeDescription(node_id, str(path), entries)
        _check_pdos(NodeObjects(description))
        return description


def _check_id(node_id: int, axes: int) -> None:
    last = FIRST_NODE_ID + axes - 1
    if not 1 <= node_id <= NODE_ID_MAX:
        raise InputError(f"a node id is from 1 to {NODE_ID_MAX}, such as 0x{last + 1:02X}")
    if FIRST_NODE_ID <= node_id <= last:
        raise InputError(f"0x{FIRST_NODE_ID:02X} to 0x{last:02X} are the axes' ids; try 0x{last + 1:02X}")
    if node_id == HOST_NODE_ID:
        raise InputError(f"0x{HOST_NODE_ID:02X} is the id of the host's heartbeat; try 0x{HOST_NODE_ID - 1:02X}")


def _check_pdos(objects: NodeObjects) -> None:
    """Raise InputError for a PDO with a mapping that it cannot carry after power-up."""
    for communications, received in ((RPDOS, True), (TPDOS, False)):
        for _, mapping in objects.pdos(communications):
            bits = 0
            for subindex in range(1, objects.get(od.address_of(mapping)) + 1):
                place = od.address_of(mapping, subindex)
                word = objects.get(place)
                bits += word & 0xFF
                if objects.why_not_mapped(word, received=received) is not None:
                    what = f"{od.place_text(word >> 8)} with {word & 0xFF} bits"
                    raise InputError(f"{od.place_text(place)} maps {what}, which such a PDO cannot carry")
            if bits > PDO_BITS_MAX:
                raise InputError(f"0x{mapping:04X} maps {bits} bits, more than {PDO_BITS_MAX}")
