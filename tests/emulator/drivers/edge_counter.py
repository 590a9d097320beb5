"""A second kind of driver chip, as little as one can be: it counts every edge, and ten steps make a full step."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from math import pi

import numpy as np

from steptwin.controller.node.pins import Pin
from steptwin.emulator.board.edges import FloatArray, Int8Array, Int64Array, joined, levels_at
from steptwin.emulator.drivers.driver_chip import Cooling, LevelChange, Moves, OutputChanges, Rail, TerminalEdges
from steptwin.emulator.drivers.limits import Violations, merged

SUBSTEPS = 10
CYCLE = 4 * SUBSTEPS
_NEEDED = (*Rail, Pin.ENABLE)


class History:
    """Its outputs: 1.5 A in both phases together while it is supplied and enabled."""

    def __init__(self, counts: Int64Array, positions: Int64Array, changes: list[LevelChange]) -> None:
        self.from_counts = 0
        self._counts, self._positions, self._changes = counts, np.concatenate(([0], positions)), changes

    def instants(self) -> Int64Array:
        """Return the instants of all steps and switchings."""
        return np.unique(np.concatenate((self._counts, [change.counts for change in self._changes])).astype(np.int64))

    def field_substeps(self, counts: Int64Array) -> Int64Array:
        """Return the field's angle."""
        at = np.searchsorted(self._counts, counts, side="right")
        return np.asarray(-self._positions[at] % CYCLE, dtype=np.int64)

    def currents_a(self, counts: Int64Array) -> FloatArray:
        """Return both currents."""
        angle = 2 * pi * self.field_substeps(counts) / CYCLE
        on = np.array([self._on(instant) for instant in counts.tolist()])
        return np.asarray(1.5 * np.column_stack((np.cos(angle), np.sin(angle))) * on[:, np.newaxis], np.float64)

    def _on(self, counts: int) -> bool:
        levels = {change.terminal: change.level for change in self._changes if change.counts <= counts}
        return all(levels.get(terminal) for terminal in _NEEDED)


@dataclass
class EdgeCounter:
    """The chip, which is also what follows its outputs."""

    pulse_min_counts: int = 1
    position_steps: int = 0
    lost_steps: int = 0
    microsteps: int = SUBSTEPS
    violation_count: int = 0
    violations: Violations = field(default_factory=lambda: merged([]))
    _counts: list[Int64Array] = field(default_factory=list)
    _signs: list[Int8Array] = field(default_factory=list)
    _changes: list[LevelChange] = field(default_factory=list)
    _dir_level: int = 0
    _looked_counts: int = 0

    def feed(self, edges: TerminalEdges) -> Moves:
        """Count every rise."""
        levels = levels_at(edges.clk_rise_counts, edges.dir_counts, edges.dir_levels, self._dir_level)
        self._dir_level = int(edges.dir_levels[-1]) if edges.dir_levels.size else self._dir_level
        signs = 2 * levels - 1
        self._changes += (change for change in edges.changes if change.terminal in _NEEDED)
        self._counts.append(edges.clk_rise_counts)
        self._signs.append(signs)
        self.position_steps += int(signs.sum(dtype=np.int64))
        return edges.clk_rise_counts, signs

    @property
    def position_substeps(self) -> int:
        """A step is a substep."""
        return self.position_steps

    @property
    def steps(self) -> tuple[Int64Array, Int8Array]:
        """All of them."""
        return joined(self._counts, np.int64), joined(self._signs, np.int8)

    @property
    def outputs(self) -> History:
        """Currents since power-up."""
        counts, signs = self.steps
        return History(counts, np.cumsum(signs, dtype=np.int64), self._changes)

    def follow_outputs(self) -> "EdgeCounter":
        """Follow itself."""
        return self

    def look(self, until_counts: int) -> OutputChanges | None:
        """Return all changes since the last look; the angle is counted through, as no chip must but this one can."""
        counts, signs = self.steps
        outputs = self.outputs
        new = outputs.instants()
        new = new[(self._looked_counts <= new) & (new < until_counts)]
        self._looked_counts = until_counts
        if not new.size:
            return None
        through = np.concatenate(([0], -np.cumsum(signs, dtype=np.int64)))[np.searchsorted(counts, new, side="right")]
        return OutputChanges(new, through, outputs.currents_a(new), np.zeros(new.size))

    def fault_level(self, counts: int) -> int:  # noqa: ARG002
        """It has no faults."""
        return 1

    def fault_stays_until(self, counts: int) -> None:
        """Nor will it have any."""

    def change_part(self, name: str, value: float) -> None:  # noqa: ARG002
        """Refuse every part."""
        raise ValueError(f"an edge counter has no part {name}")

    def forget(self) -> None:
        """Remember all the same."""


@dataclass(frozen=True)
class EdgeCounters:
    """The kind."""

    substeps: int = SUBSTEPS
    mode_levels: Mapping[int, Mapping[Pin, int]] = field(default_factory=lambda: {SUBSTEPS: {}})
    period_min_counts: int = 1
    current_max_a: float = 1.5
    on_resistance_ohm: float = 0.1
    parts: Mapping[str, float] = field(default_factory=dict)

    def sense_ohm(self, current_a: float) -> float:  # noqa: ARG002
        """It senses nothing."""
        return 0.0

    def make(self, sense_ohm: float, cooling: Cooling) -> EdgeCounter:  # noqa: ARG002
        """Return a chip."""
        return EdgeCounter()
