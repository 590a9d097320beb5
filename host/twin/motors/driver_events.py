"""What a driver's record tells its motor: currents, field, decay and whether the outputs are on."""

from math import pi
from typing import Final

import numpy as np

from steptwin.emulator.rotors import DriverEvents
from steptwin.emulator.tb6560.pins import FAST_DECAY_PERCENT
from steptwin.host.common.arrays import FloatArray, Int64Array
from steptwin.host.verify import AxisEvidence, LevelEdges

_CYCLE: Final = 64
"""Sixteenths of a full step in an electrical turn."""
_RAD_PER_SIXTEENTH: Final = 2.0 * pi / _CYCLE
_DECAY_PINS: Final = ("dcy1", "dcy2")


class DriverRecord:
    """One driver's record as its motor feels it.

    The rotor's angle grows with the position. The field's angle in the record grows with DIR low, so here it is taken
    the other way round, and phase B with it.
    """

    def __init__(self, axis: AxisEvidence, current_a: float | None = None) -> None:
        """Take a record; `current_a` is the amplitude at full torque instead of the recorded one."""
        phases = axis.phases
        counts = np.unique(np.concatenate([phases.counts, *(axis.pins[pin].counts for pin in _DECAY_PINS)]))
        at = np.searchsorted(phases.counts, counts, side="right") - 1
        counts, at = counts[at >= 0], at[at >= 0]
        self._counts = counts
        self._a_amp: FloatArray = 1e-3 * phases.a_ma[at].astype(np.float64)
        self._b_amp: FloatArray = -1e-3 * phases.b_ma[at].astype(np.float64)
        if current_a is not None and self.phase_current_a > 0.0:
            scale = current_a / self.phase_current_a
            self._a_amp *= scale
            self._b_amp *= scale
        self._on = (phases.a_ma[at] != 0) | (phases.b_ma[at] != 0)
        sixteenths = _counted_through(phases.sixteenths[at].astype(np.int64))
        self._field_rad: FloatArray = -_RAD_PER_SIXTEENTH * sixteenths.astype(np.float64)
        self._fast = _fast_decay(axis, counts)

    @property
    def first_on_rad(self) -> float:
        """Electrical angle of the field when the outputs first come on: there the rotor stands; 0 if they never do."""
        return float(self._field_rad[np.argmax(self._on)]) if self._on.any() else 0.0

    def events(self, rotor_rad: float) -> DriverEvents:
        """Return all changes; `rotor_rad` is the rotor's electrical angle when the outputs first come on."""
        field_rad = self._field_rad + (rotor_rad - self.first_on_rad)
        on = self._on.astype(np.float64)
        return DriverEvents(self._counts, field_rad, self._a_amp, self._b_amp, self._fast, on)

    @property
    def phase_current_a(self) -> float:
        """Amplitude of the currents, the largest that was set: that of motion."""
        return float(np.hypot(self._a_amp, self._b_amp).max(initial=0.0))

    @property
    def fast_decay(self) -> float:
        """Fraction of fast decay that held at most steps."""
        values, numbers = np.unique(self._fast, return_counts=True)
        return float(values[np.argmax(numbers)]) if values.size else 0.0


def _counted_through(sixteenths: Int64Array) -> Int64Array:
    """Return angles in sixteenths without jumps from the end of a cycle to its beginning."""
    moves = np.diff(sixteenths, prepend=sixteenths[:1])
    return np.asarray(sixteenths[:1] + np.cumsum((moves + _CYCLE // 2) % _CYCLE - _CYCLE // 2), dtype=np.int64)


def _fast_decay(axis: AxisEvidence, counts: Int64Array) -> FloatArray:
    """Return the fraction of fast decay at instants, by the levels of DCY2 and DCY1."""
    first, second = (_level_at(axis.pins[pin], counts) for pin in _DECAY_PINS)
    percent = np.array([[FAST_DECAY_PERCENT[high, low] for low in (0, 1)] for high in (0, 1)])
    return np.asarray(percent[second, first] / 100.0, dtype=np.float64)


def _level_at(pin: LevelEdges, counts: Int64Array) -> Int64Array:
    levels = np.concatenate([np.zeros(1, dtype=np.int64), pin.levels.astype(np.int64)])
    return np.asarray(levels[np.searchsorted(pin.counts, counts, side="right")])
