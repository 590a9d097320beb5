"""Define the place at which other programs reach a live board."""

from abc import ABC, abstractmethod
from typing import Any, ClassVar

from steptwin.emulator.live_loop import LiveLoop


class Endpoint(ABC):
    """A listening socket or a bus of python-can, open from its construction until `close`."""

    kind: ClassVar[str]
    """Key under which the report holds its figures."""
    title: str
    """The place of the board, and the way to connect to it."""
    port: int | None = None
    """TCP port of a listening socket."""
    remote: bool = False
    """True if other machines reach a listening socket."""

    @abstractmethod
    def attach(self, loop: LiveLoop) -> None:
        """Connect the endpoint with a live board."""

    @abstractmethod
    def close(self) -> None:
        """Disconnect. An endpoint that is attached to a loop must be closed before the loop."""

    @abstractmethod
    def status(self) -> str:
        """Return the present state in a few words."""

    @abstractmethod
    def figures(self) -> dict[str, Any]:
        """Return the figures for the report."""

    @property
    def failure(self) -> str | None:
        """Reason why the endpoint no longer works; None while it does."""
        return None
