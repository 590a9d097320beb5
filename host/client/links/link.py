"""The interface between the client and a bus: a CANopen network, and the board's clock."""

from typing import Protocol

import canopen


class Clock(Protocol):
    """A clock, simulated or real."""

    def now_s(self) -> float:
        """Return the seconds on the board's clock."""
        ...

    def wait(self, dt_s: float) -> None:
        """Let this much time pass: advance the simulated clock, or sleep."""
        ...


class Link(Clock, Protocol):
    """A connection to a bus, in virtual or in real time."""

    @property
    def held_up_s(self) -> float:
        """Longest time that this program was held up in a `wait`, because the computer is too slow."""
        ...

    @property
    def network(self) -> canopen.Network:
        """The network through which the nodes are reached."""
        ...
