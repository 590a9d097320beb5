"""Switches along an axis: the positions at which they are closed, and the distance of the axis to the next change.

Positions are steps from the machine's true zero, as the axis' driver counts them. The firmware does not know these; it
learns them by homing.
"""

from collections.abc import Sequence
from dataclasses import dataclass

from steptwin.protocol.cia402 import DigitalInput

_KINDS = (DigitalInput.NEGATIVE_LIMIT, DigitalInput.POSITIVE_LIMIT, DigitalInput.HOME)


@dataclass(frozen=True, slots=True)
class Switch:
    """A switch at an axis' connector and the stretch over which it is closed; closed is active.

    Attributes:
        axis: number of the axis on the board.
        input: input of the axis to which it is wired.
        from_steps: lowest position at which it closes; None for no lower end.
        to_steps: highest position at which it closes; None for no upper end.
        hysteresis_steps: distance beyond the stretch at which it opens again.

    Raises:
        ValueError: the input is not a switch input, the stretch is empty or endless, or the hysteresis is negative.
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
        """Return True if it is closed at a position; `before` is True if it was closed until now."""
        return self._outside(position_steps) <= (self.hysteresis_steps if before else 0)

    def steps_to_change(self, position_steps: int, *, closed: bool) -> int:
        """Return the least number of steps until it changes: 1 or more."""
        if not closed:
            return self._outside(position_steps)
        ways = []
        if self.from_steps is not None:
            ways.append(position_steps - self.from_steps)
        if self.to_steps is not None:
            ways.append(self.to_steps - position_steps)
        return min(ways) + self.hysteresis_steps + 1

    def _outside(self, position_steps: int) -> int:
        """Return the distance of a position from the stretch in steps; 0 or less within it."""
        below = 0 if self.from_steps is None else self.from_steps - position_steps
        above = 0 if self.to_steps is None else position_steps - self.to_steps
        return max(below, above)


class AxisSwitches:
    """An axis' switches and its position."""

    def __init__(self, switches: Sequence[Switch], position_steps: int) -> None:
        self.position_steps = position_steps
        self._closed = {switch: switch.closed_at(position_steps, before=False) for switch in switches}

    def __bool__(self) -> bool:
        return bool(self._closed)

    def move(self, steps: int) -> None:
        """Move the axis and let the switches follow; switches that it passed completely do not change."""
        self.position_steps += steps
        for switch, closed in self._closed.items():
            self._closed[switch] = switch.closed_at(self.position_steps, before=closed)

    @property
    def levels(self) -> DigitalInput:
        """Inputs whose switches are closed."""
        levels = DigitalInput(0)
        for switch, closed in self._closed.items():
            if closed:
                levels |= switch.input
        return levels

    @property
    def steps_to_change(self) -> int:
        """Least number of steps until one of the switches changes; the axis must have a switch."""
        return min(
            switch.steps_to_change(self.position_steps, closed=closed) for switch, closed in self._closed.items()
        )
