"""A browser that shows the page: who it is to the service, what it is told, and what its web socket carries.

Beside NiceGUI's own messages the socket carries emergency stops. And the page's script adds the number of the newest
state that it had shown to each event that it sends (`shown`): an event that was held up keeps that of its click.
"""

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any, Final, Literal

from nicegui import Client, app, core, ui
from starlette.requests import Request
from starlette.responses import JSONResponse, Response

from steptwin.features.panel.page.elements import Tone
from steptwin.features.panel.service.commands import Command
from steptwin.features.panel.service.messages import RefusedError, operator_message
from steptwin.features.panel.service.service import MachineService
from steptwin.host.common.errors import StepTwinError

_COLOURS: Final = {"primary": "#1257a8", "positive": "#1b6e3c", "negative": "#b3161b", "info": "#1257a8"}
"""Colours of chosen buttons and of messages: white text on them can be read in light and dark."""

FAVICON: Final = (
    '<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 32 32">'
    '<rect width="32" height="32" rx="7" fill="#1257a8"/>'
    '<path d="M7 25 L12 12 L24 9" fill="none" stroke="#fff" stroke-width="3.4" stroke-linecap="round"'
    ' stroke-linejoin="round"/><circle cx="12" cy="12" r="3" fill="#fff"/>'
    '<circle cx="24" cy="9" r="2.6" fill="#ffb4ae"/></svg>'
)


@cache
def _static(name: str) -> str:
    return (Path(__file__).parent / "static" / name).read_text(encoding="utf-8")


def apply_theme(*, script: bool = True) -> None:
    """Give the page of this browser the style sheet, and the panel's script unless the page has no machine."""
    ui.colors(**_COLOURS)
    ui.add_head_html(f"<style>{_static('panel.css')}</style>")
    if script:
        ui.add_body_html(f"<script>{_static('panel.js')}</script>")


SHOWN: Final[ContextVar[int | None]] = ContextVar("shown", default=None)
"""Number of the newest state that the page had shown when it sent the event that is handled now."""
_KINDS: Final[dict[Tone, Literal["positive", "warning", "negative", "info"]]] = {
    "": "info",
    "good": "positive",
    "warn": "warning",
    "bad": "negative",
}
_ONCE_S: Final = 0.5
"""Time without the same message: an event and a refusal may have the same cause."""


@dataclass
class Visitor:
    """A browser's tab.

    Attributes:
        service: the machine service that it watches.
        page: the page that NiceGUI made for it.
        name: name by which others know it.
        tab: identity of the tab, which outlives a reload; the page's own until the tab has connected.
    """

    service: MachineService
    page: Client
    name: str = "a new browser"
    tab: str = ""
    _told: str = ""
    _told_s: float = 0.0

    def __post_init__(self) -> None:
        self.tab = self.tab or self.page.id

    @property
    def operates(self) -> bool:
        """True if this tab may move the machine."""
        return self.service.operator.is_operator(self.tab)

    def ask(self, command: Command) -> bool:
        """Request something; say why not, if the service refuses. Return whether it has agreed."""
        return self.attempt(lambda: self.service.ask(self.tab, command, SHOWN.get()))

    def attempt(self, action: Callable[[], object]) -> bool:
        """Do something that may be refused or that bad input ends, and say why; return whether it was done."""
        with self.explained() as outcome:
            action()
        return not outcome

    @contextmanager
    def explained(self, *, message: bool = True) -> Iterator[list[str]]:
        """Show an error of the block as a message, or let the caller: the list that is yielded has its text."""
        texts: list[str] = []
        try:
            yield texts
        except StepTwinError as error:
            texts.append(operator_message(error))
            if isinstance(error, RefusedError):
                self.service.events.warning(f"refused to {self.name}: {error}")
        except OSError as error:
            texts.append(f"{error.filename or 'file'}: {error.strerror}")
        for text in texts if message else ():
            self.tell(text)

    def tell(self, text: str, tone: Tone = "bad") -> None:
        """Show a short message, one that is an error by default; the same cause is told once."""
        now_s = time.monotonic()
        if text == self._told and now_s - self._told_s < _ONCE_S:
            return
        self._told, self._told_s = text, now_s
        with self.page:
            ui.notify(text, type=_KINDS[tone], position="bottom-left", timeout=6000)

    def withdraw(self) -> None:
        """Take the messages of errors away: what they told of is over."""
        self._told = ""
        with self.page:
            ui.run_javascript("window.withdrawErrors?.()")


# --- what a web socket carries

_SPACE: Final = "/"
_EVENT: Final = "event"
_PRESS_MAX: Final = 64
"""Most characters of the name of a press."""

Answer = dict[str, bool]
"""Answer to a page's stop: `told` says whether the machine was told of it."""


class _Noting:
    """Hands an event on, with `SHOWN` as it says; drops what is no event."""

    def __init__(self, handle: Callable[[str, Any], None]) -> None:
        self._handle = handle

    def __call__(self, sid: str, message: Any = None) -> None:
        if not isinstance(message, dict):
            return
        shown = message.pop("shown", None)
        SHOWN.set(shown if type(shown) is int else None)
        self._handle(sid, message)


def note_shown() -> None:
    """Note the state that pages had shown with each of their events, from now on."""
    handle = core.sio.handlers[_SPACE][_EVENT]
    if not isinstance(handle, _Noting):
        core.sio.on(_EVENT, _Noting(handle))


def on_stop(name: str, stop: Callable[[str | None, str | None], Answer]) -> None:
    """Call `stop` with the page and the press when a page sends a stop of this name, by its socket or a request.

    A press has a name that the page gives it. It comes on both ways, and again until it is answered: the socket may be
    dead, and the request comes on a connection of its own.
    """

    def by_socket(sid: str, press: object = None) -> Answer:
        rooms = [room for room in core.sio.rooms(sid) if room != sid]  # a page's socket is in a room named after it
        return stop(rooms[0] if rooms else None, None if press is None else str(press)[:_PRESS_MAX])

    async def by_request(request: Request) -> Response:
        query = request.query_params
        press = query.get("press")
        return JSONResponse(stop(query.get("page"), None if press is None else press[:_PRESS_MAX]))

    core.sio.on(name, by_socket)
    app.add_route(f"/{name}", by_request, methods=["POST"])
