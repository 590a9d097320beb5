"""Serve clients of a live board over TCP as socketcand does: python-can's interface `socketcand` and all built on it.

A client loses no frames: those that it sends wait in its socket while the bus is busy with its earlier ones; those for
it wait here until it reads. A client that does not read is disconnected before too many bytes wait.
"""

import errno
import logging
import socket
from collections import Counter
from contextlib import suppress
from functools import partial
from selectors import EVENT_READ, EVENT_WRITE
from typing import Final

from steptwin.emulator.live import LiveSimulation, Sender
from steptwin.emulator.live_loop import LiveLoop
from steptwin.emulator.socketcand import SessionMode, SocketcandSession, frame_text
from steptwin.protocol.frame import Frame
from steptwin.protocol.timer import COUNTS_PER_US

CLIENTS_MAX: Final = 250
"""Greatest number of clients; the loop's `select` takes a thousand files at most, and each client is one."""
SILENCE_S: Final = 0.1
"""Silence after `rawmode` towards a client that does not send: by its end the client has read the answer."""
WINDOW_FRAMES: Final = 16
"""Greatest number of one client's frames that wait for the bus; they delay other clients by 2 ms at 1 Mbit/s."""
BACKLOG_MAX_BYTES: Final = 1 << 20
"""Bytes that a client may leave unread beside the operating system's buffers: some 20 000 frames."""
REST_S: Final = 0.2
"""Time for which no client is accepted after the operating system had no file for a client."""
_OUT_OF_FILES: Final = (errno.EMFILE, errno.ENFILE, errno.ENOBUFS, errno.ENOMEM)
_SELECT_FILES: Final = 1024
"""Number of files that `select` can wait for (FD_SETSIZE); those of the whole process count."""
_SEND_BUFFER_BYTES: Final = 1 << 18
_READ_BYTES: Final = 4096

_log = logging.getLogger(__name__)


class _Client:
    """One connection."""

    def __init__(self, sock: socket.socket, name: str) -> None:
        self.socket = sock
        self.name = name
        self.session = SocketcandSession()
        self.waiting_frames = 0
        """Number of its frames that wait for the bus."""
        self.events = 0
        """Events for which its socket is watched."""
        self.gone = False


class SocketcandServer:
    """Serves the clients of a listening socket, which the server owns and closes."""

    def __init__(self, loop: LiveLoop, listener: socket.socket) -> None:
        self.served = 0
        """Number of connections so far."""
        self.disconnected: Counter[str] = Counter()
        """Number of connections that the server ended, by reason."""
        self._foreign_frames = 0
        self._loop = loop
        self._live: LiveSimulation = loop.live
        self._listener = listener
        self._clients: list[_Client] = []
        self._restless: dict[_Client, None] = {}
        """Clients for which `hand_on` has work; a dict keeps their order."""
        listener.setblocking(False)
        self._listen()
        loop.hand_on = self._hand_on
        self._live.view = self._show

    @property
    def clients(self) -> int:
        """Number of connected clients."""
        return len(self._clients)

    @property
    def foreign_frames(self) -> int:
        """Number of dropped frames of clients, of kinds that this bus does not carry."""
        return self._foreign_frames + sum(client.session.foreign_frames for client in self._clients)

    def close(self) -> None:
        """Disconnect all clients and close the listening socket."""
        if self._listener.fileno() < 0:
            return
        self._loop.watch(self._listener, 0, self._accept)
        self._listener.close()
        for client in list(self._clients):
            self._forget(client)

    # --- connections

    def _accept(self) -> None:
        try:
            sock, address = self._listener.accept()
        except OSError as error:
            if error.errno in _OUT_OF_FILES:
                self._rest()
            return  # otherwise the client has hung up already
        sock.setblocking(False)
        self.served += 1
        if len(self._clients) >= CLIENTS_MAX or sock.fileno() >= _SELECT_FILES:
            self.disconnected["too many clients"] += 1
            with suppress(OSError):
                sock.send(f"< error {len(self._clients)} clients are connected, no more are served >".encode("ascii"))
            sock.close()
            return
        sock.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        sock.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, _SEND_BUFFER_BYTES)
        client = _Client(sock, f"{address[0]}:{address[1]}")
        _log.info("%s connected", client.name)
        self._clients.append(client)
        self._tend(client)

    def _rest(self) -> None:
        """Accept no client for a while: one that waits would keep the loop awake although no file is left for it."""
        _log.warning("no file is left for another client")
        self._loop.watch(self._listener, 0, self._accept)
        self._loop.call_after(REST_S, self._listen)

    def _listen(self) -> None:
        if self._listener.fileno() >= 0:
            self._loop.watch(self._listener, EVENT_READ, self._accept)

    def _disconnect(self, client: _Client, reason: str) -> None:
        _log.info("%s disconnected: %s", client.name, reason)
        self.disconnected[reason] += 1
        self._forget(client)

    def _forget(self, client: _Client) -> None:
        """Close a client's connection; frames that it has sent are still delivered."""
        client.gone = True
        self._foreign_frames += client.session.foreign_frames
        self._clients.remove(client)
        self._restless.pop(client, None)
        self._loop.watch(client.socket, 0, lambda: None)
        client.socket.close()

    # --- a client has something to say, or reads on

    def _ready(self, client: _Client) -> None:
        """Serve a client whose socket can be read or written."""
        if client.waiting_frames < WINDOW_FRAMES:
            self._read(client)
        if not client.gone:
            self._tend(client)

    def _read(self, client: _Client) -> None:
        try:
            data = client.socket.recv(_READ_BYTES)
        except BlockingIOError:
            return
        except OSError:
            data = b""
        if data:
            client.session.feed(data)
        else:
            _log.info("%s has hung up", client.name)
            self._forget(client)

    def _tend(self, client: _Client) -> None:
        """Pass a client's frames on while its window has room, send it its answers, choose the events to wait for."""
        session = client.session
        was_silent = session.silent
        while client.waiting_frames < WINDOW_FRAMES and (frame := session.next_frame()):
            client.waiting_frames += 1
            self._live.send(frame, client, self._loop.looked_ns)
        if session.silent and not was_silent:
            self._loop.call_after(SILENCE_S, partial(self._end_silence, client))
        if session.outbox and not self._write(client):
            return
        if session.mode is SessionMode.CLOSED:
            self._disconnect(client, "junk")
        elif session.backlog_bytes > BACKLOG_MAX_BYTES:
            self._disconnect(client, "reads too slowly")
        else:
            self._watch(client)

    def _write(self, client: _Client) -> bool:
        """Send as much as the socket takes; return False if the client is gone."""
        outbox = client.session.outbox
        try:
            del outbox[: client.socket.send(outbox)]
        except BlockingIOError:
            pass
        except OSError:
            _log.info("%s is gone", client.name)
            self._forget(client)
            return False
        return True

    def _watch(self, client: _Client) -> None:
        reading = EVENT_READ if client.waiting_frames < WINDOW_FRAMES else 0
        events = reading | (EVENT_WRITE if client.session.outbox else 0)
        if events != client.events:
            client.events = events
            self._loop.watch(client.socket, events, partial(self._ready, client))

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
        if isinstance(sender, _Client):
            sender.waiting_frames -= 1
            if not sender.gone:
                self._restless[sender] = None

    def _hand_on(self) -> None:
        restless, self._restless = self._restless, {}
        for client in restless:
            if not client.gone:
                self._tend(client)
