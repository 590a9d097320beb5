"""Cut evidence at an instant, as if nothing had happened at the drivers from then on."""

from dataclasses import replace
from typing import Any

import numpy as np

from steptwin.host.common.arrays import Int64Array
from steptwin.host.verify import AxisEvidence, DriverViolations, Evidence, LevelEdges, Phases, Slips


def evidence_until(evidence: Evidence, until_counts: int) -> Evidence:
    """Return the evidence before an instant; a pulse that has begun before it is whole."""
    return replace(
        evidence,
        axes=tuple(_axis_until(axis, until_counts) for axis in evidence.axes),
        outputs=tuple(change for change in evidence.outputs if change.counts < until_counts),
    )


def _axis_until(axis: AxisEvidence, until_counts: int) -> AxisEvidence:
    def before(counts: Int64Array) -> slice:
        return slice(int(np.searchsorted(counts, until_counts)))

    pulses, turns, steps = before(axis.clk_rise_counts), before(axis.dir_edge_counts), before(axis.step_counts)
    changes: dict[str, Any] = {
        "clk_rise_counts": axis.clk_rise_counts[pulses],
        "clk_fall_counts": axis.clk_fall_counts[pulses],
        "dir_edge_counts": axis.dir_edge_counts[turns],
        "dir_levels": axis.dir_levels[turns],
        "step_counts": axis.step_counts[steps],
        "step_signs": axis.step_signs[steps],
    }
    violations, phases, slips = axis.violations, axis.phases, axis.slips
    broken, set_at, slipped = before(violations.counts), before(phases.counts), before(slips.counts)
    return replace(
        axis,
        **changes,
        violations=DriverViolations(
            violations.limits, violations.counts[broken], violations.which[broken], violations.values[broken]
        ),
        phases=Phases(phases.counts[set_at], phases.sixteenths[set_at], phases.a_ma[set_at], phases.b_ma[set_at]),
        pins={pin: _level_until(edges, until_counts) for pin, edges in axis.pins.items()},
        slips=Slips(slips.counts[slipped], slips.full_steps[slipped]),
    )


def _level_until(edges: LevelEdges, until_counts: int) -> LevelEdges:
    kept = slice(int(np.searchsorted(edges.counts, until_counts)))
    return LevelEdges(edges.counts[kept], edges.levels[kept])
