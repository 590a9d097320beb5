"""The protocol of socketcand as its server speaks it, without I/O: bytes in; frames to send, and bytes, out.

Source: doc/protocol.md of github.com/linux-can/socketcand, and what python-can's client does. Of its modes only RAW is
served, which is the one that python-can uses. `< hi >` greets; then

    < open vcan0 >                       < ok >      whatever the bus is called, there is one
    < rawmode >                          < ok >
    < send 201 3 1 2 ff >                            hexadecimal identifier, length, bytes
    < echo >                             < echo >
                                         < frame 181 1700000000.123456 0102A0 >      what others have sent

python-can compares a whole `recv` with `< ok >`, so nothing may follow it soon: what is to be delivered is held back
until the client's first `send`, or until `break_silence`.
"""

import re
from enum import Enum, auto
from typing import Final

from steptwin.protocol.frame import COB_ID_MASK, Frame

COMMAND_MAX: Final = 512
"""Bytes from < to >; the longest command that anybody means, an FD frame, has 220."""

_BETWEEN: Final = b" \t\r\n"
_SEND: Final = re.compile(rb"<\s*send\s+([0-9A-Fa-f]{1,3}|[0-9A-Fa-f]{8})\s+([0-8])((?:\s+[0-9A-Fa-f]{1,2})*)\s*>")
_WORDS: Final = re.compile(rb"<\s*([a-z]+)((?:\s+[^\s<>]+)*)\s*>")


class Mode(Enum):
    """Where in the dialogue a client is."""

    NO_BUS = auto()
    BUS_OPEN = auto()
    RAW = auto()
    CLOSED = auto()
    """It has sent something that is no protocol, and is to be disconnected."""


_MODES: Final = {
    (Mode.NO_BUS, b"open"): Mode.BUS_OPEN,
    (Mode.BUS_OPEN, b"rawmode"): Mode.RAW,
    (Mode.RAW, b"rawmode"): Mode.RAW,
}
"""The commands that are answered by `< ok >`, and the mode after them."""
_FOREIGN: Final = (b"sendrtr", b"fdsend")
"""Commands that send frames of other kinds, which the board would not understand."""
_SENDING: Final = (Mode.BUS_OPEN, Mode.RAW)


class SocketcandSession:
    """The dialogue with one client."""

    def __init__(self) -> None:
        self.mode = Mode.NO_BUS
        self.complaint = ""
        """Why the session is closed."""
        self.outbox = bytearray(b"< hi >")
        """What is to be sent to the client; whoever sends it takes it out."""
        self.foreign_frames = 0
        """Remote frames, CAN FD frames and frames with 29-bit identifiers: dropped."""
        self._inbox = bytearray()
        self._held: bytearray | None = None
        """What is delivered during the silence after `rawmode`; None: there is none."""

    # --- in

    def feed(self, data: bytes) -> None:
        """Take what has come from the client; `next_frame` makes something of it."""
        if self.mode is not Mode.CLOSED:
            self._inbox += data

    def next_frame(self) -> Frame | None:
        """The next frame that the client sends; None: more bytes are needed, or the session is closed."""
        while (command := self._next_command()) is not None:
            sending = _SEND.fullmatch(command)
            if sending and self.mode in _SENDING:
                self.break_silence()
                frame = self._frame(*sending.groups())
                if frame:
                    return frame
            else:
                self._obey(command)
        return None

    def _next_command(self) -> bytes | None:
        """Cut the next command out of the inbox. What stands between commands must be blank."""
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
            if self.mode is Mode.RAW:
                self._held = bytearray()
        elif name == b"echo" and self.mode is not Mode.NO_BUS:
            self.outbox += b"< echo >"
        elif name in _FOREIGN and self.mode in _SENDING:
            self.foreign_frames += 1
        else:
            self._close("unknown command")

    def _close(self, complaint: str) -> None:
        self.mode = Mode.CLOSED
        self.complaint = complaint
        self.outbox += f"< error {complaint} >".encode("ascii")
        self._inbox.clear()
        self._held = None

    # --- out

    @property
    def silent(self) -> bool:
        """Whether what is delivered is held back after `rawmode`."""
        return self._held is not None

    @property
    def backlog_bytes(self) -> int:
        """What waits to be sent to the client."""
        return len(self.outbox) + len(self._held or b"")

    def deliver(self, text: bytes) -> None:
        """Show the client a frame, as `frame_text` makes it, if it wants to see frames."""
        if self._held is not None:
            self._held += text
        elif self.mode is Mode.RAW:
            self.outbox += text

    def break_silence(self) -> None:
        """Let go of what was held back."""
        if self._held is not None:
            self.outbox += self._held
            self._held = None


def frame_text(frame: Frame, time_us: int) -> bytes:
    """How a client is shown a frame; `time_us` since 1970. An empty one has two spaces before >, as clients expect."""
    seconds, us = divmod(time_us, 1_000_000)
    return f"< frame {frame.cob_id:03X} {seconds}.{us:06d} {frame.data.hex().upper()} >".encode("ascii")
