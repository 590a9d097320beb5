"""The interface between the client and a bus: a CANopen network, and the clock by which the board lives."""

from typing import Protocol

import canopen


class Clock(Protocol):
    """A clock, simulated or real, and the way to let time pass on it."""

    def now_s(self) -> float:
        """Return the seconds on the clock by which the board lives."""
        ...

    def wait(self, dt_s: float) -> None:
        """Let this much time pass: advance the simulated clock, or sleep."""
        ...


class Link(Clock, Protocol):
    """A connection to a bus, in virtual or in real time."""

    @property
    def network(self) -> canopen.Network:
        """The network through which the nodes are reached."""
        ...
