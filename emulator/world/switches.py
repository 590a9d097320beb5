"""Switches along an axis: the positions where they are closed, and the distance of the axis to the next change.

Positions are those of the motor's rotor, in the driver's substeps from the machine's true zero: every step is a whole
number of them, whatever the driver's mode. The firmware does not know these positions; it learns them by homing. The
switches of a coupled joint stand along the joint's way, which several rotors move; its positions are scaled so that the
axis' own rotor moves them one to one.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final, Self

from steptwin.protocol.cia402 import SWITCH_INPUTS, DigitalInput


@dataclass(frozen=True, slots=True)
class Switch:
    """A switch at an axis' connector and the stretch over which it is closed; closed is active.

    Attributes:
        axis: number of the axis on the board.
        input: input of the axis to which it is wired.
        from_substeps: lowest position where it closes; None for no lower end.
        to_substeps: highest position where it closes; None for no upper end.
        hysteresis_substeps: distance beyond the stretch at which it opens again.

    Raises:
        ValueError: the input is not a switch input, the stretch is empty or endless, or the hysteresis is negative.
    """

    axis: int
    input: DigitalInput
    from_substeps: int | None = None
    to_substeps: int | None = None
    hysteresis_substeps: int = 0

    def __post_init__(self) -> None:
        if self.input not in SWITCH_INPUTS:
            names = ", ".join(str(kind.name) for kind in SWITCH_INPUTS)
            raise ValueError(f"a switch is one of {names}, not {self.input!r}")
        if self.from_substeps is None and self.to_substeps is None:
            raise ValueError("a switch without from_substeps and to_substeps would always be closed")
        if self.from_substeps is not None and self.to_substeps is not None and self.from_substeps > self.to_substeps:
            raise ValueError(f"a switch from {self.from_substeps} to {self.to_substeps} substeps would never be closed")
        if self.hysteresis_substeps < 0:
            raise ValueError(f"hysteresis_substeps {self.hysteresis_substeps} is negative")

    def closed_at(self, position_substeps: int, *, before: bool) -> bool:
        """Return True if it is closed at a position; `before` is True if it was closed until now."""
        return self._outside(position_substeps) <= (self.hysteresis_substeps if before else 0)

    def substeps_to_change(self, position_substeps: int, *, closed: bool) -> int:
        """Return the least distance at which it changes: 1 or more."""
        if not closed:
            return self._outside(position_substeps)
        ways = []
        if self.from_substeps is not None:
            ways.append(position_substeps - self.from_substeps)
        if self.to_substeps is not None:
            ways.append(self.to_substeps - position_substeps)
        return min(ways) + self.hysteresis_substeps + 1

    def _outside(self, position_substeps: int) -> int:
        """Return the distance of a position from the stretch; 0 or less within it."""
        below = 0 if self.from_substeps is None else self.from_substeps - position_substeps
        above = 0 if self.to_substeps is None else position_substeps - self.to_substeps
        return max(below, above)


WEIGHT_ONE: Final = 1 << 32


@dataclass(frozen=True, slots=True)
class Travel:
    """The way along which an axis' switches stand: its rotor's, or a joint's that several rotors move together.

    Attributes:
        weights: substeps along the way, times WEIGHT_ONE, for each substep of a rotor, by the axis of the rotor.
    """

    weights: tuple[tuple[int, int], ...]

    @classmethod
    def of_rotor(cls, axis: int) -> Self:
        """Return the way of one rotor."""
        return cls(((axis, WEIGHT_ONE),))

    @property
    def rotors(self) -> list[int]:
        """The axes whose rotors move along this way."""
        return [axis for axis, _ in self.weights]

    def position_substeps(self, rotors_substeps: Sequence[int]) -> int:
        """Return the position along the way, rounded half up to a substep, from those of all rotors."""
        weighted = sum(weight * rotors_substeps[axis] for axis, weight in self.weights)
        return (weighted + WEIGHT_ONE // 2) // WEIGHT_ONE

    def steps(self, way_substeps: int, step_substeps: Sequence[int]) -> int:
        """Return the least number of steps, made by all rotors at once, for the position to change so far."""
        fastest = sum(abs(weight) * step_substeps[axis] for axis, weight in self.weights)
        return (way_substeps - 1) * WEIGHT_ONE // fastest + 1


class AxisSwitches:
    """An axis' switches and its position; a switch that sticks still follows the axis, unseen."""

    def __init__(self, switches: Sequence[Switch], position_substeps: int) -> None:
        self.position_substeps: int = position_substeps
        self._closed = {switch: switch.closed_at(position_substeps, before=False) for switch in switches}
        self.substeps_to_change: int = self._least_way()
        """Least distance until one of the switches changes; it is asked for more often than the axis moves."""
        self.stuck: DigitalInput = DigitalInput(0)
        """Inputs that are held at a level, whatever the position."""
        self._stuck_closed = DigitalInput(0)
        self._cut = self._cut_closed = DigitalInput(0)
        """Inputs whose wires are broken, and those of them that look closed."""
        self.inverted: DigitalInput = DigitalInput(0)
        """Inputs that a bouncing contact shows otherwise than they are."""

    def __bool__(self) -> bool:
        return bool(self._closed)

    def move(self, substeps: int) -> bool:
        """Move the axis and let the switches follow; switches that it passed completely do not change.

        Returns:
            True if a switch has changed.
        """
        self.position_substeps += substeps
        changed = False
        for switch, before in self._closed.items():
            closed = self._closed[switch] = switch.closed_at(self.position_substeps, before=before)
            changed |= closed != before
        self.substeps_to_change = self._least_way()
        return changed

    def stick(self, which: DigitalInput, *, closed: bool | None) -> None:
        """Hold an input closed or open, or let it follow the position again (None)."""
        self.stuck = self.stuck & ~which if closed is None else self.stuck | which
        self._stuck_closed = self._stuck_closed | which if closed else self._stuck_closed & ~which

    def cut(self, which: DigitalInput, *, closed: bool | None) -> None:
        """Break the wire of an input, which then looks closed or open, or mend it (None)."""
        self._cut = self._cut & ~which if closed is None else self._cut | which
        self._cut_closed = self._cut_closed | which if closed else self._cut_closed & ~which

    @property
    def contacts(self) -> DigitalInput:
        """Inputs whose contacts are closed by the axis' position."""
        levels = DigitalInput(0)
        for switch, closed in self._closed.items():
            if closed:
                levels |= switch.input
        return levels

    @property
    def levels(self) -> DigitalInput:
        """Inputs that are closed."""
        levels = self.contacts
        if self.inverted:
            levels ^= self.inverted
        if self.stuck:
            levels = levels & ~self.stuck | self._stuck_closed
        return levels & ~self._cut | self._cut_closed if self._cut else levels

    def _least_way(self) -> int:
        """Return the least distance until one of the switches changes; 0 if there is none."""
        ways = (
            switch.substeps_to_change(self.position_substeps, closed=closed) for switch, closed in self._closed.items()
        )
        return min(ways, default=0)
