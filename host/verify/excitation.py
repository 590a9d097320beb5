"""Tell by the field's angle how far each step turned the motor, whatever mode the driver was meant to be in.

A driver makes the steps of its own mode, which its pins M1 and M2 or its module's switches select. A full step is a
quarter of an electrical cycle of 64 sixteenths, so a step turns the field by 16, 8, 2 or 1 of them.
"""

from typing import Final

import numpy as np

from steptwin.host.common.arrays import FloatArray, Int64Array
from steptwin.host.verify.evidence import AxisEvidence

SIXTEENTHS: Final = 16
"""Sixteenths of a full step in a full step."""
_CYCLE_SIXTEENTHS: Final = 4 * SIXTEENTHS


def motor_moves(axis: AxisEvidence, planned: int | None) -> FloatArray:
    """Return the motor's move in each step, shape (steps,), in steps of the planned mode.

    It is +1 or -1 if the driver was in that mode. `planned` are microsteps per full step; None takes the driver's mode
    for the planned one, as a step is taken whose effect on the field's angle is not on record.
    """
    moves: FloatArray = axis.step_signs.astype(np.float64)
    if planned is None:
        return moves
    sixteenths, expected = _turns_sixteenths(axis), SIXTEENTHS // planned
    return moves if (sixteenths == expected).all() else moves * np.where(sixteenths, sixteenths / expected, 1.0)


def _turns_sixteenths(axis: AxisEvidence) -> Int64Array:
    """Return the angle by which each step turned the field, shape (steps,); 0 where the record does not tell."""
    angles, half = axis.phases.sixteenths.astype(np.int64), _CYCLE_SIXTEENTHS // 2
    turns = np.abs((np.diff(angles) + half) % _CYCLE_SIXTEENTHS - half)
    turned = np.flatnonzero(turns)
    at = np.searchsorted(axis.phases.counts[turned + 1], axis.step_counts)  # a module turns the field a little later
    sixteenths: Int64Array = np.append(turns[turned], 0)[at]
    return sixteenths
