"""A node that other programs may ask, too, while this one does: `status` beside a running `run`.

CiA 301 means an SDO channel for one client. Each program that listens on it sees the answers to all of them, but those
that begin a transfer, refusals included, carry the object that was asked for (section 7.2.4.3).
"""

from typing import Final

from canopen import RemoteNode
from canopen.sdo.client import SdoClient

_COMMAND_MASK: Final = 0xE0
_INITIATE: Final = (0x20, 0x40)
"""Client command specifiers that carry an object: initiate download, initiate upload."""
_OBJECT: Final = slice(1, 4)


class SharedSdoClient(SdoClient):
    """Takes no answer about another object than it has asked for. Segments carry none: these can still be mixed up."""

    _awaited: bytes | None = None

    def send_request(self, request: bytearray) -> None:
        """Send a request and remember what it is about."""
        initiates = request[0] & _COMMAND_MASK in _INITIATE
        self._awaited = bytes(request[_OBJECT]) if initiates else None
        super().send_request(request)  # type: ignore[no-untyped-call]

    def on_response(self, can_id: int, data: bytearray, timestamp: float) -> None:
        """Take an answer, unless it is another program's."""
        if self._awaited is None or bytes(data[_OBJECT]) == self._awaited:
            super().on_response(can_id, data, timestamp)  # type: ignore[no-untyped-call]


class SharedNode(RemoteNode):
    """A remote node with such clients."""

    def add_sdo(self, rx_cobid: int, tx_cobid: int) -> SharedSdoClient:
        """Add an SDO channel, as the library does it for a node's own."""
        client = SharedSdoClient(rx_cobid, tx_cobid, self.object_dictionary)  # type: ignore[no-untyped-call]
        self.sdo_channels.append(client)
        if self.has_network():
            self.network.subscribe(client.tx_cobid, client.on_response)
        return client
