"""Serve the clients of a listening socket in a live board's loop; no client can block the loop.

All I/O is non-blocking. Bytes from a client are read while its protocol can accept them. Bytes for a client wait here
until it reads them; a client with too many unread bytes is disconnected.
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
"""Highest number of clients. The loop's `select` supports a thousand files, and each client is one."""
BACKLOG_MAX_BYTES: Final = 1 << 20
"""Highest number of unread bytes, in addition to the operating system's buffers: some 20 000 frames."""
ACCEPT_PAUSE_S: Final = 0.2
"""Pause of accepting clients after the operating system has run out of files."""
_OUT_OF_FILES: Final = (errno.EMFILE, errno.ENFILE, errno.ENOBUFS, errno.ENOMEM)
_SEND_BUFFER_BYTES: Final = 1 << 18
_READ_BYTES: Final = 4096

_log = logging.getLogger(__name__)


def select_files(system: str) -> float:
    """Return the lowest file number that `select` does not support, by `os.name`.

    It is FD_SETSIZE, except on Windows, where a socket's number is a handle of any size.
    """
    return 1024 if system == "posix" else inf


_SELECT_FILES = select_files(os.name)


class ClientSession(Protocol):
    """The protocol session of one client, without I/O."""

    outbox: bytearray
    """Bytes to send to the client; the server removes the sent ones."""

    def feed(self, data: bytes) -> None:
        """Process received bytes."""

    @property
    def closed(self) -> bool:
        """True if the client has violated the protocol and must be disconnected."""

    @property
    def backlog_bytes(self) -> int:
        """Number of unsent bytes for the client."""


SessionT = TypeVar("SessionT", bound=ClientSession)


class Client(Generic[SessionT]):
    """One connection."""

    def __init__(self, sock: socket.socket, name: str, session: SessionT) -> None:
        self.socket = sock
        self.name = name
        self.session = session
        self.waiting = 0
        """Number of its requests that wait for the board."""
        self.events = 0
        """Events of its socket for which the loop waits."""
        self.gone = False


class TcpServer(ABC, Generic[SessionT]):
    """Serves the clients of a listening socket, which the server owns and closes.

    Args:
        loop: loop of the board; all methods are called in its thread.
        listener: the listening socket.
        window: highest number of one client's requests that wait for the board; then no more is read from the client.
    """

    def __init__(self, loop: LiveLoop, listener: socket.socket, window: int) -> None:
        self.served: int = 0
        """Number of connections so far."""
        self.disconnected: Counter[str] = Counter()
        """Number of connections that the server has ended, by reason."""
        self._loop = loop
        self._live: LiveSimulation = loop.live
        self._listener = listener
        self._window = window
        self._clients: list[Client[SessionT]] = []
        listener.setblocking(False)
        self._listen()

    @abstractmethod
    def _new_session(self) -> SessionT:
        """Return the session of a new client."""

    @abstractmethod
    def _refusal(self, reason: str) -> bytes:
        """Return the message for a client that is not served."""

    @abstractmethod
    def _pass_on(self, client: Client[SessionT]) -> None:
        """Pass a client's requests to the board while fewer than `window` wait."""

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
                _log.warning("no file is left for another client")
                self._loop.watch(self._listener, 0, self._accept)  # a waiting client would keep the loop awake
                self._loop.call_after(ACCEPT_PAUSE_S, self._listen)
            return  # the client has already disconnected
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

    def _listen(self) -> None:
        if self._listener.fileno() >= 0:
            self._loop.watch(self._listener, EVENT_READ, self._accept)

    def _disconnect(self, client: Client[SessionT], reason: str) -> None:
        _log.info("%s disconnected: %s", client.name, reason)
        self.disconnected[reason] += 1
        self._forget(client)

    def _forget(self, client: Client[SessionT]) -> None:
        """Close a client's connection; its requests are still executed."""
        client.gone = True
        self._clients.remove(client)
        self._loop.watch(client.socket, 0, lambda: None)
        client.socket.close()

    # --- a client's socket is ready

    def _ready(self, client: Client[SessionT]) -> None:
        """Serve a client whose socket is readable or writable."""
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
        """Pass a client's requests to the board, send its answers, and select the events to wait for."""
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
        """Send as much as the socket accepts; return False if the client is gone."""
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
