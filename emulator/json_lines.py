"""Speak JSON lines with a client that asks, without I/O: bytes in; requests, and bytes with answers, out.

A request is a JSON object (RFC 8259, in UTF-8) in a line of its own; so is its answer. Empty lines are passed over.
A client that sends anything else speaks another protocol: the session closes and ignores all that follows. So a web
page cannot slip a request into the body of an HTTP request, of which the head comes first.
"""

import json
from typing import Any, Final, NoReturn

LINE_MAX_BYTES: Final = 1024
"""Greatest length of a request's line without its end; the longest useful one has some 200."""


class JsonLineSession:
    """The dialogue with one client."""

    def __init__(self) -> None:
        self.complaint = ""
        """Reason why the session is closed."""
        self.outbox = bytearray()
        """Bytes to send to the client; the server removes what it has sent."""
        self._inbox = bytearray()

    def feed(self, data: bytes) -> None:
        """Take bytes that have come from the client, for `next_request` to read."""
        if not self.closed:
            self._inbox += data

    @property
    def closed(self) -> bool:
        """True if the client sent something else than JSON objects in lines."""
        return bool(self.complaint)

    @property
    def backlog_bytes(self) -> int:
        """Number of bytes that wait to be sent to the client."""
        return len(self.outbox)

    def next_request(self) -> dict[str, Any] | None:
        """Return the next request; None if more bytes are needed or the session is closed."""
        while (line := self._next_line()) is not None:
            if line:
                return self._request(line)
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

    def _request(self, line: bytes) -> dict[str, Any] | None:
        try:
            request = json.loads(line.decode("utf-8"), parse_constant=_no_number)
        except (ValueError, RecursionError):  # also an integer of thousands of digits
            request = None
        if not isinstance(request, dict):
            self._close('the line is not a JSON object, such as {"do": "state"}')
            return None
        return request

    def _close(self, complaint: str) -> None:
        self.complaint = complaint
        self.answer({"error": complaint})
        self._inbox.clear()


def answer_line(document: dict[str, Any]) -> bytes:
    """Return an answer as sent to clients: one line of ASCII, with its end."""
    return json.dumps(document).encode("ascii") + b"\n"


def _no_number(text: str) -> NoReturn:
    """Refuse NaN, Infinity and -Infinity, which Python's reader takes for numbers and RFC 8259 does not."""
    raise ValueError(f"{text} is not JSON")
