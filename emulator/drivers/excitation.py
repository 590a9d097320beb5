"""A chip's modes as arrays: the field's angle in each state, and the currents there.

The field's angle counts substeps of a full step, of which four full steps make a cycle. It grows with DIR low. The
current of A is its cosine, that of B its sine, in the steps of the chip's own table if it has one.
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
    """One mode.

    Attributes:
        microsteps: steps in a full step.
        step_substeps: angle by which a step turns the field.
        initial_substeps: the field's angle in the home state.
        cycle_substeps: angle of a whole cycle.
        parts: shape (4 * microsteps, 2), currents of A and B as parts of the full one, from the lowest angle on.
        power: greatest sum of the squares of both parts: what heats the bridges.
    """

    microsteps: int
    step_substeps: int
    initial_substeps: int
    cycle_substeps: int
    parts: FloatArray
    power: float

    @property
    def first_substeps(self) -> int:
        """The lowest angle of the mode, from which its states are counted."""
        return self.initial_substeps % self.step_substeps

    def nearest_state(self, substeps: int) -> int:
        """Return the mode's own angle that is equal to an angle or next below it."""
        past = (substeps - self.initial_substeps) % self.step_substeps
        return (substeps - past) % self.cycle_substeps

    def states(self, substeps: Int64Array) -> Int64Array:
        """Return the number of the state at each of some angles, which are the mode's own."""
        states: Int64Array = (substeps - self.first_substeps) % self.cycle_substeps // self.step_substeps
        return states


def excitations(sheet: ChipSheet) -> Mapping[int, Excitation]:
    """Return a chip's modes by their microsteps."""
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
    """Return a phase's part of the full current at angles from its peak."""
    cycle = CYCLE_FULL_STEPS * sheet.substeps
    if sheet.vector_percent is None:
        return np.cos(2.0 * pi * angles / cycle).round(12)
    quarter = np.array(sheet.vector_percent.value)
    from_peak = np.minimum(angles % cycle, -angles % cycle) * 4 * (quarter.size - 1) // cycle
    percent = (
        np.where(from_peak < quarter.size, 1, -1) * quarter[np.minimum(from_peak, 2 * quarter.size - 2 - from_peak)]
    )
    return np.asarray(percent / 100, dtype=np.float64)
