"""Ask a node that other programs ask at the same time, as `status` does beside a running `run`.

CiA 301 intends an SDO channel for one client. With several clients, each sees the answers to all of them. An answer
that begins a transfer, or refuses one, carries the object that was asked for (section 7.2.4.3); by it a client can tell
its own answers. What a node may not answer is dropped and counted: frames that have not 8 bytes, strings without end.
"""

from contextlib import suppress
from math import ceil
from typing import Final

from canopen import RemoteNode
from canopen.objectdictionary import ObjectDictionary
from canopen.sdo.client import SdoClient
from canopen.sdo.constants import (
    ABORT_INVALID_COMMAND_SPECIFIER,
    EXPEDITED,
    REQUEST_DOWNLOAD,
    RESPONSE_DOWNLOAD,
    SDO_STRUCT,
    SIZE_SPECIFIED,
)
from canopen.sdo.exceptions import SdoAbortedError, SdoCommunicationError, SdoError

_COMMAND_MASK: Final = 0xE0
_INITIATE: Final = (0x20, 0x40)
"""Client command specifiers that carry an object: initiate download, initiate upload."""
_NEXT_SEGMENT: Final = 0x60
"""Client command specifier that asks for a segment."""
_OBJECT: Final = slice(1, 4)
_ANSWER_BYTES: Final = 8
_EXPEDITED_BYTES_MAX: Final = 4
"""Length of the longest value that fits the request itself (CiA 301, 7.2.4.3.3)."""
SEGMENTS_MAX: Final = 64
"""Greatest number of segments of an answer, 448 bytes: the longest string of these nodes has 40."""
_PATIENCE_S: Final = 0.8
"""Time limit for an answer: nodes answer within milliseconds, but the clock of a served board may stand meanwhile."""
_IMPATIENCE_S: Final = 0.05
_SLICE_S: Final = 0.05
"""Length of the pieces in which a client waits: when its own program is held up, only one piece of the limit passes."""


class Patience:
    """How long the nodes of a machine are waited for: not long after one was silent, until one answers again.

    So whatever is asked of all nodes in turn, as at an emergency stop, ends soon when the bus or the server is silent;
    each node is asked nevertheless.
    """

    def __init__(self) -> None:
        self.timeout_s = _PATIENCE_S

    def learn(self, *, answered: bool) -> None:
        """Take note whether a node has answered."""
        self.timeout_s = _PATIENCE_S if answered else _IMPATIENCE_S


class SharedSdoClient(SdoClient):
    """An SDO client that drops answers about other objects; segments carry no object and can still be mixed up."""

    patience: Patience
    """Shared by the nodes of a machine; set by the node."""
    malformed = 0
    """Number of answers that were dropped because they have not 8 bytes (CiA 301, 7.2.4.3)."""
    _awaited: bytes | None = None
    _segments = 0

    def download(self, index: int, subindex: int, data: bytes, force_segment: bool = False) -> None:
        """Write an object. What fits one request is sent without the library's stream, which costs most of a set-up.

        Raises:
            SdoAbortedError: the node refuses.
            SdoCommunicationError: no answer comes, or one that does not fit.
        """
        unused = _EXPEDITED_BYTES_MAX - len(data)
        if force_segment or not 0 <= unused < _EXPEDITED_BYTES_MAX:
            super().download(index, subindex, data, force_segment)
            return
        command = REQUEST_DOWNLOAD | EXPEDITED | SIZE_SPECIFIED | unused << 2
        request = SDO_STRUCT.pack(command, index, subindex) + data.ljust(_EXPEDITED_BYTES_MAX, b"\0")
        answer = self.request_response(request)[0]  # type: ignore[no-untyped-call]
        if answer & _COMMAND_MASK != RESPONSE_DOWNLOAD:
            self.abort(ABORT_INVALID_COMMAND_SPECIFIER)  # type: ignore[no-untyped-call]
            raise SdoCommunicationError(f"Unexpected response 0x{answer:02X}")

    def send_request(self, request: bytearray) -> None:
        """Send a request and remember the object it asks for; raise SdoCommunicationError at an endless answer."""
        command = request[0] & _COMMAND_MASK
        self._awaited = bytes(request[_OBJECT]) if command in _INITIATE else None
        self._segments = self._segments + 1 if command == _NEXT_SEGMENT else 0
        if self._segments > SEGMENTS_MAX:
            raise SdoCommunicationError(f"an answer of more than {SEGMENTS_MAX} segments")
        super().send_request(request)  # type: ignore[no-untyped-call]

    def read_response(self) -> bytes:
        """Wait for the answer; raise SdoCommunicationError if none comes, SdoAbortedError if the node refuses."""
        try:
            response = self._await_response()
        except SdoError as error:
            self.patience.learn(answered=isinstance(error, SdoAbortedError))
            raise
        self.patience.learn(answered=True)
        return response

    def _await_response(self) -> bytes:
        self.RESPONSE_TIMEOUT = min(_SLICE_S, self.patience.timeout_s)
        response: bytes
        for _ in range(ceil(self.patience.timeout_s / self.RESPONSE_TIMEOUT) - 1):
            with suppress(SdoCommunicationError):
                response = super().read_response()  # type: ignore[no-untyped-call]
                return response
        response = super().read_response()  # type: ignore[no-untyped-call]
        return response

    def on_response(self, can_id: int, data: bytearray, timestamp: float) -> None:
        """Take an answer, unless it is to another program."""
        if len(data) != _ANSWER_BYTES:
            self.malformed += 1
        elif self._awaited is None or bytes(data[_OBJECT]) == self._awaited:
            super().on_response(can_id, data, timestamp)  # type: ignore[no-untyped-call]


class SharedNode(RemoteNode):
    """A remote node whose SDO clients are SharedSdoClients."""

    def __init__(self, node_id: int, dictionary: ObjectDictionary, patience: Patience) -> None:
        self._patience = patience
        super().__init__(node_id, dictionary)

    def add_sdo(self, rx_cobid: int, tx_cobid: int) -> SharedSdoClient:
        """Add an SDO channel, in the same way as the library adds a node's default one."""
        client = SharedSdoClient(rx_cobid, tx_cobid, self.object_dictionary)  # type: ignore[no-untyped-call]
        client.patience = self._patience
        self.sdo_channels.append(client)
        if self.has_network():
            self.network.subscribe(client.tx_cobid, client.on_response)
        return client
