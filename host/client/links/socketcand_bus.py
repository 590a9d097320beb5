"""A bus of a socketcand server, with a time limit for every wait.

python-can's own class for this interface tries to connect for ten seconds, waits without limit for the greeting and for
space to send, and cannot detect a closed connection. This class sends `< echo >` to a silent server, as the protocol
intends. Source: doc/protocol.md of github.com/linux-can/socketcand.
"""

import re
import selectors
import socket
import threading
import time
from collections import deque
from contextlib import suppress
from typing import Final, Never

import can

from steptwin.host.client.links import ANSWER_S, SILENT, connected
from steptwin.host.common.bad_input import printable

SILENCE_S: Final = 1.0
"""Silence of the server after which an echo is requested."""
_LOOK_S: Final = 0.5
"""Longest time between two checks of the server's silence."""
_READ_BYTES: Final = 4096
_ITEM_MAX_BYTES: Final = 512
"""Longest item in bytes, from < to >; a frame has up to 53, a CAN FD frame up to 220."""
_SHOWN_BYTES: Final = 80
_FRAME: Final = re.compile(rb"<\s*frame\s+([0-9A-Fa-f]{3}|[0-9A-Fa-f]{8})\s+(\d+\.\d+)\s+((?:[0-9A-Fa-f]{2}\s*){0,8})>")
_COMPLAINT: Final = re.compile(rb"<\s*error\s+([^>]*?)\s*>")


class SocketcandBus(can.BusABC):
    """A bus in the mode RAW of a socketcand server. After an error, every call raises that error.

    Raises:
        can.CanError: the server does not greet, refuses the bus, or uses another protocol.
        OSError: the server cannot be reached.
    """

    def __init__(self, channel: str, host: str, port: int) -> None:
        self.dropped: int = 0
        """Number of received items that are neither frames nor answers."""
        self._failure = ""
        self._complaint = ""
        self._channel = channel
        self._inbox = bytearray()
        self._messages: deque[can.Message] = deque()
        self._sending = threading.Lock()
        until_s = time.monotonic() + ANSWER_S
        self._socket = connected(host, port, until_s)
        try:
            self._shake_hands(channel, until_s)
        except BaseException:
            self._socket.close()
            raise
        self._socket.settimeout(ANSWER_S)
        self._readable = selectors.DefaultSelector()
        self._readable.register(self._socket, selectors.EVENT_READ)
        self._heard_s = time.monotonic()
        self._requested_s: float | None = None
        """Time of the pending request for an echo; None if none is pending."""
        self.channel_info: str = f"socketcand on {channel}@{host}:{port}"
        super().__init__(channel)
        self._take_items()  # the first frames may have arrived with the last answer

    # --- the dialogue before the first frame

    def _shake_hands(self, channel: str, until_s: float) -> None:
        self._expect(b"hi", until_s)
        for command in (f"open {channel}", "rawmode"):
            self._socket.sendall(f"< {command} >".encode())
            self._expect(b"ok", until_s)

    def _expect(self, word: bytes, until_s: float) -> None:
        while not (item := self._next_item()):
            left_s = until_s - time.monotonic()
            if left_s <= 0:
                raise can.CanInitializationError(SILENT)
            self._socket.settimeout(left_s)
            with suppress(TimeoutError):
                self._inbox += self._received()
            if self._inbox and not self._inbox.startswith(b"<"):
                item = bytes(self._inbox)
                break
        if item.strip(b"< >") != word:
            complaint = _COMPLAINT.fullmatch(item)
            says = f"is not a socketcand server: it says {_text(item)} instead of < {word.decode()} >"
            raise can.CanInitializationError(_text(complaint[1]) if complaint else says)

    def _received(self) -> bytes:
        """Read bytes from the server; raise CanOperationError if it has closed the connection."""
        data = self._socket.recv(_READ_BYTES)
        if not data:
            closed = "the server has closed the connection"
            raise can.CanOperationError(f"{closed}: {self._complaint}" if self._complaint else closed)
        return data

    def _next_item(self) -> bytes | None:
        """Remove the next item, from < to >, from the inbox; drop other bytes before it, and too long items."""
        start = self._inbox.find(b"<")
        if start:
            self.dropped += bool(self._inbox)
            del self._inbox[: start if start > 0 else len(self._inbox)]
        end = self._inbox.find(b">") + 1
        if end:
            item = bytes(self._inbox[:end])
            del self._inbox[:end]
            return item
        if len(self._inbox) > _ITEM_MAX_BYTES:
            self.dropped += 1
            self._inbox.clear()
        return None

    # --- frames

    def send(self, msg: can.Message, timeout: float | None = None) -> None:
        """Send a frame; raise CanOperationError if the server does not accept it within ANSWER_S."""
        del timeout  # a partly sent frame would break the connection, so all frames have the same limit
        identifier = f"{msg.arbitration_id:0{8 if msg.is_extended_id else 3}X}"
        if msg.is_remote_frame:
            self._write(f"< sendrtr {identifier} {msg.dlc} >")
        else:
            self._write(f"< send {identifier} {msg.dlc} {msg.data.hex(' ')} >")

    def _write(self, text: str) -> None:
        with self._sending:
            self._check()
            try:
                self._socket.sendall(text.encode("ascii"))
            except TimeoutError:
                self._fail(f"takes nothing that is sent within {ANSWER_S:g} s")
            except OSError as error:
                self._fail(error.strerror or str(error))

    def _recv_internal(self, timeout: float | None) -> tuple[can.Message | None, bool]:
        if not self._messages:
            self._check()
            self._listen(_LOOK_S if timeout is None else min(timeout, _LOOK_S))
        return (self._messages.popleft() if self._messages else None), False

    def _listen(self, dt_s: float) -> None:
        """Wait for bytes from the server and process them; request an echo from a silent server."""
        if not self._readable.select(dt_s):
            self._ask_if_silent()
            return
        try:
            self._inbox += self._received()
        except (OSError, can.CanError) as error:
            self._fail(getattr(error, "strerror", None) or str(error))
        if hasattr(socket, "TCP_QUICKACK"):  # a server that delays small packets waits for this acknowledgement
            self._socket.setsockopt(socket.IPPROTO_TCP, socket.TCP_QUICKACK, 1)
        self._heard_s, self._requested_s = time.monotonic(), None
        self._take_items()

    def _take_items(self) -> None:
        while item := self._next_item():
            frame = _FRAME.fullmatch(item)
            if frame:
                self._messages.append(_message(frame, self._channel))
            elif complaint := _COMPLAINT.fullmatch(item):
                self._complaint = _text(complaint[1])
            elif item != b"< echo >":
                self.dropped += 1

    def _ask_if_silent(self) -> None:
        now_s = time.monotonic()
        if self._requested_s is not None:
            if now_s - self._requested_s > ANSWER_S:
                self._fail(SILENT)
        elif now_s - self._heard_s > SILENCE_S:
            self._requested_s = now_s
            self._write("< echo >")

    # --- the end

    def _check(self) -> None:
        if self._failure:
            raise can.CanOperationError(self._failure)

    def _fail(self, why: str) -> Never:
        self._failure = why
        raise can.CanOperationError(why)

    def shutdown(self) -> None:
        """Close the connection."""
        super().shutdown()
        self._readable.close()
        self._socket.close()


def _message(frame: re.Match[bytes], channel: str) -> can.Message:
    identifier, time_s, data = frame.groups()
    return can.Message(
        timestamp=float(time_s),
        arbitration_id=int(identifier, 16),
        is_extended_id=len(identifier) > 3,
        data=bytes.fromhex(data.decode("ascii")),
        channel=channel,
    )


def _text(said: bytes) -> str:
    """Return the beginning of a server's bytes as printable text."""
    return printable(said[:_SHOWN_BYTES].decode("latin-1"))
