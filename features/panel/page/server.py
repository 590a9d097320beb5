"""Serve a page in a browser until Ctrl-C: one port, guarded, without content from other hosts."""

import logging
import socket
import traceback
from collections.abc import Awaitable, Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import uvicorn
from fastapi import FastAPI
from nicegui import ui

from steptwin.features.panel.page.guard import TOKEN, Guard, local_access, remote_access
from steptwin.features.panel.page.visitor import FAVICON
from steptwin.host.client.links import address_text, in_url
from steptwin.host.common.bad_input import printable, shortened
from steptwin.host.common.errors import BusError
from steptwin.host.common.listening import is_loopback, listen
from steptwin.host.common.processes import collecting_often, on_signals

PORT: Final = 8090
"""Default port of the page."""

_RECONNECT_S: Final = 20.0
"""Time for which a page without connection is kept; a laptop's radio may take as long to reconnect."""
_BUILD_S: Final = 60.0
"""Longest time to build a page on a slow computer; a browser waits longer."""
_GRACE_S: Final = 1
"""Time for open pages to finish their requests when the server ends."""


class OneLine(logging.Formatter):
    """Formats an error of a page's event as one line with its origin: a browser may send any value in an event."""

    def format(self, record: logging.LogRecord) -> str:
        """Return the line for a record."""
        text, error = record.getMessage(), record.exc_info[1] if record.exc_info else None
        if error is not None:
            at = traceback.extract_tb(error.__traceback__)[-1]
            told = shortened(str(error))
            text = f"{type(error).__name__}: {told} (in {at.name}, {Path(at.filename).name}:{at.lineno})"
        return f"steptwin: panel: {printable(text)}"


@dataclass(frozen=True, slots=True)
class Address:
    """Address of the page; `port` None takes PORT, or a free one if it is in use, and 0 a free one.

    `allow_remote` lets other machines reach the page, with a token.
    """

    host: str = "127.0.0.1"
    port: int | None = None
    allow_remote: bool = False


def serve_page(
    build: Callable[[], Awaitable[None] | None],
    listener: socket.socket,
    title: str,
    announce: Callable[[str], None],
) -> None:
    """Serve a page at a socket of `open_port` until Ctrl-C or SIGTERM.

    Args:
        build: creates the page's elements for each browser that opens it.
        listener: socket for browsers; other machines need the token in the URL.
        title: title of the page.
        announce: called with the page's URL when it is ready.
    """
    host, port = listener.getsockname()[:2]
    access = local_access(port, in_url(host)) if is_loopback(host) else remote_access(port)
    app = FastAPI(openapi_url=None)
    ui.page("/", response_timeout=_BUILD_S)(build)
    ui.run_with(
        app,
        title=title,
        favicon=FAVICON,
        dark=None,
        language="en-US",
        binding_refresh_interval=None,
        reconnect_timeout=_RECONNECT_S,
        tailwind=False,
        show_welcome_message=False,
    )
    log = logging.getLogger("nicegui")  # exceptions of a page's events, a line each
    if not any(isinstance(handler.formatter, OneLine) for handler in log.handlers):
        handler = logging.StreamHandler()
        handler.setFormatter(OneLine())
        log.addHandler(handler)
    log.propagate = False
    token = "" if access.token is None else f"?{TOKEN}={access.token}"
    reachable = socket.gethostname() if host in ("0.0.0.0", "::") else host
    url = f"http://{address_text(reachable, port)}/{token}"
    config = uvicorn.Config(
        Guard(app, access),
        log_level="error",
        access_log=False,
        server_header=False,
        timeout_graceful_shutdown=_GRACE_S,
    )
    logging.getLogger("uvicorn.error").addFilter(is_own_fault)
    # A page is ten thousand objects with cyclic references. NiceGUI searches all objects that are not frozen for the
    # server; one of canopen's raises an error when examined.
    with collecting_often():
        _Server(config, lambda: announce(url)).run(sockets=[listener])


def is_own_fault(record: logging.LogRecord) -> bool:
    """Return whether the server's log keeps a record: text that is not UTF-8 is a client's error."""
    return not (record.exc_info and isinstance(record.exc_info[1], UnicodeDecodeError))


def open_port(address: Address) -> socket.socket:
    """Return a socket that listens at an address.

    Raises:
        InputError: the address does not exist, or other machines reach it and that is not allowed.
        BusError: the port is in use.
    """
    wanted = PORT if address.port is None else address.port
    try:
        return listen(address.host, wanted, allow_remote=address.allow_remote)
    except BusError:  # for a second panel on this machine
        if address.port is not None:
            raise
        return listen(address.host, 0, allow_remote=address.allow_remote)


class _Server(uvicorn.Server):
    """A server that reports its start, and that a signal ends without raising it again."""

    def __init__(self, config: uvicorn.Config, announce: Callable[[], None]) -> None:
        super().__init__(config)
        self._announce = announce

    async def startup(self, sockets: list[socket.socket] | None = None) -> None:
        await super().startup(sockets)
        if self.started:
            self._announce()

    @contextmanager
    def capture_signals(self) -> Iterator[None]:
        with on_signals(self.handle_exit):
            yield
