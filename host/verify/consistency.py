"""Check evidence from a file: does each driver's count follow from its pins?

As long as no limit of the driver was broken, the pins decide: each CLK rise outside reset is a step, and DIR gives its
direction. After a violation the driver's model decides, and the run has failed anyway.
"""

import numpy as np

from steptwin.host.common.arrays import Int8Array, Int64Array
from steptwin.host.verify.evidence import AxisEvidence


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
