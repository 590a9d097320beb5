"""Check evidence from a file: does each driver's count follow from its pins?

As long as no limit of the driver was broken, the pins decide: each CLK rise outside reset is a step, and DIR gives its
direction. After a violation the driver's model decides, and the run has failed anyway.

A driver makes the steps of its own mode, which its pins M1 and M2 or its module's switches select. A full step is a
quarter of an electrical cycle of 64 sixteenths, so a step turns the field by 16, 8, 2 or 1 of them.
"""

from typing import Final

import numpy as np

from steptwin.host.common.arrays import FloatArray, Int8Array, Int64Array
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


def contradictions(axis: AxisEvidence) -> list[str]:
    """Return one line for each contradiction between an axis' pins and its steps."""
    rises, steps = axis.clk_rise_counts, axis.step_counts
    checks = [(int(np.setdiff1d(steps, rises).size), "steps without a CLK rise")]
    if axis.violations.counts.size == 0:
        heard = rises[_levels_at(rises, axis.pins["reset"].counts, axis.pins["reset"].levels) == 1]
        against = 2 * _levels_at(steps, axis.dir_edge_counts, axis.dir_levels) - 1 != axis.step_signs
        checks += [
            (int(np.setdiff1d(heard, steps).size), "CLK rises without a step, though no limit was broken"),
            (int(np.count_nonzero(against)), "steps against the DIR pin, though no limit was broken"),
        ]
    return [f"{axis.name}: {count} {what}" for count, what in checks if count]


def _levels_at(instants: Int64Array, counts: Int64Array, levels: Int8Array) -> Int8Array:
    """Return a pin's level at each instant: low before its first edge, and after an edge at the instant itself."""
    history = np.concatenate((np.zeros(1, np.int8), levels))
    return history[np.searchsorted(counts, instants, side="right")]
