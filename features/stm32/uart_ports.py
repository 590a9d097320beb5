"""USART1 of a served image at a TCP port and a pseudo terminal, for programs such as G-code senders."""

import os
import socket
from collections.abc import Callable, Sequence
from contextlib import suppress
from typing import Final

from steptwin.features.stm32.firmware import ImageFirmware
from steptwin.host.common.listening import LOOPBACK, listen
from steptwin.protocol.timer import COUNTS_PER_MS

_READ_BYTES: Final = 4096
_BACKLOG_BYTES: Final = 1 << 16
"""Bytes that a program may leave unread; a TCP client beyond them is disconnected, a terminal loses them."""
_CLIENTS_MAX: Final = 8


class UartPorts:
    """Passes bytes between USART1 and programs, once a millisecond; all programs see what it sends.

    Raises:
        InputError: the port does not exist.
        BusError: the port is in use.
    """

    def __init__(self, port: int) -> None:
        """Listen at a TCP port of this machine, 0 for a free one, and open a terminal where the system has them."""
        self._listener = listen(LOOPBACK, port, "uart_port")
        self._listener.setblocking(False)
        self._clients: dict[socket.socket, bytearray] = {}
        self._terminal, self._other_end = _open_terminal()
        self._for_terminal = bytearray()
        self._running: Callable[[], ImageFirmware] | None = None
        self._sent = 0
        self._due_counts = 0

    @property
    def port(self) -> int:
        """The TCP port."""
        return int(self._listener.getsockname()[1])

    def connect(self, running: Callable[[], ImageFirmware]) -> None:
        """Take bytes of the firmware that runs."""
        self._running = running

    def described(self) -> Sequence[str]:
        """Return where programs find it."""
        terminal = "" if self._other_end < 0 else f", and the terminal {os.ttyname(self._other_end)}"
        return (f"USART1 at tcp://{LOOPBACK}:{self.port}{terminal}",)

    def close(self) -> None:
        """Disconnect all programs."""
        for each in (*self._clients, self._listener):
            each.close()
        self._clients.clear()
        for end in (self._terminal, self._other_end):
            if end >= 0:
                os.close(end)
        self._terminal = self._other_end = -1

    @property
    def next_due_counts(self) -> int | None:
        """When it looks next."""
        return self._due_counts

    def step(self, now_counts: int) -> None:
        """Pass bytes both ways, if it is time."""
        if now_counts < self._due_counts or self._running is None or self._listener.fileno() < 0:
            return
        self._due_counts = now_counts + COUNTS_PER_MS
        chip = self._running().chip
        if chip is None:
            return
        with suppress(OSError):
            while len(self._clients) < _CLIENTS_MAX:
                client, _ = self._listener.accept()
                client.setblocking(False)
                self._clients[client] = bytearray()
        if given := self._received():
            chip.give(0, given)
        count = chip.sent_count(0)
        self._sent = self._sent if self._sent <= count else 0  # fewer after a power-up
        if count > self._sent:
            self._queue(chip.sent(0)[self._sent - count :])
            self._sent = count
        self._pass_on()

    def _received(self) -> bytes:
        """Return what programs have sent; a client that has hung up is dropped."""
        given = b""
        for client in [*self._clients]:
            try:
                data = client.recv(_READ_BYTES)
            except BlockingIOError:
                continue
            except OSError:
                data = b""
            if data:
                given += data
            else:
                self._drop(client)
        if self._terminal >= 0:
            with suppress(OSError):
                given += os.read(self._terminal, _READ_BYTES)
        return given

    def _queue(self, data: bytes) -> None:
        for waiting in self._clients.values():
            waiting.extend(data)
        if self._terminal >= 0:
            self._for_terminal = (self._for_terminal + data)[-_BACKLOG_BYTES:]

    def _pass_on(self) -> None:
        for client, waiting in [*self._clients.items()]:
            try:
                del waiting[: client.send(waiting) if waiting else 0]
            except BlockingIOError:
                pass
            except OSError:
                self._drop(client)
                continue
            if len(waiting) > _BACKLOG_BYTES:
                self._drop(client)
        if self._for_terminal:
            with suppress(OSError):
                del self._for_terminal[: os.write(self._terminal, self._for_terminal)]

    def _drop(self, client: socket.socket) -> None:
        del self._clients[client]
        client.close()


def _open_terminal() -> tuple[int, int]:
    """Return both ends of a raw pseudo terminal, -1 and -1 where the system has none.

    The other end stays open here: else each program that closes it would end the terminal.
    """
    try:
        import pty
        import tty
    except ImportError:
        return -1, -1
    own, other = pty.openpty()
    tty.setraw(other)
    os.set_blocking(own, False)
    return own, other
