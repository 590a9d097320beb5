"""Follow a chip's outputs incrementally: return the changes since the last call.

`ChipOutputs` computes the outputs at any instant of a complete history. A motor in the loop needs the changes of each
ms. Nearly always these are steps only, which turn the field through a table of currents. Only if an input has changed,
or a shutdown begins or ends, `ChipOutputs` computes the stretch, from an origin at its beginning.
"""

from collections.abc import Sequence
from typing import Final, NamedTuple

import numpy as np

from steptwin.emulator.board.edges import FloatArray, Int8Array, Int64Array, joined
from steptwin.emulator.drivers.outputs import ChipOutputs, Origin, Wiring
from steptwin.emulator.drivers.protection import Protection
from steptwin.emulator.drivers.terminals import LevelChange
from steptwin.protocol.timer import COUNTS_PER_MS

_SETTLING_COUNTS: Final = COUNTS_PER_MS
"""Time after an input change when all outputs have followed; the ENABLE delay of a TB6560 is 3 us."""


class Steady(NamedTuple):
    """Constant settings while only steps occur.

    Attributes:
        step_substeps: field angle of one step.
        first_substeps: angle of state 0 of the mode.
        currents_a: shape (states, 2), currents of A and B by state, `step_substeps` apart.
        fast: fraction of fast decay.
    """

    step_substeps: int
    first_substeps: int
    currents_a: FloatArray
    fast: float

    def states(self, substeps: Int64Array) -> Int64Array:
        """Return the state number at each angle, also beyond one cycle."""
        states: Int64Array = (substeps - self.first_substeps) // self.step_substeps % len(self.currents_a)
        return states


class FieldTurns(NamedTuple):
    """Steps, and the settings meanwhile.

    Attributes:
        counts: shape (n,), instants.
        substeps: shape (n,), field angle, not wrapped at a cycle; it increases while DIR is low.
        steady: constant settings.
    """

    counts: Int64Array
    substeps: Int64Array
    steady: Steady


class OutputChanges(NamedTuple):
    """Changes of any kind at the outputs, in order of time.

    Attributes:
        counts: shape (n,), instants.
        substeps: shape (n,), field angle as in `FieldTurns`.
        currents_a: shape (n, 2), currents of A and B, rounded to mA.
        fast: shape (n,), fraction of fast decay.
    """

    counts: Int64Array
    substeps: Int64Array
    currents_a: FloatArray
    fast: FloatArray


class OutputFollower:
    """Returns each change at one chip's outputs since power-up, once."""

    def __init__(self, wiring: Wiring, origin: Origin, protection: Protection) -> None:
        """Begin at an origin, before any input change."""
        self._wiring, self._origin, self._protection = wiring, origin, protection
        self._changes: list[LevelChange] = []
        self._counts: list[Int64Array] = []
        self._signs: list[Int8Array] = []
        """Signs of the steps since the origin."""
        self._steady: Steady | None = None
        """Constant settings while only steps occur; None after an input change until the outputs have followed."""
        self._settled_counts = _SETTLING_COUNTS
        self._looked_counts = 0
        self._through: int | None = None
        """Field angle at the last call of `look`, not wrapped; None before its first change."""

    def take(self, changes: Sequence[LevelChange], counts: Int64Array, signs: Int8Array) -> None:
        """Add the next input changes and counted steps."""
        if changes:
            self._unsettle()
            self._changes += changes
            self._settled_counts = max(change.counts for change in changes) + _SETTLING_COUNTS
        if counts.size:
            self._counts.append(counts)
            self._signs.append(signs)

    def look(self, until_counts: int) -> FieldTurns | OutputChanges | None:
        """Return the changes since the last call, up to an instant; None if there are none.

        No input change before this instant may be added later.
        """
        if self._steady and self._protection.shut_down(until_counts) != self._origin.shut_down:
            self._unsettle()
        if self._steady is None:
            changes: FieldTurns | OutputChanges | None = self._look_at_all(until_counts)
        else:
            changes = self._look_at_steps(self._steady, until_counts)
        self._looked_counts = until_counts
        return changes

    def _unsettle(self) -> None:
        """Begin a history at the last call of `look`, from the settings at that instant."""
        if self._steady is None:
            return
        self._steady = None
        assert self._through is not None
        field = self._origin.field._replace(substeps=self._through % self._wiring.cycle_substeps)
        self._origin = self._origin._replace(field=field, from_counts=self._looked_counts)

    def _look_at_steps(self, steady: Steady, until_counts: int) -> FieldTurns | None:
        if not self._counts:
            return None
        counts, signs = self._steps_before(until_counts)
        if not counts.size:
            return None
        assert self._through is not None
        through = self._through - steady.step_substeps * signs.cumsum(dtype=np.int64)
        self._through = int(through[-1])
        return FieldTurns(counts, through, steady)

    def _steps_before(self, until_counts: int) -> tuple[Int64Array, Int8Array]:
        """Remove and return the steps before an instant."""
        if len(self._counts) == 1:
            ((counts,), (signs,)) = self._counts, self._signs
        else:
            counts, signs = joined(self._counts, np.int64), joined(self._signs, np.int8)
        self._counts, self._signs = [], []
        if not counts.size or counts[-1] < until_counts:
            return counts, signs
        first = int(np.searchsorted(counts, until_counts))
        self._counts, self._signs = [counts[first:]], [signs[first:]]
        return counts[:first], signs[:first]

    def _look_at_all(self, until_counts: int) -> OutputChanges | None:
        steps = joined(self._counts, np.int64), joined(self._signs, np.int8)
        shutdowns = self._protection.shutdowns(until_counts)
        outputs = ChipOutputs(self._wiring, self._origin, self._changes, steps, shutdowns)
        counts = outputs.instants()
        counts = counts[counts < until_counts]
        changes = self._sampled(outputs, counts) if counts.size else None
        settled = until_counts >= self._settled_counts and self._through is not None
        kept_counts = until_counts if settled else until_counts - _SETTLING_COUNTS
        self._origin = outputs.at(kept_counts, until_counts)
        self._changes = [change for change in self._changes if change.counts >= kept_counts]
        self._steps_before(kept_counts)
        if settled:
            self._steady = _steady(outputs, until_counts - 1)
        return changes

    def _sampled(self, outputs: ChipOutputs, counts: Int64Array) -> OutputChanges:
        substeps, cycle = outputs.field_substeps(counts), self._wiring.cycle_substeps
        before = int(substeps[0]) if self._through is None else self._through
        moves = np.diff(substeps, prepend=before % cycle)
        through = before + np.cumsum((moves + cycle // 2) % cycle - cycle // 2)
        self._through = int(through[-1])
        return OutputChanges(counts, through, _rounded(outputs.currents_a(counts)), outputs.fast_decay(counts))


def _steady(outputs: ChipOutputs, counts: int) -> Steady:
    """Return the settings at an instant."""
    excitation, amplitude_a = outputs.setting(counts)
    (fast,) = outputs.fast_decay(np.array([counts], dtype=np.int64)).tolist()
    currents_a = _rounded(excitation.parts * amplitude_a)
    return Steady(excitation.step_substeps, excitation.first_substeps, currents_a, fast)


def _rounded(currents_a: FloatArray) -> FloatArray:
    """Round currents to mA, as in the record of a run."""
    return np.asarray(1e-3 * np.rint(1000 * currents_a), dtype=np.float64)
