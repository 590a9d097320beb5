"""Serve clients of a live board over TCP as socketcand does: python-can's interface `socketcand` and all built on it.

A client loses no frames: those that it sends wait in its socket while the bus is busy with its earlier ones; those for
it wait here until it reads.
"""

import socket
from functools import partial
from typing import Final

from steptwin.emulator.live.live_loop import LiveLoop
from steptwin.emulator.live.live_simulation import Sender
from steptwin.emulator.live.socketcand import SocketcandSession, frame_text
from steptwin.emulator.live.tcp_server import Client, TcpServer
from steptwin.protocol.frame import Frame
from steptwin.protocol.timer import COUNTS_PER_US

SILENCE_S: Final = 0.1
"""Silence after `rawmode` towards a client that does not send: by its end the client has read the answer."""
WINDOW_FRAMES: Final = 16
"""Greatest number of one client's frames that wait for the bus; they delay other clients by 2 ms at 1 Mbit/s."""

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
        """Number of dropped frames of clients, of kinds that this bus does not carry."""
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
        """Pass a client's frames on while its window has room."""
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

    # --- the bus has something to show

    def _show(self, frame: Frame, counts: int, sender: Sender | None) -> None:
        text = frame_text(frame, self._live.epoch_us + counts // COUNTS_PER_US)
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
