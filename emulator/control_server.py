"""Serve a live board's control port: clients operate the emulated machine by JSON lines and ask how it is.

A request enters the board at its instant, in order with the frames of other clients. Its answer is sent when the board
has come to this instant; until then the client's next request waits. The loop takes one request a turn, whosever it is,
so that clients that ask without pause hold it up by one request at a time.
"""

import socket
from collections import deque
from collections.abc import Callable
from functools import partial
from typing import Any

from steptwin.emulator.json_lines import JsonLineSession, answer_line
from steptwin.emulator.live_loop import LiveLoop
from steptwin.emulator.tcp_server import Client, TcpServer

Answer = dict[str, Any]
Handler = Callable[[dict[str, Any]], Answer]
"""Does what a request asks for, and returns the answer; a refusal has the key `error`."""

_Client = Client[JsonLineSession]


class ControlServer(TcpServer[JsonLineSession]):
    """Serves the clients of a listening socket, which the server owns and closes."""

    def __init__(self, loop: LiveLoop, listener: socket.socket, handle: Handler) -> None:
        """Call `handle` in the loop's thread, with each request at its instant."""
        self.requests = 0
        """Number of requests, refused ones as well."""
        self.refused = 0
        """Number of requests that were refused."""
        self._handle = handle
        self._turns: deque[tuple[_Client, dict[str, Any]]] = deque()
        """Requests that wait for their turn; the first has it."""
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
