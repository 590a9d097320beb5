"""One driver's record as its motor feels it: currents, field, decay and whether the outputs are on."""

from dataclasses import dataclass, replace
from math import pi
from typing import Final, Self

import numpy as np

from steptwin.emulator.rotors import DriverEvents
from steptwin.emulator.tb6560.pins import FAST_DECAY_PERCENT
from steptwin.host.common.arrays import BoolArray, FloatArray, Int64Array
from steptwin.host.verify import AxisEvidence, LevelEdges

_CYCLE: Final = 64
"""Sixteenths of a full step in an electrical turn."""
_RAD_PER_SIXTEENTH: Final = 2.0 * pi / _CYCLE
_DECAY_PINS: Final = ("dcy1", "dcy2")


@dataclass(frozen=True, slots=True, eq=False)
class DriverRecord:
    """What one driver did; arrays of shape (n,), from each instant on.

    The rotor's angle grows with the position. The field's angle in a run's evidence grows with DIR low, so here it is
    taken the other way round, and phase B with it.

    Attributes:
        counts: the instants, sorted.
        field_rad: electrical angle of the field, counted through.
        a_amp: current to which phase A is regulated.
        b_amp: likewise of phase B.
        on: whether the outputs are on.
        fast: fraction of fast decay, 0 to 1.
    """

    counts: Int64Array
    field_rad: FloatArray
    a_amp: FloatArray
    b_amp: FloatArray
    on: BoolArray
    fast: FloatArray

    @classmethod
    def of(cls, axis: AxisEvidence) -> Self:
        """Return a driver's record from a run's evidence."""
        phases = axis.phases
        counts = np.unique(np.concatenate([phases.counts, *(axis.pins[pin].counts for pin in _DECAY_PINS)]))
        at = np.searchsorted(phases.counts, counts, side="right") - 1
        counts, at = counts[at >= 0], at[at >= 0]
        return cls(
            counts=counts,
            field_rad=-_RAD_PER_SIXTEENTH * _counted_through(phases.sixteenths[at].astype(np.int64)),
            a_amp=1e-3 * phases.a_ma[at].astype(np.float64),
            b_amp=-1e-3 * phases.b_ma[at].astype(np.float64),
            on=(phases.a_ma[at] != 0) | (phases.b_ma[at] != 0),
            fast=_fast_decay(axis, counts),
        )

    def at_current(self, current_a: float) -> Self:
        """Return the record with another amplitude at full torque; torque settings below it shrink in proportion."""
        if self.phase_current_a == 0.0:
            return self
        scale = current_a / self.phase_current_a
        return replace(self, a_amp=scale * self.a_amp, b_amp=scale * self.b_amp)

    def stretched(self, factor: float, from_counts: int) -> Self:
        """Return the record in which everything after an instant takes `factor` times as long."""
        return replace(self, counts=stretched_counts(self.counts, factor, from_counts))

    def events(self, rotor_rad: float) -> DriverEvents:
        """Return all changes; `rotor_rad` is the rotor's electrical angle when the outputs first come on."""
        field_rad = self.field_rad + (rotor_rad - self.first_on_rad)
        return DriverEvents(self.counts, field_rad, self.a_amp, self.b_amp, self.fast, self.on.astype(np.float64))

    @property
    def first_on_rad(self) -> float:
        """Electrical angle of the field when the outputs first come on: there the rotor stands; 0 if they never do."""
        return float(self.field_rad[np.argmax(self.on)]) if self.on.any() else 0.0

    @property
    def last_off_counts(self) -> int | None:
        """When the outputs go off for good; None if they stay on or never come on."""
        if not self.on.any() or self.on[-1]:
            return None
        return int(self.counts[np.flatnonzero(self.on)[-1] + 1])

    @property
    def phase_current_a(self) -> float:
        """Amplitude of the currents, the largest that was set: that of motion."""
        return float(np.hypot(self.a_amp, self.b_amp).max(initial=0.0))

    @property
    def fast_decay(self) -> float:
        """Fraction of fast decay that held at most steps."""
        values, numbers = np.unique(self.fast, return_counts=True)
        return float(values[np.argmax(numbers)]) if values.size else 0.0


def stretched_counts(counts: Int64Array, factor: float, from_counts: int) -> Int64Array:
    """Return instants of which those after `from_counts` are `factor` times as far from it."""
    later = np.maximum(counts - from_counts, 0)
    return np.asarray(np.minimum(counts, from_counts) + np.rint(later * factor).astype(np.int64), dtype=np.int64)


def _counted_through(sixteenths: Int64Array) -> FloatArray:
    """Return angles in sixteenths without jumps from the end of a cycle to its beginning."""
    moves = np.diff(sixteenths, prepend=sixteenths[:1])
    through = sixteenths[:1] + np.cumsum((moves + _CYCLE // 2) % _CYCLE - _CYCLE // 2)
    return np.asarray(through, dtype=np.float64)


def _fast_decay(axis: AxisEvidence, counts: Int64Array) -> FloatArray:
    """Return the fraction of fast decay at instants, by the levels of DCY2 and DCY1."""
    first, second = (_level_at(axis.pins[pin], counts) for pin in _DECAY_PINS)
    percent = np.array([[FAST_DECAY_PERCENT[high, low] for low in (0, 1)] for high in (0, 1)])
    return np.asarray(percent[second, first] / 100.0, dtype=np.float64)


def _level_at(pin: LevelEdges, counts: Int64Array) -> Int64Array:
    levels = np.concatenate([np.zeros(1, dtype=np.int64), pin.levels.astype(np.int64)])
    return np.asarray(levels[np.searchsorted(pin.counts, counts, side="right")])
