"""The log of what has happened, in words, until a user clears it."""

import time
from typing import Final

from nicegui import ui

from steptwin.host.panel.desk import Event, Severity, Snapshot
from steptwin.host.panel.page.elements import card, choice, heading, line, plain
from steptwin.host.panel.page.visitor import Visitor

_SHOWN: Final = 200
"""Events that a page shows; the desk keeps more."""
_FILTERS: Final = {"all": "all", "problems": "problems only"}
_WORDS: Final = {Severity.INFO: "info", Severity.WARNING: "warning", Severity.ERROR: "error"}


class EventLogView:
    """The newest events first."""

    def __init__(self, visitor: Visitor) -> None:
        self._visitor = visitor
        self._log = visitor.desk.events
        self._told = max((event.number for event in self._log.since()), default=0)
        """Number of the last event that this browser need not be told of as a message."""
        self._filter = "all"
        self._shown: list[int] = []
        """Numbers of the events in the list, the oldest first."""
        with card(classes="panel-wide place-events"):
            with line("between"):
                heading("What has happened")
                with line("tight"):
                    choice("events to show", _FILTERS, self._filter, self._choose)
                    plain("Clear", self._log.clear)
            self._list = ui.element("div").classes("events").props('role=log aria-label="events" tabindex=0')

    def refresh(self, snapshot: Snapshot) -> None:
        """Show the events that have come; those that were cleared go."""
        self._tell(snapshot)
        self._show(self._wanted())

    def _tell(self, snapshot: Snapshot) -> None:
        """Show what has failed as a message, too, since the log is at the page's end."""
        for event in self._log.since(self._told):
            self._told = event.number
            if event.severity is Severity.ERROR and snapshot.connected:  # the banner says that it is not
                self._visitor.tell(event.text)

    def _wanted(self) -> list[Event]:
        events = self._log.since()
        return [event for event in events if self._filter == "all" or event.severity is not Severity.INFO][-_SHOWN:]

    def _choose(self, name: str) -> None:
        self._filter = name
        self._list.clear()
        self._shown = []
        self._show(self._wanted())

    def _show(self, events: list[Event]) -> None:
        numbers = [event.number for event in events]
        if self._shown and (not numbers or numbers[0] != self._shown[0]):
            self._list.clear()
            self._shown = []
        for event in events[len(self._shown) :]:
            with self._list:
                _row(event).move(self._list, target_index=0)
        self._shown = numbers


def _row(event: Event) -> ui.element:
    with ui.element("div").classes(f"event {event.severity}") as row:
        ui.label(time.strftime("%H:%M:%S", time.localtime(event.wall_s))).classes("muted number")
        ui.label(_WORDS[event.severity]).classes("kind")
        ui.label(event.text)
    return row
