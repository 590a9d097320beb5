"""Switches along an axis: where they are closed, as data, and how far an axis is from changing one.

Positions are steps of the machine: what the axis' driver has counted, from the machine's true zero. The firmware does
not know these; homing is how it learns them.
"""

from collections.abc import Sequence
from dataclasses import dataclass

from steptwin.protocol.cia402 import DigitalInput

_KINDS = (DigitalInput.NEGATIVE_LIMIT, DigitalInput.POSITIVE_LIMIT, DigitalInput.HOME)


@dataclass(frozen=True, slots=True)
class Switch:
    """A switch at an axis' connector and the positions at which it is closed, which is active.

    Attributes:
        axis: on the board.
        input: which of the axis' inputs it is wired to.
        from_steps: the lowest position at which it closes; None: there is none.
        to_steps: the highest one; None: there is none.
        hysteresis_steps: so much farther out it opens again.

    Raises:
        ValueError: no such input, or a stretch that is no stretch.
    """

    axis: int
    input: DigitalInput
    from_steps: int | None = None
    to_steps: int | None = None
    hysteresis_steps: int = 0

    def __post_init__(self) -> None:
        if self.input not in _KINDS:
            raise ValueError(f"a switch is one of {', '.join(str(kind.name) for kind in _KINDS)}, not {self.input!r}")
        if self.from_steps is None and self.to_steps is None:
            raise ValueError("a switch without from_steps and to_steps would always be closed")
        if self.from_steps is not None and self.to_steps is not None and self.from_steps > self.to_steps:
            raise ValueError(f"a switch from {self.from_steps} to {self.to_steps} steps would never be closed")
        if self.hysteresis_steps < 0:
            raise ValueError(f"hysteresis_steps {self.hysteresis_steps} is negative")

    def closed_at(self, position_steps: int, *, before: bool) -> bool:
        """Whether it is closed; `before`: whether it was closed so far."""
        return self._outside(position_steps) <= (self.hysteresis_steps if before else 0)

    def steps_to_change(self, position_steps: int, *, closed: bool) -> int:
        """How many steps it takes at least until it changes: 1 or more."""
        if not closed:
            return self._outside(position_steps)
        ways = []
        if self.from_steps is not None:
            ways.append(position_steps - self.from_steps)
        if self.to_steps is not None:
            ways.append(self.to_steps - position_steps)
        return min(ways) + self.hysteresis_steps + 1

    def _outside(self, position_steps: int) -> int:
        """How many steps the position is beside the stretch; 0 or less within it."""
        below = 0 if self.from_steps is None else self.from_steps - position_steps
        above = 0 if self.to_steps is None else position_steps - self.to_steps
        return max(below, above)


class AxisSwitches:
    """An axis' switches and where it stands."""

    def __init__(self, switches: Sequence[Switch], position_steps: int) -> None:
        self.position_steps = position_steps
        self._closed = {switch: switch.closed_at(position_steps, before=False) for switch in switches}

    def __bool__(self) -> bool:
        return bool(self._closed)

    def move(self, steps: int) -> None:
        """Let the axis be elsewhere and the switches follow. What happened on the way leaves no trace."""
        self.position_steps += steps
        for switch, closed in self._closed.items():
            self._closed[switch] = switch.closed_at(self.position_steps, before=closed)

    @property
    def levels(self) -> DigitalInput:
        """The inputs whose switches are closed."""
        levels = DigitalInput(0)
        for switch, closed in self._closed.items():
            if closed:
                levels |= switch.input
        return levels

    @property
    def steps_to_change(self) -> int:
        """How many steps it takes at least until one of the switches changes; there must be one."""
        return min(
            switch.steps_to_change(self.position_steps, closed=closed) for switch, closed in self._closed.items()
        )
