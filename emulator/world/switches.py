"""Switches along an axis: positions where they are closed, and distance to the next change.

Positions are those of the rotor, in the driver's substeps from the machine's true zero. Every step is a whole number of
substeps in any mode of the driver. The firmware does not know these positions; homing finds them. The switches of a
coupled joint are placed along the joint's travel, which several rotors move. Its positions are scaled: one substep of
the axis' own rotor is one substep of travel.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final, Self

from steptwin.protocol.cia402 import SWITCH_INPUTS, DigitalInput


@dataclass(frozen=True, slots=True)
class Switch:
    """A switch at an axis' connector, and the range in which it is closed; closed is active.

    Attributes:
        axis: number of the axis on the board.
        input: input of the axis to which it is wired.
        from_substeps: lowest position where it closes; None for no lower end.
        to_substeps: highest position where it closes; None for no upper end.
        hysteresis_substeps: distance beyond the range at which it opens again.

    Raises:
        ValueError: the input is not a switch input, the range is empty or has no end, or the hysteresis is negative.
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
        """Return whether it is closed at a position; `before` is its previous state."""
        return self._outside(position_substeps) <= (self.hysteresis_substeps if before else 0)

    def substeps_to_change(self, position_substeps: int, *, closed: bool) -> int:
        """Return the shortest distance at which it changes: 1 or more."""
        if not closed:
            return self._outside(position_substeps)
        distances = []
        if self.from_substeps is not None:
            distances.append(position_substeps - self.from_substeps)
        if self.to_substeps is not None:
            distances.append(self.to_substeps - position_substeps)
        return min(distances) + self.hysteresis_substeps + 1

    def _outside(self, position_substeps: int) -> int:
        """Return the distance of a position from the range; 0 or less inside of it."""
        below = 0 if self.from_substeps is None else self.from_substeps - position_substeps
        above = 0 if self.to_substeps is None else position_substeps - self.to_substeps
        return max(below, above)


WEIGHT_ONE: Final = 1 << 32


@dataclass(frozen=True, slots=True)
class Travel:
    """The travel along which an axis' switches are placed: of one rotor, or of a joint that several rotors move.

    Attributes:
        weights: pairs of a rotor's axis and the travel per substep of this rotor, times WEIGHT_ONE.
    """

    weights: tuple[tuple[int, int], ...]

    @classmethod
    def of_rotor(cls, axis: int) -> Self:
        """Return the travel of one rotor."""
        return cls(((axis, WEIGHT_ONE),))

    @property
    def rotors(self) -> list[int]:
        """Axes whose rotors move along this travel."""
        return [axis for axis, _ in self.weights]

    def position_substeps(self, rotors_substeps: Sequence[int]) -> int:
        """Return the position along the travel from the positions of all rotors, rounded half up to a substep."""
        weighted = sum(weight * rotors_substeps[axis] for axis, weight in self.weights)
        return (weighted + WEIGHT_ONE // 2) // WEIGHT_ONE

    def steps(self, travel_substeps: int, step_substeps: Sequence[int]) -> int:
        """Return the smallest number of steps, made by all rotors together, for a distance along the travel."""
        fastest = sum(abs(weight) * step_substeps[axis] for axis, weight in self.weights)
        return (travel_substeps - 1) * WEIGHT_ONE // fastest + 1


class AxisSwitches:
    """The switches of an axis and its position. A stuck switch still follows the position internally."""

    def __init__(self, switches: Sequence[Switch], position_substeps: int) -> None:
        self.position_substeps: int = position_substeps
        self._closed = {switch: switch.closed_at(position_substeps, before=False) for switch in switches}
        self.substeps_to_change: int = self._least_distance()
        """Shortest distance to a switch change; stored because it is read more often than the axis moves."""
        self.stuck: DigitalInput = DigitalInput(0)
        """Inputs held at a level, regardless of the position."""
        self._stuck_closed = DigitalInput(0)
        self._cut = self._cut_closed = DigitalInput(0)
        """Inputs with broken wires, and the ones of them that read as closed."""
        self.inverted: DigitalInput = DigitalInput(0)
        """Inputs inverted by a bouncing contact."""

    def __bool__(self) -> bool:
        return bool(self._closed)

    def move(self, substeps: int) -> bool:
        """Move the axis and let the switches follow; a switch that is passed completely does not change.

        Returns:
            True if a switch has changed.
        """
        self.position_substeps += substeps
        changed = False
        for switch, before in self._closed.items():
            closed = self._closed[switch] = switch.closed_at(self.position_substeps, before=before)
            changed |= closed != before
        self.substeps_to_change = self._least_distance()
        return changed

    def stick(self, which: DigitalInput, *, closed: bool | None) -> None:
        """Hold an input closed or open; None lets it follow the position again."""
        self.stuck = self.stuck & ~which if closed is None else self.stuck | which
        self._stuck_closed = self._stuck_closed | which if closed else self._stuck_closed & ~which

    def cut(self, which: DigitalInput, *, closed: bool | None) -> None:
        """Break the wire of an input, which then reads as closed or open; None repairs it."""
        self._cut = self._cut & ~which if closed is None else self._cut | which
        self._cut_closed = self._cut_closed | which if closed else self._cut_closed & ~which

    @property
    def contacts(self) -> DigitalInput:
        """Inputs whose contacts are closed at the present position."""
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

    def _least_distance(self) -> int:
        """Return the shortest distance to a switch change; 0 without switches."""
        distances = (
            switch.substeps_to_change(self.position_substeps, closed=closed) for switch, closed in self._closed.items()
        )
        return min(distances, default=0)
