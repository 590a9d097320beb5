"""A browser with the page: its identity for the service, its messages, and the content of its web socket.

Besides NiceGUI's own messages the socket carries emergency stops. The page's script also adds the number of the newest
state that it had shown to each event (`shown`). A delayed event keeps the number of its click.
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
"""Colours of chosen buttons and of messages; white text on them is readable in light and dark."""

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
    """Give this page the style sheet, and the panel's script if it has a machine."""
    ui.colors(**_COLOURS)
    ui.add_head_html(f"<style>{_static('panel.css')}</style>")
    if script:
        ui.add_body_html(f"<script>{_static('panel.js')}</script>")


SHOWN: Final[ContextVar[int | None]] = ContextVar("shown", default=None)
"""Number of the newest state that the page had shown when it sent the event in progress."""
_KINDS: Final[dict[Tone, Literal["positive", "warning", "negative", "info"]]] = {
    "": "info",
    "good": "positive",
    "warn": "warning",
    "bad": "negative",
}
_ONCE_S: Final = 0.5
"""Time before a message may be repeated: an event and a refusal may have the same cause."""


@dataclass
class Visitor:
    """A browser's tab.

    Attributes:
        service: machine service that it watches.
        page: NiceGUI's page.
        name: its name for other users.
        tab: identity of the tab, which survives a reload; the page's own until the tab has connected.
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
        """Request a command; show the reason if the service refuses. Return whether it has accepted."""
        return self.attempt(lambda: self.service.ask(self.tab, command, SHOWN.get()))

    def attempt(self, action: Callable[[], object]) -> bool:
        """Execute an action that may be refused or raise InputError; show the reason, and return the success."""
        with self.explained() as outcome:
            action()
        return not outcome

    @contextmanager
    def explained(self, *, message: bool = True) -> Iterator[list[str]]:
        """Show an error of the block as a message, or leave that to the caller; the yielded list gets its text."""
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
        """Show a short message, by default an error; repetitions within _ONCE_S are dropped."""
        now_s = time.monotonic()
        if text == self._told and now_s - self._told_s < _ONCE_S:
            return
        self._told, self._told_s = text, now_s
        with self.page:
            ui.notify(text, type=_KINDS[tone], position="bottom-left", timeout=6000)

    def withdraw(self) -> None:
        """Remove error messages whose cause is over."""
        self._told = ""
        with self.page:
            ui.run_javascript("window.withdrawErrors?.()")


# --- content of a web socket

_SPACE: Final = "/"
_EVENT: Final = "event"
_PRESS_MAX: Final = 64
"""Longest name of a press."""

Answer = dict[str, bool]
"""Answer to a page's stop: `told` is True if the machine received it."""


class _Noting:
    """Passes events on with `SHOWN` set; drops anything else."""

    def __init__(self, handle: Callable[[str, Any], None]) -> None:
        self._handle = handle

    def __call__(self, sid: str, message: Any = None) -> None:
        if not isinstance(message, dict):
            return
        shown = message.pop("shown", None)
        SHOWN.set(shown if type(shown) is int else None)
        self._handle(sid, message)


def note_shown() -> None:
    """Set `SHOWN` from each event of pages from now on."""
    handle = core.sio.handlers[_SPACE][_EVENT]
    if not isinstance(handle, _Noting):
        core.sio.on(_EVENT, _Noting(handle))


def on_stop(name: str, stop: Callable[[str | None, str | None], Answer]) -> None:
    """Call `stop` with the page and the press when a page sends a stop of this name, by its socket or a request.

    The page names each press. A press arrives by both paths, repeatedly until it is answered: the socket may be dead,
    and a request has a connection of its own.
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
