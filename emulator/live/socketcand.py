"""Serve clients of a live board over TCP with the protocol of socketcand, for python-can's interface `socketcand`.

`SocketcandSession` implements the protocol without I/O: bytes in; frames to send, and bytes, out. `SocketcandServer`
loses no frames of a client. Frames from a client wait in its socket while the bus is busy with earlier ones; frames for
a client wait here until it reads.

Sources: doc/protocol.md of github.com/linux-can/socketcand, and the behaviour of python-can's client. Only the mode RAW
is served, which python-can uses. The server greets with `< hi >`; then


    < open vcan0 >                       < ok >      any name opens the only bus
    < rawmode >                          < ok >
    < send 201 3 1 2 ff >                            hexadecimal identifier, length, bytes
    < echo >                             < echo >
                                         < frame 181 1700000000.123456 0102A0 >      a frame of another sender

python-can compares a complete `recv` with `< ok >`, so no byte may follow it closely. Frames for the client are held
until its first `send`, or until `break_silence`.
"""

import re
import socket
from enum import Enum, auto
from functools import partial
from typing import Final

from steptwin.emulator.live.live_loop import LiveLoop
from steptwin.emulator.live.live_simulation import Sender
from steptwin.emulator.live.tcp_server import Client, TcpServer
from steptwin.protocol.frame import COB_ID_MASK, REMOTE, Frame
from steptwin.protocol.timer import COUNTS_PER_US

COMMAND_MAX: Final = 512
"""Longest command in bytes, from < to >; the longest legal one, an FD frame, has 220."""
SILENCE_S: Final = 0.1
"""Pause after `rawmode` for a client that does not send; after it, the client has read the answer."""
WINDOW_FRAMES: Final = 16
"""Highest number of one client's waiting frames; they delay other clients by 2 ms at 1 Mbit/s."""

_BETWEEN: Final = b" \t\r\n"
_SEND: Final = re.compile(rb"<\s*send\s+([0-9A-Fa-f]{1,3}|[0-9A-Fa-f]{8})\s+([0-8])((?:\s+[0-9A-Fa-f]{1,2})*)\s*>")
_REMOTE: Final = re.compile(rb"<\s*sendrtr\s+([0-9A-Fa-f]{1,3}|[0-9A-Fa-f]{8})\s+[0-8]\s*>")
_WORDS: Final = re.compile(rb"<\s*([a-z]+)((?:\s+[^\s<>]+)*)\s*>")


class SessionMode(Enum):
    """State of a client's session."""

    NO_BUS = auto()
    BUS_OPEN = auto()
    RAW = auto()
    CLOSED = auto()
    """The client has violated the protocol and must be disconnected."""


_MODES: Final = {
    (SessionMode.NO_BUS, b"open"): SessionMode.BUS_OPEN,
    (SessionMode.BUS_OPEN, b"rawmode"): SessionMode.RAW,
    (SessionMode.RAW, b"rawmode"): SessionMode.RAW,
}
"""Commands with the answer `< ok >`, and the mode after them."""
_FOREIGN: Final = b"fdsend"
"""Command that sends a CAN FD frame, which the board does not accept."""
_SENDING: Final = (SessionMode.BUS_OPEN, SessionMode.RAW)


class SocketcandSession:
    """The dialogue with one client."""

    def __init__(self) -> None:
        self.mode: SessionMode = SessionMode.NO_BUS
        self.complaint: str = ""
        """Reason why the session is closed; empty while it is open."""
        self.outbox: bytearray = bytearray(b"< hi >")
        """Bytes to send to the client; the server removes the sent ones."""
        self.foreign_frames: int = 0
        """Number of dropped frames: CAN FD frames and frames with 29-bit identifiers."""
        self._inbox = bytearray()
        self._held: bytearray | None = None
        """Text of frames held during the pause after `rawmode`; None outside of it."""

    # --- in

    def feed(self, data: bytes) -> None:
        """Append received bytes for `next_frame`."""
        if self.mode is not SessionMode.CLOSED:
            self._inbox += data

    def next_frame(self) -> Frame | None:
        """Return the next frame from the client; None if more bytes are needed or the session is closed."""
        while (command := self._next_command()) is not None:
            if self.mode not in _SENDING:
                self._obey(command)
            elif sending := _SEND.fullmatch(command):
                self.break_silence()
                if frame := self._frame(*sending.groups()):
                    return frame
            elif remote := _REMOTE.fullmatch(command):
                self.break_silence()
                if frame := self._frame(remote[1], b"0", b""):
                    return Frame(REMOTE | frame.cob_id, b"")
            else:
                self._obey(command)
        return None

    def _next_command(self) -> bytes | None:
        """Remove the next command from the inbox; only blanks are allowed between commands."""
        self._inbox = self._inbox.lstrip(_BETWEEN)
        if not self._inbox:
            return None
        if not self._inbox.startswith(b"<"):
            self._close("commands stand between < and >")
            return None
        end = self._inbox.find(b">", 0, COMMAND_MAX) + 1
        if end:
            command = bytes(self._inbox[:end])
            del self._inbox[:end]
            return command
        if len(self._inbox) >= COMMAND_MAX:
            self._close("command too long")
        return None

    def _frame(self, identifier: bytes, length: bytes, data: bytes) -> Frame | None:
        values = [int(word, 16) for word in data.split()]
        if len(values) != int(length):
            self._close("send: the length is not that of the data")
        elif len(identifier) > 3:
            self.foreign_frames += 1
        elif int(identifier, 16) > COB_ID_MASK:
            self._close("send: the identifier is above 7FF")
        else:
            return Frame(int(identifier, 16), bytes(values))
        return None

    def _obey(self, command: bytes) -> None:
        words = _WORDS.fullmatch(command)
        name = words[1] if words else b""
        if (self.mode, name) in _MODES:
            self.mode = _MODES[self.mode, name]
            self.break_silence()
            self.outbox += b"< ok >"
            if self.mode is SessionMode.RAW:
                self._held = bytearray()
        elif name == b"echo" and self.mode is not SessionMode.NO_BUS:
            self.outbox += b"< echo >"
        elif name == _FOREIGN and self.mode in _SENDING:
            self.foreign_frames += 1
        else:
            self._close("unknown command")

    def _close(self, complaint: str) -> None:
        self.mode = SessionMode.CLOSED
        self.complaint = complaint
        self.outbox += f"< error {complaint} >".encode("ascii")
        self._inbox.clear()
        self._held = None

    @property
    def closed(self) -> bool:
        """True if the client has violated the protocol."""
        return self.mode is SessionMode.CLOSED

    # --- out

    @property
    def silent(self) -> bool:
        """True while frames are held after `rawmode`."""
        return self._held is not None

    @property
    def backlog_bytes(self) -> int:
        """Number of unsent bytes for the client."""
        return len(self.outbox) + len(self._held or b"")

    def deliver(self, text: bytes) -> None:
        """Queue a frame's text, from `frame_text`, for a client in the mode RAW."""
        if self._held is not None:
            self._held += text
        elif self.mode is SessionMode.RAW:
            self.outbox += text

    def break_silence(self) -> None:
        """Release the held frames."""
        if self._held is not None:
            self.outbox += self._held
            self._held = None


def frame_text(frame: Frame, time_us: int) -> bytes:
    """Return a frame's text for clients; `time_us` since 1970. Without data, clients expect two spaces before >."""
    seconds, us = divmod(time_us, 1_000_000)
    return f"< frame {frame.cob_id:03X} {seconds}.{us:06d} {frame.data.hex().upper()} >".encode("ascii")


_Client = Client[SocketcandSession]


class SocketcandServer(TcpServer[SocketcandSession]):
    """Serves the clients of a listening socket, which the server owns and closes."""

    def __init__(self, loop: LiveLoop, listener: socket.socket) -> None:
        self._foreign_frames = 0
        self._restless: dict[_Client, None] = {}
        """Clients for which `hand_on` has work; a dict keeps their order."""
        super().__init__(loop, listener, WINDOW_FRAMES)
        loop.hand_on = self._hand_on
        self._live.view = self._show

    @property
    def foreign_frames(self) -> int:
        """Number of clients' frames that were dropped because this bus does not support their kind."""
        return self._foreign_frames + sum(client.session.foreign_frames for client in self._clients)

    def _new_session(self) -> SocketcandSession:
        return SocketcandSession()

    def _refusal(self, reason: str) -> bytes:
        return f"< error {reason} >".encode("ascii")

    def _forget(self, client: _Client) -> None:
        """Close a client's connection; frames that it has sent are still delivered."""
        self._foreign_frames += client.session.foreign_frames
        self._restless.pop(client, None)
        super()._forget(client)

    def _pass_on(self, client: _Client) -> None:
        """Send a client's frames while fewer than WINDOW_FRAMES wait."""
        session = client.session
        was_silent = session.silent
        while client.waiting < WINDOW_FRAMES and (frame := session.next_frame()):
            client.waiting += 1
            self._live.send(frame, client, self._loop.looked_ns)
        if session.silent and not was_silent:
            self._loop.call_after(SILENCE_S, partial(self._end_silence, client))

    def _end_silence(self, client: _Client) -> None:
        if not client.gone and client.session.silent:
            client.session.break_silence()
            self._tend(client)

    # --- frames from the bus

    def _show(self, frame: Frame, counts: int, sender: Sender | None) -> None:
        text = b"" if frame.cob_id & REMOTE else frame_text(frame, self._live.epoch_us + counts // COUNTS_PER_US)
        for client in self._clients:
            if client is not sender:
                client.session.deliver(text)
                self._restless[client] = None
        if isinstance(sender, Client):
            sender.waiting -= 1
            if not sender.gone:
                self._restless[sender] = None

    def _hand_on(self) -> None:
        restless, self._restless = self._restless, {}
        for client in restless:
            if not client.gone:
                self._tend(client)
