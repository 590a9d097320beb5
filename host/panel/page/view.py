"""The interface of a view: a part of the page that follows the machine."""

from typing import Protocol

from steptwin.host.panel.desk import Snapshot


class View(Protocol):
    """A part of the page."""

    def refresh(self, snapshot: Snapshot) -> None:
        """Show what has changed; called whenever something has, but not for numbers that always change."""
        ...
