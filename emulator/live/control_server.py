"""Serve a live board's control port: clients operate the emulated machine and read its state by JSON lines.

A request acts at its instant, in order with the frames of other clients. It is answered when the board has reached this
instant; until then the client's next request waits. The loop handles one request per turn, from any client, so many
requests delay it by one request at a time.

Request and answer are each a JSON object (RFC 8259, in UTF-8) in one line. Empty lines are ignored. If a client sends
anything else, the session closes and ignores everything after it. So a web page cannot hide a request in the body of an
HTTP request, because the HTTP header comes first.
"""

import json
import socket
from collections import deque
from collections.abc import Callable
from functools import partial
from typing import Any, Final, NoReturn

from steptwin.emulator.live.live_loop import LiveLoop
from steptwin.emulator.live.tcp_server import Client, TcpServer

LINE_MAX_BYTES: Final = 1024
"""Longest line of a request, without its end; the longest useful one has some 200 bytes."""


class JsonLineSession:
    """The dialogue with one client."""

    def __init__(self) -> None:
        self.complaint: str = ""
        """Reason why the session is closed; empty while it is open."""
        self.outbox: bytearray = bytearray()
        """Bytes to send to the client; the server removes the sent ones."""
        self._inbox = bytearray()

    def feed(self, data: bytes) -> None:
        """Append received bytes for `next_request`."""
        if not self.closed:
            self._inbox += data

    @property
    def closed(self) -> bool:
        """True if the client has sent anything but JSON objects in lines."""
        return bool(self.complaint)

    @property
    def backlog_bytes(self) -> int:
        """Number of unsent bytes for the client."""
        return len(self.outbox)

    def next_request(self) -> dict[str, Any] | None:
        """Return the next request; None if more bytes are needed or the session is closed."""
        while (line := self._next_line()) is not None:
            if line:
                try:
                    request = json.loads(line.decode("utf-8"), parse_constant=_no_number)
                except (ValueError, RecursionError):  # also an integer of thousands of digits
                    request = None
                if isinstance(request, dict):
                    return request
                self._close('the line is not a JSON object, such as {"do": "state"}')
                return None
        return None

    def answer(self, document: dict[str, Any]) -> None:
        """Queue an answer for the client."""
        self.outbox += answer_line(document)

    def _next_line(self) -> bytes | None:
        end = self._inbox.find(b"\n", 0, LINE_MAX_BYTES + 1)
        if end < 0:
            if len(self._inbox) > LINE_MAX_BYTES:
                self._close(f"the line has more than {LINE_MAX_BYTES} bytes")
            return None
        line = bytes(self._inbox[:end])
        del self._inbox[: end + 1]
        return line.strip()

    def _close(self, complaint: str) -> None:
        self.complaint = complaint
        self.answer({"error": complaint})
        self._inbox.clear()


def answer_line(document: dict[str, Any]) -> bytes:
    """Encode an answer as one line of ASCII with its line end."""
    return json.dumps(document).encode("ascii") + b"\n"


def _no_number(text: str) -> NoReturn:
    """Refuse NaN, Infinity and -Infinity, which Python's parser accepts although RFC 8259 does not."""
    raise ValueError(f"{text} is not JSON")


Answer = dict[str, Any]
Handler = Callable[[dict[str, Any]], Answer]
"""Executes a request and returns its answer; a refusal has the key `error`."""

_Client = Client[JsonLineSession]


class ControlServer(TcpServer[JsonLineSession]):
    """Serves the clients of a listening socket, which the server owns and closes."""

    def __init__(self, loop: LiveLoop, listener: socket.socket, handle: Handler) -> None:
        """Call `handle` in the loop's thread with each request, at its instant."""
        self.requests: int = 0
        """Number of requests, refused ones included."""
        self.refused: int = 0
        """Number of requests that were refused."""
        self._handle = handle
        self._turns: deque[tuple[_Client, dict[str, Any]]] = deque()
        """Waiting requests; the first one is in progress."""
        super().__init__(loop, listener, window=1)

    def _new_session(self) -> JsonLineSession:
        return JsonLineSession()

    def _refusal(self, reason: str) -> bytes:
        return answer_line({"error": reason})

    def _pass_on(self, client: _Client) -> None:
        if client.waiting or (request := client.session.next_request()) is None:
            return
        client.waiting = 1
        self._turns.append((client, request))
        if len(self._turns) == 1:
            self._loop.call_soon(self._enter)

    def _enter(self) -> None:
        self._live.call(partial(self._serve, *self._turns[0]), self._loop.looked_ns)

    def _serve(self, client: _Client, request: dict[str, Any]) -> None:
        answer = self._handle(request)
        self.requests += 1
        self.refused += "error" in answer
        self._turns.popleft()
        if self._turns:
            self._loop.call_soon(self._enter)
        client.waiting = 0
        if not client.gone:
            client.session.answer(answer)
            self._tend(client)
