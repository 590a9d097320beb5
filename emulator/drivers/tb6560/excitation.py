"""The four excitation modes: phase currents in each state, and the initial state, in which MO is low.

The field's angle counts sixteenths of a full step, 64 in a cycle, and grows clockwise. The current of A is its cosine,
that of B its sine, in the steps of the vector table on page 8. In two-phase excitation both currents are always full.
"""

from enum import IntEnum
from typing import Final

import numpy as np

from steptwin.emulator.board.edges import Int8Array, Int64Array

FULL_STEP_SIXTEENTHS: Final = 16
CYCLE_SIXTEENTHS: Final = 4 * FULL_STEP_SIXTEENTHS
_QUARTER: Final = CYCLE_SIXTEENTHS // 4

VECTOR_PERCENT: Final = (100, 100, 98, 96, 92, 88, 83, 77, 71, 63, 56, 47, 38, 29, 20, 10, 0)
"""Current of a phase in percent of its peak, at 0 to 90 degrees from the peak (page 8, typical values)."""


class Excitation(IntEnum):
    """A mode by the datasheet's name; its value is the number of steps in a full step."""

    TWO_PHASE = 1
    ONE_TWO_PHASE = 2
    TWO_W_ONE_TWO_PHASE = 8
    FOUR_W_ONE_TWO_PHASE = 16

    @property
    def step_sixteenths(self) -> int:
        """Angle by which a step turns the field."""
        return 16 // self

    @property
    def initial_sixteenths(self) -> int:
        """Angle of the field in the initial state: A full and B full negative in two-phase, else A alone (page 9)."""
        return CYCLE_SIXTEENTHS - _QUARTER // 2 if self is Excitation.TWO_PHASE else 0

    def nearest_state(self, sixteenths: int) -> int:
        """Return the mode's own angle that is equal to an angle or next below it."""
        past = (sixteenths - self.initial_sixteenths) % self.step_sixteenths
        return (sixteenths - past) % CYCLE_SIXTEENTHS


def phase_percent(excitation: Excitation) -> Int8Array:
    """Return the currents of A and B by the field's angle, shape (64, 2); 0 at angles that the mode does not take."""
    percent = np.zeros((CYCLE_SIXTEENTHS, 2), dtype=np.int8)
    for sixteenths in states(excitation).tolist():
        a, b = _cosine(sixteenths), _cosine(sixteenths - _QUARTER)
        percent[sixteenths] = (100 * _sign(a), 100 * _sign(b)) if excitation is Excitation.TWO_PHASE else (a, b)
    percent.setflags(write=False)
    return percent


def states(excitation: Excitation) -> Int64Array:
    """Return the mode's angles in clockwise order, the initial state first (pages 12 to 14)."""
    turned = np.arange(0, CYCLE_SIXTEENTHS, excitation.step_sixteenths)
    return (excitation.initial_sixteenths + turned) % CYCLE_SIXTEENTHS


def _cosine(sixteenths: int) -> int:
    from_peak = sixteenths % CYCLE_SIXTEENTHS
    from_peak = min(from_peak, CYCLE_SIXTEENTHS - from_peak)
    return VECTOR_PERCENT[from_peak] if from_peak <= _QUARTER else -VECTOR_PERCENT[2 * _QUARTER - from_peak]


def _sign(value: int) -> int:
    return (value > 0) - (value < 0)


PHASE_PERCENT: Final = {excitation: phase_percent(excitation) for excitation in Excitation}
