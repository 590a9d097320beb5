"""Serve a page in a browser until Ctrl-C: one port, the guard before everything, and nothing from other hosts."""

import gc
import socket
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Final

import uvicorn
from fastapi import FastAPI
from nicegui import ui

from steptwin.host.client.connecting import address_text, in_url
from steptwin.host.common.errors import BusError
from steptwin.host.common.listening import is_loopback, listen
from steptwin.host.common.signals import on_signals
from steptwin.host.panel.page.guard import TOKEN, Guard, local_access, remote_access
from steptwin.host.panel.page.theme import FAVICON

PORT: Final = 8090
"""Port at which the page is, unless another one is asked for or it is in use."""

_RECONNECT_S: Final = 20.0
"""Time for which a page that has lost its connection is kept: a laptop's radio may take that long to come back."""
_GRACE_S: Final = 1
"""Time that open pages have to finish their requests when the server ends."""


@dataclass(frozen=True, slots=True)
class Address:
    """Where the page listens; `port` None takes PORT, or a free one if it is in use.

    Attributes:
        host: address of this machine.
        port: TCP port; 0 takes a free one.
        allow_remote: let other machines reach the page, with a token.
    """

    host: str = "127.0.0.1"
    port: int | None = None
    allow_remote: bool = False


def serve_page(build: Callable[[], None], listener: socket.socket, title: str, announce: Callable[[str], None]) -> None:
    """Serve a page at a socket of `open_port` until Ctrl-C or SIGTERM.

    Args:
        build: makes the page's elements for each browser that opens it.
        listener: where browsers connect; other machines need a token, which the URL has.
        title: title of the page.
        announce: called with the page's URL when browsers can open it.
    """
    host, port = listener.getsockname()[:2]
    access = local_access(port, in_url(host)) if is_loopback(host) else remote_access(port)
    app = FastAPI(openapi_url=None)
    ui.run_with(
        app,
        root=build,
        title=title,
        favicon=FAVICON,
        dark=None,
        language="en-US",
        binding_refresh_interval=None,
        reconnect_timeout=_RECONNECT_S,
        tailwind=False,
        show_welcome_message=False,
    )
    token = "" if access.token is None else f"?{TOKEN}={access.token}"
    url = f"http://{address_text(_reachable(host), port)}/{token}"
    config = uvicorn.Config(
        Guard(app, access),
        log_level="error",
        access_log=False,
        server_header=False,
        timeout_graceful_shutdown=_GRACE_S,
    )
    gc.freeze()  # NiceGUI looks for the server among all objects: one of canopen's raises an error when looked at
    try:
        _Server(config, lambda: announce(url)).run(sockets=[listener])
    finally:
        gc.unfreeze()


def open_port(address: Address) -> socket.socket:
    """Return a socket that listens at an address.

    Raises:
        InputError: the address does not exist, or other machines reach it and that is not allowed.
        BusError: the port is in use.
    """
    if address.port is not None:
        return listen(address.host, address.port, allow_remote=address.allow_remote)
    try:
        return listen(address.host, PORT, allow_remote=address.allow_remote)
    except BusError:  # a second panel on this machine
        return listen(address.host, 0, allow_remote=address.allow_remote)


class _Server(uvicorn.Server):
    """A server that says when it has started, and that a signal ends without being raised again."""

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


def _reachable(host: str) -> str:
    """Return an address under which others find this machine: its name where it listens at all of its addresses."""
    return socket.gethostname() if host in ("0.0.0.0", "::") else host
