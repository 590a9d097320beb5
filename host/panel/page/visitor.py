"""A browser that shows the page: who it is at the desk, and what it is told."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass

from nicegui import Client, ui

from steptwin.host.common.errors import StepTwinError
from steptwin.host.panel.desk import Command, Desk, RefusedError, told


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

    def __post_init__(self) -> None:
        self.tab = self.tab or self.page.id

    @property
    def operates(self) -> bool:
        """Whether this tab may move the machine."""
        return self.desk.operators.is_operator(self.tab)

    def ask(self, command: Command) -> bool:
        """Ask the desk for something; say why not, if it refuses. Return whether it has agreed."""
        return self.attempt(lambda: self.desk.ask(self.tab, command))

    def attempt(self, action: Callable[[], object]) -> bool:
        """Do something that the desk may refuse or that bad input ends, and say why; return whether it was done."""
        with self.explained() as outcome:
            action()
        return not outcome

    @contextmanager
    def explained(self) -> Iterator[list[str]]:
        """Show an error of the block as a message; the list that it yields holds the error's text afterwards."""
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
        for text in texts:
            self.tell(text)

    def tell(self, text: str, *, good: bool = False) -> None:
        """Show a short message."""
        with self.page:
            ui.notify(text, icon="check" if good else "info", position="bottom-left", timeout=6000)
