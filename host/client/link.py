"""What the client needs of a bus: a CANopen network and a way to wait that knows which clock counts."""

from typing import Protocol

import canopen


class Link(Protocol):
    """A connection to a bus, in virtual or in real time."""

    @property
    def network(self) -> canopen.Network:
        """The network through which the nodes are reached."""
        ...

    def now_s(self) -> float:
        """Seconds on the clock that the board lives by."""
        ...

    def wait(self, dt_s: float) -> None:
        """Let that much time pass: advance the simulated clock, or sleep."""
        ...
