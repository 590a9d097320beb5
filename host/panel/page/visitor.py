"""A browser that shows the page: who it is at the desk, and what it is told."""

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Final, Literal

from nicegui import Client, ui

from steptwin.host.common.errors import StepTwinError
from steptwin.host.panel.desk import Command, Desk, RefusedError, told
from steptwin.host.panel.page.elements import Tone
from steptwin.host.panel.page.sockets import SHOWN

_STATIC: Final = Path(__file__).parent / "static"

_PRIMARY: Final = "#1257a8"
"""What is chosen: white text on it can be read in light and dark."""

FAVICON: Final = (
    '<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 32 32">'
    '<rect width="32" height="32" rx="7" fill="#1257a8"/>'
    '<path d="M7 25 L12 12 L24 9" fill="none" stroke="#fff" stroke-width="3.4" stroke-linecap="round"'
    ' stroke-linejoin="round"/><circle cx="12" cy="12" r="3" fill="#fff"/>'
    '<circle cx="24" cy="9" r="2.6" fill="#ffb4ae"/></svg>'
)


@cache
def _read(name: str) -> str:
    return (_STATIC / name).read_text(encoding="utf-8")


def apply_theme(*, script: bool = True) -> None:
    """Give the page of this browser the style sheet, and the panel's script unless the page has no machine."""
    ui.colors(primary=_PRIMARY)
    ui.add_head_html(f"<style>{_read('panel.css')}</style>")
    if script:
        ui.add_body_html(f"<script>{_read('panel.js')}</script>")


_KINDS: Final[dict[Tone, Literal["positive", "warning", "negative", "info"]]] = {
    "": "info",
    "good": "positive",
    "warn": "warning",
    "bad": "negative",
}
_ONCE_S: Final = 0.5
"""Time in which the same message is not shown again: an event and a refusal may have the same cause."""


@dataclass
class Visitor:
    """A browser's tab.

    Attributes:
        desk: the desk that it watches.
        page: the page that NiceGUI made for it.
        name: name by which others know it.
        tab: identity of the tab, which outlives a reload; the page's own until the tab has connected.
    """

    desk: Desk
    page: Client
    name: str = "a new browser"
    tab: str = ""
    _told: str = ""
    _told_s: float = 0.0

    def __post_init__(self) -> None:
        self.tab = self.tab or self.page.id

    @property
    def operates(self) -> bool:
        """Whether this tab may move the machine."""
        return self.desk.operators.is_operator(self.tab)

    def ask(self, command: Command) -> bool:
        """Ask the desk for something; say why not, if it refuses. Return whether it has agreed."""
        return self.attempt(lambda: self.desk.ask(self.tab, command, SHOWN.get()))

    def attempt(self, action: Callable[[], object]) -> bool:
        """Do something that the desk may refuse or that bad input ends, and say why; return whether it was done."""
        with self.explained() as outcome:
            action()
        return not outcome

    @contextmanager
    def explained(self, *, message: bool = True) -> Iterator[list[str]]:
        """Show an error of the block as a message, or let the caller: the list that is yielded has its text."""
        texts: list[str] = []
        try:
            yield texts
        except RefusedError as error:
            self.desk.events.warning(f"refused to {self.name}: {error}")
            texts.append(str(error))
        except StepTwinError as error:
            texts.append(told(error))
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
