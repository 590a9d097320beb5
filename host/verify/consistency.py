"""Whether a driver's count follows from the pins that it is said to have seen: for evidence from a file.

As long as no limit of the driver was broken there is nothing to choose: each CLK rise out of reset is a step, and DIR
says which way. After a violation the driver's model has the say, and the run has failed anyway.
"""

import numpy as np

from steptwin.host.verify.evidence import AxisEvidence, Int8Array, Int64Array


def contradictions(axis: AxisEvidence) -> list[str]:
    """What does not fit together, one line each."""
    rises, steps = axis.clk_rise_counts, axis.step_counts
    checks = [(int(np.setdiff1d(steps, rises).size), "steps without a CLK rise")]
    if axis.violations.counts.size == 0:
        heard = rises[_levels_at(rises, axis.pins["reset"].counts, axis.pins["reset"].levels) == 1]
        against = 2 * _levels_at(steps, axis.dir_edge_counts, axis.dir_levels) - 1 != axis.step_signs
        checks += [
            (int(np.setdiff1d(heard, steps).size), "CLK rises that are no steps, though no limit was broken"),
            (int(np.count_nonzero(against)), "steps against the DIR pin, though no limit was broken"),
        ]
    return [f"{axis.name}: {count} {what}" for count, what in checks if count]


def _levels_at(instants: Int64Array, counts: Int64Array, levels: Int8Array) -> Int8Array:
    """A pin's level at each instant, low before its first edge; an edge at the very instant is seen already."""
    history = np.concatenate((np.zeros(1, np.int8), levels))
    return history[np.searchsorted(counts, instants, side="right")]
