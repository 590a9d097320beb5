"""Microstep modes of a chip as arrays: field angle and phase currents of each state.

The field angle counts substeps; four full steps make a cycle. It increases while DIR is low. The current of phase A is
its cosine, the current of phase B its sine, with the values of the chip's own table if it has one.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from math import pi

import numpy as np

from steptwin.emulator.board.edges import FloatArray, Int64Array
from steptwin.protocol.drivers import ChipSheet

CYCLE_FULL_STEPS = 4


@dataclass(frozen=True, slots=True, eq=False)
class Excitation:
    """One microstep mode.

    Attributes:
        microsteps: steps per full step.
        step_substeps: field angle of one step.
        initial_substeps: field angle in the home state.
        cycle_substeps: field angle of a cycle.
        parts: shape (4 * microsteps, 2), currents of A and B as fractions of the full current, from the lowest angle
            on.
        power: highest sum of the squares of both fractions, which heats the bridges.
    """

    microsteps: int
    step_substeps: int
    initial_substeps: int
    cycle_substeps: int
    parts: FloatArray
    power: float

    @property
    def first_substeps(self) -> int:
        """Lowest angle of the mode, with state 0."""
        return self.initial_substeps % self.step_substeps

    def nearest_state(self, substeps: int) -> int:
        """Return the highest angle of the mode that is not above `substeps`."""
        past = (substeps - self.initial_substeps) % self.step_substeps
        return (substeps - past) % self.cycle_substeps

    def states(self, substeps: Int64Array) -> Int64Array:
        """Return the state number at each angle; the angles must be those of the mode."""
        states: Int64Array = (substeps - self.first_substeps) % self.cycle_substeps // self.step_substeps
        return states


def excitations(sheet: ChipSheet) -> Mapping[int, Excitation]:
    """Return the modes of a chip by microsteps."""
    return {microsteps: _excitation(sheet, microsteps) for microsteps in sheet.microsteps}


def _excitation(sheet: ChipSheet, microsteps: int) -> Excitation:
    full_steps = microsteps == 1
    cycle, step = CYCLE_FULL_STEPS * sheet.substeps, sheet.substeps // microsteps
    home_deg = sheet.home_full_deg.value if full_steps else sheet.home_deg.value
    initial = round(home_deg * cycle / 360) % cycle
    angles = np.arange(initial % step, cycle, step, dtype=np.int64)
    parts = np.column_stack([_cosine(sheet, angles), _cosine(sheet, angles - cycle // 4)])
    if full_steps and sheet.both_full:
        parts = np.sign(parts)
    power = 2.0 if full_steps and sheet.both_full else 1.0
    return Excitation(microsteps, step, initial, cycle, parts, power)


def _cosine(sheet: ChipSheet, angles: Int64Array) -> FloatArray:
    """Return a phase's fraction of the full current at angles from its peak."""
    cycle = CYCLE_FULL_STEPS * sheet.substeps
    if sheet.vector_percent is None:
        return np.cos(2.0 * pi * angles / cycle).round(12)
    quarter = np.array(sheet.vector_percent.value)
    from_peak = np.minimum(angles % cycle, -angles % cycle) * 4 * (quarter.size - 1) // cycle
    percent = (
        np.where(from_peak < quarter.size, 1, -1) * quarter[np.minimum(from_peak, 2 * quarter.size - 2 - from_peak)]
    )
    return np.asarray(percent / 100, dtype=np.float64)
