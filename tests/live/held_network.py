"""A network between a browser and its page that can be held up, or swallow what is sent: a SOCKS proxy (RFC 1928)."""

import socket
import threading
from contextlib import suppress
from typing import Final, Self

_CONNECTED: Final = b"\x05\x00\x00\x01\x00\x00\x00\x00\x00\x00"


class HeldNetwork:
    """Passes connections on until it is held; a context manager.

    Attributes:
        flags: the options that let Chromium reach everything, this computer too, by this network.
    """

    def __init__(self) -> None:
        self._listener = socket.create_server(("127.0.0.1", 0))
        port = self._listener.getsockname()[1]
        self.flags = (f"--proxy-server=socks5://127.0.0.1:{port}", "--proxy-bypass-list=<-loopback>")
        self._flows = threading.Event()
        self._flows.set()
        self._swallowed: set[socket.socket] = set()
        self._dead = False
        self._open: list[socket.socket] = []

    def __enter__(self) -> Self:
        threading.Thread(target=self._accept, daemon=True).start()
        return self

    def __exit__(self, *_: object) -> None:
        self._flows.set()
        for each in (self._listener, *self._open):
            with suppress(OSError):
                each.shutdown(socket.SHUT_RDWR)
            each.close()

    def hold(self) -> None:
        """Let nothing through, in either direction, until `release`; nothing is lost."""
        self._flows.clear()

    def release(self) -> None:
        """Let everything through, also what was held."""
        self._flows.set()

    def swallow(self, *, new: bool) -> None:
        """Lose what comes by the connections that are open, which stay so; with `new`, what others bring, too."""
        self._swallowed |= set(self._open)
        self._dead = new

    def _accept(self) -> None:
        with suppress(OSError):
            while True:
                client, _ = self._listener.accept()
                self._open.append(client)
                threading.Thread(target=self._serve, args=(client,), daemon=True).start()

    def _serve(self, client: socket.socket) -> None:
        with suppress(OSError):
            methods = _exactly(client, 2)[1]
            _exactly(client, methods)
            client.sendall(b"\x05\x00")
            length = _exactly(client, 5)[4]  # of a name, as which Chromium sends an address too
            host, port = _exactly(client, length).decode("ascii"), int.from_bytes(_exactly(client, 2), "big")
            server = socket.create_connection((host, port))
            self._open.append(server)
            if self._dead:
                self._swallowed |= {client, server}
            client.sendall(_CONNECTED)
            threading.Thread(target=self._pump, args=(server, client), daemon=True).start()
            self._pump(client, server)

    def _pump(self, source: socket.socket, sink: socket.socket) -> None:
        with suppress(OSError):
            while data := source.recv(1 << 16):
                self._flows.wait()
                if source not in self._swallowed:
                    sink.sendall(data)
            sink.shutdown(socket.SHUT_RDWR)


def _exactly(source: socket.socket, count: int) -> bytes:
    data = b""
    while len(data) < count:
        more = source.recv(count - len(data))
        if not more:
            raise ConnectionError
        data += more
    return data
