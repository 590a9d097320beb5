"""Follow a chip's outputs as its history grows: what has changed from one look to the next.

`Tb6560Outputs` answers for any instant of a whole history. A motor that turns with the chip asks every ms for what is
new. Nearly always that is steps alone, which turn the field through a table of currents. Only where an input has
changed, or a thermal shutdown comes or goes, is the stretch computed by `Tb6560Outputs`, with a beginning of its own.
"""

from collections.abc import Sequence
from typing import Final

import numpy as np

from steptwin.emulator.board.edges import FloatArray, Int8Array, Int64Array, joined
from steptwin.emulator.drivers.driver_chip import FieldTurns, LevelChange, OutputChanges, Steady
from steptwin.emulator.drivers.tb6560.excitation import CYCLE_SIXTEENTHS
from steptwin.emulator.drivers.tb6560.outputs import Origin, Tb6560Outputs
from steptwin.emulator.drivers.tb6560.thermal import Junction
from steptwin.protocol.timer import COUNTS_PER_MS

_SETTLING_COUNTS: Final = COUNTS_PER_MS
"""Time from a change of an input until all outputs have followed: ENABLE's delay is 3 us."""


class Tb6560Follower:
    """The changes at one chip's outputs since power-up, each told once."""

    def __init__(self, origin: Origin, sense_ohm: float, junction: Junction) -> None:
        """Begin at an origin, before any input has changed."""
        self._origin, self._sense_ohm, self._junction = origin, sense_ohm, junction
        self._changes: list[LevelChange] = []
        self._counts: list[Int64Array] = []
        self._signs: list[Int8Array] = []
        """Steps since the origin."""
        self._steady: Steady | None = None
        """What holds while only steps come; None after a change of an input, until the outputs have followed."""
        self._settled_counts = _SETTLING_COUNTS
        self._looked_counts = 0
        self._through: int | None = None
        """The field's angle at the last look, counted through; None before its first change."""

    def take(self, changes: Sequence[LevelChange], counts: Int64Array, signs: Int8Array) -> None:
        """Take the next changes of inputs and the next counted steps."""
        if changes:
            self._unsettle()
            self._changes += changes
            self._settled_counts = max(change.counts for change in changes) + _SETTLING_COUNTS
        if counts.size:
            self._counts.append(counts)
            self._signs.append(signs)

    def look(self, until_counts: int) -> FieldTurns | OutputChanges | None:
        """Return what has changed before an instant since the last look; None for nothing.

        No input may change, later, at an instant before this one.
        """
        if self._steady and self._junction.shut_down(until_counts) != self._origin.shut_down:
            self._unsettle()
        if self._steady is None:
            changes: FieldTurns | OutputChanges | None = self._look_at_all(until_counts)
        else:
            changes = self._look_at_steps(self._steady, until_counts)
        self._looked_counts = until_counts
        return changes

    def _unsettle(self) -> None:
        """Begin a history at the last look, from what has held since then."""
        if self._steady is None:
            return
        self._steady = None
        assert self._through is not None
        field = self._origin.field._replace(sixteenths=self._through % CYCLE_SIXTEENTHS)
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
        """Return the steps before an instant, and forget them."""
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
        outputs = Tb6560Outputs(
            self._origin, self._changes, steps, self._junction.shutdowns(until_counts), self._sense_ohm
        )
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

    def _sampled(self, outputs: Tb6560Outputs, counts: Int64Array) -> OutputChanges:
        sixteenths = outputs.field_substeps(counts)
        before = int(sixteenths[0]) if self._through is None else self._through
        moves = np.diff(sixteenths, prepend=before % CYCLE_SIXTEENTHS)
        half = CYCLE_SIXTEENTHS // 2
        through = before + np.cumsum((moves + half) % CYCLE_SIXTEENTHS - half)
        self._through = int(through[-1])
        return OutputChanges(counts, through, _rounded(outputs.currents_a(counts)), outputs.fast_decay(counts))


def _steady(outputs: Tb6560Outputs, counts: int) -> Steady:
    """Return what holds at an instant."""
    setting = outputs.setting(counts)
    (fast,) = outputs.fast_decay(np.array([counts], dtype=np.int64)).tolist()
    return Steady(setting.excitation.step_sixteenths, _rounded(setting.currents_a()), fast)


def _rounded(currents_a: FloatArray) -> FloatArray:
    """Return currents as a run's record has them, in whole mA."""
    return np.asarray(1e-3 * np.rint(1000 * currents_a), dtype=np.float64)
