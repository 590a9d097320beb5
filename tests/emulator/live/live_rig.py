"""A live board behind a socketcand server in a thread of this process, and clients that speak the protocol."""

import selectors
import socket
import threading
import time
from collections.abc import Callable
from contextlib import ExitStack

from steptwin.controller.motion.backend import fastest_kernel
from steptwin.emulator.board.board import Board, BoardConfig
from steptwin.emulator.bus.can_bus import Bus
from steptwin.emulator.live.live_loop import LiveLoop
from steptwin.emulator.live.live_simulation import LiveSimulation, Pacer, warm_up
from steptwin.emulator.live.socketcand import SocketcandServer
from steptwin.emulator.simulation import Simulation
from tests.emulator.pins import WIRES

TIMEOUT_S = 120.0
"""Limit of every wait; only a failing test reaches it, however busy the machine is."""


def await_true(condition: Callable[[], bool], what: str) -> None:
    """Wait until a condition holds that another thread or process brings about."""
    deadline_s = time.monotonic() + TIMEOUT_S
    while not condition():
        assert time.monotonic() < deadline_s, f"not within {TIMEOUT_S:g} s: {what}"
        time.sleep(0.002)


class LiveRig:
    """A board of two axes; a context manager."""

    def __init__(self, speed: float = 1.0) -> None:
        kernel = fastest_kernel()
        warm_up(kernel)
        self.bus = Bus(1_000_000, log=lambda _frame, _counts: None)
        self.board = Board(BoardConfig((WIRES,) * 2), kernel)
        self.live = LiveSimulation(Simulation([self.board], self.bus), Pacer(time.perf_counter_ns(), speed))
        self.loop = LiveLoop(self.live)
        listener = socket.create_server(("127.0.0.1", 0), backlog=64)
        self.port: int = listener.getsockname()[1]
        self.server = SocketcandServer(self.loop, listener)
        self._thread = threading.Thread(target=self._run)
        self._error: BaseException | None = None
        self._clients = ExitStack()

    def _run(self) -> None:
        try:
            self.loop.run()
        except BaseException as error:
            self._error = error
            raise

    def __enter__(self) -> "LiveRig":
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self.loop.stop()
        self._thread.join(TIMEOUT_S)
        assert not self._thread.is_alive()
        self.server.close()
        self.loop.__exit__(None, None, None)
        self._clients.close()
        assert self._error is None

    def client(self, receive_buffer_bytes: int | None = None) -> "RawClient":
        """Connect a client and bring it into raw mode."""
        client = RawClient(self.port, receive_buffer_bytes)
        self._clients.callback(client.close)
        return client


class RawClient:
    """A client that sends and reads bytes."""

    def __init__(self, port: int, receive_buffer_bytes: int | None = None) -> None:
        self._socket = socket.socket()
        self._socket.settimeout(TIMEOUT_S)
        if receive_buffer_bytes:
            self._socket.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, receive_buffer_bytes)
        self._socket.connect(("127.0.0.1", port))
        self.text = b""
        """Bytes that were read and not expected yet."""
        self.expect(b"< hi >")
        for command in (b"< open vcan0 >", b"< rawmode >"):
            self.send(command)
            self.expect(b"< ok >")

    def send(self, text: bytes) -> None:
        self._socket.sendall(text)

    def expect(self, text: bytes) -> bytes:
        """Read until these bytes have come; return the bytes before them."""
        while text not in self.text:
            more = self._socket.recv(1 << 16)
            assert more, f"disconnected before {text!r} after {self.text!r}"
            self.text += more
        before, _, self.text = self.text.partition(text)
        return before

    def frames(self, count: int) -> list[str]:
        """Return the next frames, as IDENTIFIER#DATA."""
        shown = [self.expect(b" >") for _ in range(count)]
        return ["#".join(text.decode("ascii").split(" ")[i] for i in (2, 4)) for text in shown]

    def until_hung_up(self) -> bytes:
        """Return all bytes up to the end of the connection."""
        while True:
            try:
                more = self._socket.recv(1 << 16)
            except ConnectionError:
                return self.text
            if not more:
                return self.text
            self.text += more

    @property
    def readable(self) -> bool:
        """Return True if bytes can be read now."""
        with selectors.DefaultSelector() as selector:
            selector.register(self._socket, selectors.EVENT_READ)
            return bool(selector.select(0))

    def close(self) -> None:
        self._socket.close()
