"""Ask a node that other programs ask at the same time, as `status` does beside a running `run`.

CiA 301 intends an SDO channel for one client. With several clients, each hears the answers to all of them, and their
requests: by these `OpenRequests` tells which answers are its own. An answer that may be to another program is an error
after which the dialogue is repeated. What a node may not answer is dropped and counted: frames that have not 8 bytes,
strings without end.

A server answers in the order of the questions, under one identifier, and all programs hear all of it (CiA 301,
7.2.4.3). An answer says what it is: to which command, and for the first one of a transfer, and for a refusal, about
which object. So only two programs that ask about the same object at the same time can take each other's answers for
their own: both write it, and one is refused. A bus carries the requests of the others, too, before the answers to them.
So a program knows how many answers about an object are still to come, and doubts its own until it is the last one.
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
"""The server's command specifier that answers each of the client's: initiate download, upload; segments of both."""
_SEGMENTS: Final = (0x00, 0x20)
"""Server's command specifiers whose frames carry no object."""
_NO_OBJECT: Final = bytes(3)
"""The object of a refusal when the server has no transfer under way."""


class Whose(Enum):
    """The program whose request an answer belongs to."""

    OWN = auto()
    OTHERS = auto()
    DOUBTFUL = auto()
    """This program has asked that, but another one at the same time as well."""


class OpenRequests:
    """The requests to one server that wait for an answer: this program's one, and those that it overhears.

    Frames come in a thread of the bus, requests go out in the program's: each method may be called in both.
    """

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._open: Counter[bytes] = Counter()
        self._request = b""
        """What this program asks; empty while it asks nothing."""
        self._object = b""
        """The object of this program's transfer."""
        self._disturbed = False
        """True if another program has asked something since this program's transfer began."""

    def ask(self, request: bytes) -> None:
        """Take note of a request of this program, which takes the place of the one before."""
        with self._lock:
            self._request = request if request[0] & SPECIFIER in _ANSWERS else b""
            if self._request and initiates(request[0]):
                self._object, self._disturbed = request[OBJECT], False
                self._open[self._object] += 1

    def overhear(self, request: bytes) -> None:
        """Take note of a request of another program; one that is equal to this program's has the same answer."""
        if len(request) != SDO_BYTES:
            return
        with self._lock:
            if request == self._request:
                return
            self._disturbed = True
            if initiates(request[0]):
                self._open[request[OBJECT]] += 1

    def answer(self, answer: bytes) -> Whose:
        """Take note of an answer and return whom it is to."""
        command, about = answer[0] & SPECIFIER, answer[OBJECT]
        with self._lock:
            rivals = self._open[self._object] > 1
            if command not in _SEGMENTS and self._open[about]:
                self._open[about] -= 1
            if not self._fits(command, about):
                return Whose.OTHERS
            first, self._request = initiates(self._request[0]), b""
            if first:
                in_one_frame = command == UPLOAD and answer[0] & EXPEDITED  # any program's is the object's value
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
        """True while answers about the object of this program's transfer are still to come."""
        with self._lock:
            return self._open[self._object] > 0

    def forget(self) -> None:
        """Await no answer any more: the server is silent."""
        with self._lock:
            self._request = b""
            self._open.clear()


_NEXT_SEGMENT: Final = 0x60
"""Client command specifier that asks for a segment."""
SEGMENTS_MAX: Final = 64
"""Greatest number of segments of an answer, 448 bytes: the longest string of these nodes has 40."""
_PATIENCE_S: Final = 0.8
"""Time limit for an answer: nodes answer within milliseconds, but the clock of a served board may stand meanwhile."""
_IMPATIENCE_S: Final = 0.05
_SLICE_S: Final = 0.05
"""Length of the pieces of a client's wait: when its own program is held up, only one piece of the limit passes."""


class Patience:
    """How long the nodes of a machine are waited for: not long after one was silent, until one answers again.

    So whatever is asked of all nodes in turn, as at an emergency stop, ends soon when the bus or the server is silent;
    each node is asked nevertheless.
    """

    def __init__(self) -> None:
        self.timeout_s: float = _PATIENCE_S

    def learn(self, *, answered: bool) -> None:
        """Take note whether a node has answered."""
        self.timeout_s = _PATIENCE_S if answered else _IMPATIENCE_S


class DoubtfulAnswerError(SdoError):
    """An answer may be to another program, which asks for the same object at the same time: ask again."""


class SharedSdoClient(SdoClient):
    """An SDO client that takes its own answers only.

    Its methods raise SdoAbortedError if the node refuses, SdoCommunicationError if no answer comes, and
    DoubtfulAnswerError.
    """

    patience: Patience
    """Shared by the nodes of a machine; set by the node."""
    malformed: int = 0
    """Number of answers that were dropped because they have not 8 bytes (CiA 301, 7.2.4.3)."""
    responses: "queue.Queue[tuple[bytes, Whose]]"
    _segments = 0

    def __init__(self, rx_cobid: int, tx_cobid: int, od: ObjectDictionary) -> None:
        super().__init__(rx_cobid, tx_cobid, od)  # type: ignore[no-untyped-call]
        self._requests = OpenRequests()

    def download(self, index: int, subindex: int, data: bytes, force_segment: bool = False) -> None:
        """Write an object. What fits one request is sent without the library's stream, which costs most of a set-up."""
        if force_segment or not 1 <= len(data) <= EXPEDITED_BYTES_MAX:
            super().download(index, subindex, data, force_segment)
            return
        request = download_request(address_of(index, subindex), data)
        self.request_response(request)  # type: ignore[no-untyped-call]

    def send_request(self, request: bytearray) -> None:
        """Send a request; raise SdoCommunicationError at an endless answer."""
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
        """Wait until the node has answered what all programs have asked about the object, as long as for an answer."""
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
        """Take an answer, unless it is to another program."""
        del can_id, timestamp
        if len(data) != SDO_BYTES:
            self.malformed += 1
        elif (whose := self._requests.answer(bytes(data))) is not Whose.OTHERS:
            self.responses.put((bytes(data), whose))

    def on_request(self, can_id: int, data: bytearray, timestamp: float) -> None:
        """Overhear what another program asks the node."""
        del can_id, timestamp
        self._requests.overhear(bytes(data))


class SharedNode(RemoteNode):
    """A remote node whose SDO clients are SharedSdoClients."""

    def __init__(self, node_id: int, dictionary: ObjectDictionary, patience: Patience) -> None:
        self._patience = patience
        super().__init__(node_id, dictionary)

    def associate_network(self, network: Network) -> None:
        """Listen on a network, and to what other programs ask the node."""
        super().associate_network(network)
        for client in self.sdo_channels:
            network.subscribe(client.rx_cobid, client.on_request)

    def remove_network(self) -> None:
        """Listen no more."""
        if self.has_network():
            for client in self.sdo_channels:
                self.network.unsubscribe(client.rx_cobid, client.on_request)
        super().remove_network()

    def add_sdo(self, rx_cobid: int, tx_cobid: int) -> SharedSdoClient:
        """Add an SDO channel, in the same way as the library adds a node's default one."""
        client = SharedSdoClient(rx_cobid, tx_cobid, self.object_dictionary)
        client.patience = self._patience
        self.sdo_channels.append(client)
        if self.has_network():
            self.network.subscribe(client.tx_cobid, client.on_response)
            self.network.subscribe(client.rx_cobid, client.on_request)
        return client
