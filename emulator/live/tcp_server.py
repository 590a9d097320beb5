"""Serve the clients of a listening socket in a live board's loop, which no client may hold up.

Nothing here waits: what a client sends is read as far as its protocol has room for it, and what is for a client waits
here until it reads. A client that does not read is disconnected before too many bytes wait.
"""

import errno
import logging
import os
import socket
from abc import ABC, abstractmethod
from collections import Counter
from contextlib import suppress
from functools import partial
from math import inf
from selectors import EVENT_READ, EVENT_WRITE
from typing import Final, Generic, Protocol, TypeVar

from steptwin.emulator.live.live_loop import LiveLoop
from steptwin.emulator.live.live_simulation import LiveSimulation

CLIENTS_MAX: Final = 250
"""Greatest number of clients; the loop's `select` takes a thousand files at most, and each client is one."""
BACKLOG_MAX_BYTES: Final = 1 << 20
"""Bytes that a client may leave unread beside the operating system's buffers: some 20 000 frames."""
REST_S: Final = 0.2
"""Time for which no client is accepted after the operating system had no file for a client."""
_OUT_OF_FILES: Final = (errno.EMFILE, errno.ENFILE, errno.ENOBUFS, errno.ENOMEM)
_SEND_BUFFER_BYTES: Final = 1 << 18
_READ_BYTES: Final = 4096

_log = logging.getLogger(__name__)


def select_files(system: str) -> float:
    """Return the number of a file from which on `select` cannot wait for it, by `os.name`.

    FD_SETSIZE counts all files of a process, except on Windows: there a socket's number is a handle of any size.
    """
    return 1024 if system == "posix" else inf


_SELECT_FILES = select_files(os.name)


class ClientSession(Protocol):
    """The dialogue with one client, without I/O."""

    outbox: bytearray
    """Bytes to send to the client; the server removes what it has sent."""

    def feed(self, data: bytes) -> None:
        """Take bytes that have come from the client."""

    @property
    def closed(self) -> bool:
        """True if the client broke the protocol and must be disconnected."""

    @property
    def backlog_bytes(self) -> int:
        """Number of bytes that wait to be sent to the client."""


SessionT = TypeVar("SessionT", bound=ClientSession)


class Client(Generic[SessionT]):
    """One connection."""

    def __init__(self, sock: socket.socket, name: str, session: SessionT) -> None:
        self.socket = sock
        self.name = name
        self.session = session
        self.waiting = 0
        """Number of things that it asked for and that wait for the board."""
        self.events = 0
        """Events for which its socket is watched."""
        self.gone = False


class TcpServer(ABC, Generic[SessionT]):
    """Serves the clients of a listening socket, which the server owns and closes.

    Args:
        loop: the board's loop, in whose thread all methods are called.
        listener: the listening socket.
        window: number of things of one client that may wait for the board; meanwhile nothing more is read from it.
    """

    def __init__(self, loop: LiveLoop, listener: socket.socket, window: int) -> None:
        self.served: int = 0
        """Number of connections so far."""
        self.disconnected: Counter[str] = Counter()
        """Number of connections that the server ended, by reason."""
        self._loop = loop
        self._live: LiveSimulation = loop.live
        self._listener = listener
        self._window = window
        self._clients: list[Client[SessionT]] = []
        listener.setblocking(False)
        self._listen()

    @abstractmethod
    def _new_session(self) -> SessionT:
        """Return the dialogue with a new client."""

    @abstractmethod
    def _refusal(self, reason: str) -> bytes:
        """Return what a client is told that is not served."""

    @abstractmethod
    def _pass_on(self, client: Client[SessionT]) -> None:
        """Pass what a client has asked for on to the board while its window has room."""

    @property
    def clients(self) -> int:
        """Number of connected clients."""
        return len(self._clients)

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
                sock.send(self._refusal(f"{len(self._clients)} clients are connected, no more are served"))
            sock.close()
            return
        sock.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        sock.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, _SEND_BUFFER_BYTES)
        client = Client(sock, f"{address[0]}:{address[1]}", self._new_session())
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

    def _disconnect(self, client: Client[SessionT], reason: str) -> None:
        _log.info("%s disconnected: %s", client.name, reason)
        self.disconnected[reason] += 1
        self._forget(client)

    def _forget(self, client: Client[SessionT]) -> None:
        """Close a client's connection; what it has asked for is still done."""
        client.gone = True
        self._clients.remove(client)
        self._loop.watch(client.socket, 0, lambda: None)
        client.socket.close()

    # --- a client has something to say, or reads on

    def _ready(self, client: Client[SessionT]) -> None:
        """Serve a client whose socket can be read or written."""
        if client.waiting < self._window:
            self._read(client)
        if not client.gone:
            self._tend(client)

    def _read(self, client: Client[SessionT]) -> None:
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

    def _tend(self, client: Client[SessionT]) -> None:
        """Pass on what a client asks for, send it its answers, choose the events to wait for."""
        session = client.session
        self._pass_on(client)
        if session.outbox and not self._write(client):
            return
        if session.closed:
            self._disconnect(client, "junk")
        elif session.backlog_bytes > BACKLOG_MAX_BYTES:
            self._disconnect(client, "reads too slowly")
        else:
            self._watch(client)

    def _write(self, client: Client[SessionT]) -> bool:
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

    def _watch(self, client: Client[SessionT]) -> None:
        reading = EVENT_READ if client.waiting < self._window else 0
        events = reading | (EVENT_WRITE if client.session.outbox else 0)
        if events != client.events:
            client.events = events
            self._loop.watch(client.socket, events, partial(self._ready, client))
