"""Count the steps that a driver made without current in its phases: its counter goes on, the motor does not follow."""

import numpy as np

from steptwin.host.verify.evidence import AxisEvidence


def powerless_steps(axis: AxisEvidence, start_counts: int) -> int:
    """Return how many steps, from an instant on, came while both phases were without current.

    ENABLE switches the outputs of a TB6560 only (its pin 4, docs/driver.md). Evidence without currents has none.
    """
    phases = axis.phases
    if not phases.counts.size:
        return 0
    steps = axis.step_counts[np.searchsorted(axis.step_counts, start_counts) :]
    before = np.searchsorted(phases.counts, steps, side="left") - 1
    known = before >= 0
    off = (phases.a_ma[before] == 0) & (phases.b_ma[before] == 0)
    return int(np.count_nonzero(off & known))
