"""What starts or ends a fault, as data: a time, a position, a frame, a drive's state, or a time drawn by the seed.

Times count from the motion's start, t = 0 of the plan: the first servo tick after the SYNC that sets an axis moving.
Positions are those that the drivers have counted, looked at on servo ticks.
"""

from dataclasses import dataclass
from enum import StrEnum
from random import Random

from steptwin.protocol.cia402 import State


class Direction(StrEnum):
    """The direction in which a joint passes a position."""

    UP = "up"
    DOWN = "down"
    ANY = "any"


@dataclass(frozen=True, slots=True)
class AtTime:
    """An instant, in seconds from the motion's start, or from power-up."""

    at_s: float
    from_power_up: bool = False

    def __str__(self) -> str:
        return f"at {self.at_s:g} s from power-up" if self.from_power_up else f"at {self.at_s:g} s"


@dataclass(frozen=True, slots=True)
class AtRandom:
    """An instant of the motion between two times in seconds from its start, drawn evenly by the scenario's seed.

    Raises:
        ValueError: the second time is before the first.
    """

    from_s: float
    to_s: float

    def __post_init__(self) -> None:
        if not self.from_s <= self.to_s:
            raise ValueError(f"to_s: {self.to_s:g} s is before from_s, {self.from_s:g} s")

    def drawn(self, random: Random) -> AtTime:
        """Return the instant that is drawn, to a microsecond."""
        return AtTime(round(random.uniform(self.from_s, self.to_s), 6))

    def __str__(self) -> str:
        return f"at random from {self.from_s:g} s to {self.to_s:g} s"


@dataclass(frozen=True, slots=True)
class AtPosition:
    """The first servo tick at whose start a joint is at or beyond a position, having been before it.

    Attributes:
        joint: name of the joint.
        value: the position, in mm or degrees.
        direction: the direction in which the joint passes it.
    """

    joint: str
    value: float
    direction: Direction = Direction.ANY

    def __str__(self) -> str:
        return f"{self.joint} {_PASSING[self.direction]} {self.value:g}"


_PASSING = {Direction.UP: "rises to", Direction.DOWN: "falls to", Direction.ANY: "passes"}


@dataclass(frozen=True, slots=True)
class OnFrame:
    """The instant at which the n-th frame of an identifier since power-up becomes valid on the bus."""

    cob_id: int
    n: int = 1

    def __str__(self) -> str:
        return f"on frame {self.n} of 0x{self.cob_id:03X}"


@dataclass(frozen=True, slots=True)
class AtState:
    """The instant at which the drive of a joint is found in a state."""

    joint: str
    state: State

    def __str__(self) -> str:
        return f"{self.joint} in {self.state.name.replace('_', ' ')}"


Trigger = AtTime | AtRandom | AtPosition | OnFrame | AtState
