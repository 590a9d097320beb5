"""The canopen library's own CiA 402 nodes: masters that share no code with the client."""

import io
from functools import cache

import canopen
from canopen.profiles.p402 import BaseNode402
from canopen.sdo.base import SdoVariable

from steptwin.protocol import od
from steptwin.protocol.exports import render_eds


class Node402(BaseNode402):
    """The library's node, with a typed id and with access to entries by their names in `od`."""

    id: int

    def read(self, address: int) -> int:
        """Read a numeric entry by SDO."""
        return int(self._entry(address).raw)

    def write(self, address: int, value: int) -> None:
        """Write a numeric entry by SDO."""
        self._entry(address).raw = value

    def status(self) -> int:
        """Return the statusword of the next TPDO1; `statusword` is the last one's."""
        return int(self.check_statusword())  # type: ignore[no-untyped-call]

    def _entry(self, address: int) -> SdoVariable:
        index, subindex = od.index_and_subindex(address)
        found = self.sdo[index]
        return found if isinstance(found, SdoVariable) else found[subindex]


class _Sheet(io.StringIO):
    """The EDS as a file, whose name tells the library its form."""

    name = "axis.eds"


@cache
def dictionary(node_id: int) -> canopen.ObjectDictionary:
    """Read a node's object dictionary from the EDS; the library's nodes leave it as it is."""
    return canopen.import_od(_Sheet(render_eds()), node_id)


def node402(network: canopen.Network, node_id: int) -> Node402:
    """Add a node whose object dictionary is read from the EDS."""
    node = Node402(node_id, dictionary(node_id))  # type: ignore[no-untyped-call]
    network.add_node(node)
    return node


def set_up(node: Node402) -> None:
    """Set up the library's state machine with the PDOs that the node has after power-up."""
    node.nmt.state = "PRE-OPERATIONAL"
    node.setup_402_state_machine()  # type: ignore[no-untyped-call]


def enable(node: Node402) -> None:
    """Lead the drive to OPERATION ENABLED, state by state."""
    for state in ("READY TO SWITCH ON", "SWITCHED ON", "OPERATION ENABLED"):
        node.state = state
