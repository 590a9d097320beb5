"""The one interface of driver chips: edges and levels at their terminals in; steps, currents and flags out.

The rest of the product knows a chip as `DriverChip` and what makes one as `ChipKind`; only the profiles of drivers name
a kind, which has a folder beside this file. A rotor's position and the field's angle count substeps, into which a kind
divides a full step so that each step of each of its modes is a whole number of them.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from enum import Enum
from typing import Any, NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from steptwin.controller.node.pins import Pin
from steptwin.emulator.board.edges import FloatArray, Int8Array, Int64Array
from steptwin.emulator.drivers.limits import Violations
from steptwin.protocol.timer import COUNTS_PER_SECOND


class Rail(Enum):
    """A supply of the chip: VDD of its logic, VM of its bridges. It is high when it is up."""

    VDD = "VDD"
    VM = "VM"


Terminal = Rail | Pin
"""What a board holds at a level: the supplies, and its own pins by the wires from them. A chip heeds those it has."""


class LevelChange(NamedTuple):
    """A terminal takes a level, 0 or 1."""

    counts: int
    terminal: Terminal
    level: int


@dataclass(frozen=True, slots=True)
class TerminalEdges:
    """One stretch of edges at a driver's inputs: sorted times in counts, and the level after each edge.

    Attributes:
        clk_rise_counts: shape (pulses,), the rises of STEP.
        clk_fall_counts: shape (pulses,), the fall that ends each pulse.
        dir_counts: shape (d,).
        dir_levels: shape (d,).
        changes: changes of the terminals that are held at a level.
        until_counts: all edges before this instant are in this stretch or in an earlier one.
    """

    clk_rise_counts: Int64Array
    clk_fall_counts: Int64Array
    dir_counts: Int64Array
    dir_levels: Int8Array
    changes: tuple[LevelChange, ...]
    until_counts: int


SubstepArray = NDArray[np.signedinteger[Any]]
Moves = tuple[Int64Array, SubstepArray]
"""Instants of a rotor's moves, and each move in substeps with its sign."""


class Outputs(Protocol):
    """What a chip does to its motor, for any instants of a history: in counts, shape (n,), in any order."""

    @property
    def from_counts(self) -> int:
        """Instant from which `instants` begins: 0 at power-up."""

    def instants(self) -> Int64Array:
        """Return the sorted instants when an output may change; between them none does."""

    def field_substeps(self, counts: Int64Array) -> Int64Array:
        """Return the field's angle within its cycle of four full steps; it grows with DIR low."""

    def currents_a(self, counts: Int64Array) -> FloatArray:
        """Return the currents in phases A and B in ampere, shape (n, 2)."""


class Steady(NamedTuple):
    """What holds while only steps come.

    Attributes:
        step_substeps: angle by which a step turns the field.
        currents_a: shape (substeps of a cycle, 2), currents of A and B by the field's angle.
        fast: fraction of fast decay.
    """

    step_substeps: int
    currents_a: FloatArray
    fast: float


class FieldTurns(NamedTuple):
    """Steps, and what held meanwhile.

    Attributes:
        counts: shape (n,), instants.
        substeps: shape (n,), the field's angle, counted through; it grows with DIR low.
        steady: what held.
    """

    counts: Int64Array
    substeps: Int64Array
    steady: Steady


class OutputChanges(NamedTuple):
    """Any changes at the outputs, in order of time.

    Attributes:
        counts: shape (n,), instants.
        substeps: shape (n,), as in `FieldTurns`.
        currents_a: shape (n, 2), in phases A and B, rounded to mA.
        fast: shape (n,), fraction of fast decay.
    """

    counts: Int64Array
    substeps: Int64Array
    currents_a: FloatArray
    fast: FloatArray


class OutputFollower(Protocol):
    """The changes at one chip's outputs since power-up, each told once."""

    def look(self, until_counts: int) -> FieldTurns | OutputChanges | None:
        """Return what has changed before an instant since the last look; None for nothing.

        No input may change, later, at an instant before this one.
        """


class DriverChip(Protocol):
    """One chip, at first without supply and with all terminals low."""

    pulse_min_counts: int
    """Shortest pulse that it counts."""
    position_steps: int
    """Steps counted since power-up; steps with DIR high count up."""
    lost_steps: int
    """Signed pulses less signed steps counted."""

    def feed(self, edges: TerminalEdges) -> Moves:
        """Process the next stretch of edges at the chip's pins; every rise comes with its fall."""

    @property
    def microsteps(self) -> int:
        """Steps in a full step, in the present mode."""

    @property
    def position_substeps(self) -> int:
        """Position of the rotor since power-up; it grows while DIR is high."""

    @property
    def steps(self) -> tuple[Int64Array, Int8Array]:
        """Counted steps that are not forgotten: instant, and sign."""

    @property
    def violation_count(self) -> int:
        """Number of violations of limits so far."""

    @property
    def violations(self) -> Violations:
        """All violations that are not forgotten, in order of time."""

    @property
    def outputs(self) -> Outputs:
        """What it does to its motor, for any instant that is not forgotten."""

    def follow_outputs(self) -> OutputFollower:
        """Return what follows the outputs from power-up on, for a motor that turns with them; before the first edge."""

    def fault_level(self, counts: int) -> int:
        """Return the level of its fault output with a pull-up at an instant: low while a fault keeps it off."""

    def fault_stays_until(self, counts: int) -> int | None:
        """Return an instant before which that level stays unless a terminal changes; None: always."""

    def change_part(self, name: str, value: float) -> None:
        """Let a part at the chip, named as in `ChipKind.parts`, have another value for the edges that are fed next.

        Raises:
            ValueError: the chip has no such part, or the part cannot have this value.
        """

    def forget(self) -> None:
        """Drop the recorded steps, violations and changes of the outputs, but keep how many there were."""


@dataclass(frozen=True, slots=True)
class Cooling:
    """Cooling of a chip; the default is the TB6560's bare package in still air."""

    resistance_k_per_w: float = 25.0
    capacity_j_per_k: float = 4.0
    ambient_celsius: float = 25.0

    @property
    def time_constant_counts(self) -> float:
        """Time until 63 % of a change of temperature is over."""
        return self.resistance_k_per_w * self.capacity_j_per_k * COUNTS_PER_SECOND


class ChipKind(Protocol):
    """A kind of chip with the parts that decide how it counts: what a driver's profile chooses."""

    @property
    def substeps(self) -> int:
        """Substeps in a full step."""

    @property
    def mode_levels(self) -> Mapping[int, Mapping[Pin, int]]:
        """Levels of the pins that select the mode, by its microsteps."""

    @property
    def period_min_counts(self) -> int:
        """Shortest time between two pulses that it counts."""

    @property
    def current_max_a(self) -> float:
        """Highest current of a phase in its operating range."""

    @property
    def on_resistance_ohm(self) -> float:
        """Of both switches of a bridge."""

    @property
    def parts(self) -> Mapping[str, float]:
        """Parts at its pins that may have another value (`DriverChip.change_part`)."""

    def sense_ohm(self, current_a: float) -> float:
        """Return the sense resistors with which the full current is this."""

    def make(self, sense_ohm: float, cooling: Cooling) -> DriverChip:
        """Return a chip with these sense resistors; raise ValueError if that is outside its operating range."""
