"""SDO client of a node that other programs access at the same time, as `status` does during `run`.

CiA 301 intends an SDO channel for one client. With several clients, each receives the requests and answers of all.
`OpenRequests` uses them to determine which answers belong to this program. An answer that may be for another program is
an error, and the transfer is repeated. Invalid answers are dropped and counted: frames without 8 bytes, strings without
end.

A server answers in the order of the requests, with one identifier (CiA 301, 7.2.4.3). An answer contains the command
that it answers. The first answer of a transfer and a refusal also contain the object. So two programs can confuse their
answers only if they access the same object at the same time, for example if both write it and one is refused. Requests
are on the bus before their answers, so a program knows how many answers about an object are still expected. It treats
its own answer as doubtful until it is the last one.
"""

import queue
import threading
from collections import Counter
from contextlib import suppress
from enum import Enum, auto
from math import ceil
from typing import Final

from canopen import Network, RemoteNode
from canopen.objectdictionary import ObjectDictionary
from canopen.sdo.client import SdoClient
from canopen.sdo.constants import RESPONSE_ABORTED
from canopen.sdo.exceptions import SdoAbortedError, SdoCommunicationError, SdoError

from steptwin.protocol.od import address_of
from steptwin.protocol.sdo_frames import (
    ABORT,
    DOWNLOAD,
    EXPEDITED,
    EXPEDITED_BYTES_MAX,
    OBJECT,
    SDO_BYTES,
    SPECIFIER,
    UPLOAD,
    download_request,
)
from steptwin.protocol.sdo_server import initiates

_ANSWERS: Final = {DOWNLOAD: 0x60, UPLOAD: UPLOAD, 0x00: 0x20, 0x60: 0x00}
"""Server's command specifier by the client's: initiate download, upload; segments of both."""
_SEGMENTS: Final = (0x00, 0x20)
"""Server's command specifiers of frames without object."""
_NO_OBJECT: Final = bytes(3)
"""Object of a refusal if the server has no transfer in progress."""


class Whose(Enum):
    """Program to which an answer belongs."""

    OWN = auto()
    OTHERS = auto()
    DOUBTFUL = auto()
    """Another program has made the same request at the same time."""


class OpenRequests:
    """Unanswered requests to one server: that of this program, and those of others.

    Frames arrive in a thread of the bus, requests are sent in the program's thread; each method may be called in both.
    """

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._open: Counter[bytes] = Counter()
        self._request = b""
        """Present request of this program; empty if there is none."""
        self._object = b""
        """Object of this program's transfer."""
        self._disturbed = False
        """True if another program has sent a request since this program's transfer began."""

    def ask(self, request: bytes) -> None:
        """Record a request of this program; it replaces the previous one."""
        with self._lock:
            self._request = request if request[0] & SPECIFIER in _ANSWERS else b""
            if self._request and initiates(request[0]):
                self._object, self._disturbed = request[OBJECT], False
                self._open[self._object] += 1

    def overhear(self, request: bytes) -> None:
        """Record a request of another program; an equal request has the same answer."""
        if len(request) != SDO_BYTES:
            return
        with self._lock:
            if request == self._request:
                return
            self._disturbed = True
            if initiates(request[0]):
                self._open[request[OBJECT]] += 1

    def answer(self, answer: bytes) -> Whose:
        """Record an answer and return to whom it belongs."""
        command, about = answer[0] & SPECIFIER, answer[OBJECT]
        with self._lock:
            rivals = self._open[self._object] > 1
            if command not in _SEGMENTS and self._open[about]:
                self._open[about] -= 1
            if not self._fits(command, about):
                return Whose.OTHERS
            first, self._request = initiates(self._request[0]), b""
            if first:
                in_one_frame = command == UPLOAD and answer[0] & EXPEDITED  # every program receives the object's value
                return Whose.DOUBTFUL if rivals and not in_one_frame else Whose.OWN
            uploads = command == _ANSWERS[0x60]
            return Whose.DOUBTFUL if uploads and self._disturbed else Whose.OWN

    def _fits(self, command: int, about: bytes) -> bool:
        if not self._request:
            return False
        if command == ABORT:
            return about == self._object or (about == _NO_OBJECT and not initiates(self._request[0]))
        fits = command == _ANSWERS[self._request[0] & SPECIFIER]
        return fits and (command in _SEGMENTS or about == self._object)

    @property
    def awaited(self) -> bool:
        """True while answers about the object of this program's transfer are still expected."""
        with self._lock:
            return self._open[self._object] > 0

    def forget(self) -> None:
        """Forget all requests, because the server is silent."""
        with self._lock:
            self._request = b""
            self._open.clear()


_NEXT_SEGMENT: Final = 0x60
"""Client's command specifier of a request for a segment."""
SEGMENTS_MAX: Final = 64
"""Highest number of segments of an answer (448 bytes); the longest string of these nodes has 40 bytes."""
_PATIENCE_S: Final = 0.8
"""Time limit for an answer. Nodes answer within milliseconds, but the clock of a served board may pause."""
_IMPATIENCE_S: Final = 0.05
_SLICE_S: Final = 0.05
"""Slice of a client's wait: a delay of its own program uses up only one slice of the time limit."""


class Patience:
    """Time limit for answers of a machine's nodes: short after a node was silent, until one answers.

    So requests to all nodes in turn, as at an emergency stop, end soon on a silent bus; each node is still tried.
    """

    def __init__(self) -> None:
        self.timeout_s: float = _PATIENCE_S

    def learn(self, *, answered: bool) -> None:
        """Record whether a node has answered."""
        self.timeout_s = _PATIENCE_S if answered else _IMPATIENCE_S


class DoubtfulAnswerError(SdoError):
    """An answer may be for another program that accesses the same object at the same time; repeat the request."""


class SharedSdoClient(SdoClient):
    """An SDO client that accepts its own answers only.

    Its methods raise SdoAbortedError if the node refuses, SdoCommunicationError without answer, and
    DoubtfulAnswerError.
    """

    patience: Patience
    """Time limit that all nodes of a machine share; set by the node."""
    malformed: int = 0
    """Number of answers dropped because they did not have 8 bytes (CiA 301, 7.2.4.3)."""
    responses: "queue.Queue[tuple[bytes, Whose]]"
    _segments = 0

    def __init__(self, rx_cobid: int, tx_cobid: int, od: ObjectDictionary) -> None:
        super().__init__(rx_cobid, tx_cobid, od)  # type: ignore[no-untyped-call]
        self._requests = OpenRequests()

    def download(self, index: int, subindex: int, data: bytes, force_segment: bool = False) -> None:
        """Write an object; without the library's slow stream if the value fits into one request."""
        if force_segment or not 1 <= len(data) <= EXPEDITED_BYTES_MAX:
            super().download(index, subindex, data, force_segment)
            return
        request = download_request(address_of(index, subindex), data)
        self.request_response(request)  # type: ignore[no-untyped-call]

    def send_request(self, request: bytearray) -> None:
        """Send a request; raise SdoCommunicationError if an answer has too many segments."""
        command = request[0] & SPECIFIER
        self._segments = self._segments + 1 if command == _NEXT_SEGMENT else 0
        if self._segments > SEGMENTS_MAX:
            raise SdoCommunicationError(f"an answer of more than {SEGMENTS_MAX} segments")
        self._requests.ask(bytes(request))
        super().send_request(request)  # type: ignore[no-untyped-call]

    def read_response(self) -> bytes:
        """Wait for the answer to the last request."""
        response, whose = self._await_response()
        if whose is Whose.DOUBTFUL:
            self._let_others_have_theirs()
            raise DoubtfulAnswerError("an answer that may be to another program")
        if response[0] == RESPONSE_ABORTED:
            raise SdoAbortedError(int.from_bytes(response[4:8], "little"))
        return response

    def _await_response(self) -> tuple[bytes, Whose]:
        for slice_s in self._slices_s():
            with suppress(queue.Empty):
                response = self.responses.get(timeout=slice_s)
                self.patience.learn(answered=True)
                return response
        self.patience.learn(answered=False)
        self._requests.forget()
        raise SdoCommunicationError("No SDO response received")

    def _let_others_have_theirs(self) -> None:
        """Wait until the node has answered all programs' requests about the object, with the limit of one answer."""
        for slice_s in self._slices_s():
            if not self._requests.awaited:
                return
            with suppress(queue.Empty):
                self.responses.get(timeout=slice_s)
        self._requests.forget()

    def _slices_s(self) -> list[float]:
        slice_s = min(_SLICE_S, self.patience.timeout_s)
        return [slice_s] * ceil(self.patience.timeout_s / slice_s)

    def on_response(self, can_id: int, data: bytearray, timestamp: float) -> None:
        """Process an answer, unless it is for another program."""
        del can_id, timestamp
        if len(data) != SDO_BYTES:
            self.malformed += 1
        elif (whose := self._requests.answer(bytes(data))) is not Whose.OTHERS:
            self.responses.put((bytes(data), whose))

    def on_request(self, can_id: int, data: bytearray, timestamp: float) -> None:
        """Record a request of another program to the node."""
        del can_id, timestamp
        self._requests.overhear(bytes(data))


class SharedNode(RemoteNode):
    """A remote node whose SDO clients are SharedSdoClients."""

    def __init__(self, node_id: int, dictionary: ObjectDictionary, patience: Patience) -> None:
        self._patience = patience
        super().__init__(node_id, dictionary)

    def associate_network(self, network: Network) -> None:
        """Subscribe to a network, requests of other programs included."""
        super().associate_network(network)
        for client in self.sdo_channels:
            network.subscribe(client.rx_cobid, client.on_request)

    def remove_network(self) -> None:
        """Unsubscribe from the network."""
        if self.has_network():
            for client in self.sdo_channels:
                self.network.unsubscribe(client.rx_cobid, client.on_request)
        super().remove_network()

    def add_sdo(self, rx_cobid: int, tx_cobid: int) -> SharedSdoClient:
        """Add an SDO channel, like the library adds a node's default one."""
        client = SharedSdoClient(rx_cobid, tx_cobid, self.object_dictionary)
        client.patience = self._patience
        self.sdo_channels.append(client)
        if self.has_network():
            self.network.subscribe(client.tx_cobid, client.on_response)
            self.network.subscribe(client.rx_cobid, client.on_request)
        return client
