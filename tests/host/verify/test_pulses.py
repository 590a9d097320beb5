"""Measure pulses by hand: which level of STEP is the chip's CLK high, and from which edge to which a period lasts."""

from dataclasses import replace

import numpy as np
import pytest

from steptwin.host.verify.pulses import clk_durations, pulse_facts
from steptwin.protocol.drivers import ActiveEdge
from tests.host.verify.test_counted import stepping

PULSES = replace(
    stepping([(0, 1), (1000, 1), (2500, -1)]),
    clk_rise_counts=np.array([0, 1000, 2500]),
    clk_fall_counts=np.array([100, 1300, 2700]),
)
"""Pulses of 100, 300 and 200 counts: rises 1000 and 1500 counts apart, falls 1200 and 1400."""


@pytest.mark.parametrize(
    ("edge", "high", "low", "period"),
    [
        (ActiveEdge.RISING, [100, 300, 200], [900, 1200], [1000, 1500]),
        (ActiveEdge.FALLING, [900, 1200], [100, 300, 200], [1200, 1400]),
    ],
)
def test_durations_by_the_active_edge(edge: ActiveEdge, high: list[int], low: list[int], period: list[int]) -> None:
    durations = clk_durations(replace(PULSES, active_edge=edge))
    assert [each.tolist() for each in durations] == [high, low, period]


def test_facts_of_the_whole_evidence() -> None:
    facts = pulse_facts(PULSES)
    assert (facts.pulses, facts.reversals, facts.peak_rate_hz) == (3, 1, 72_000.0)
    assert facts.mean_step_interval_us == pytest.approx(1250 / 72)
    assert facts.clk_high_us_min == pytest.approx(100 / 72)
    assert facts.clk_low_us_min == 12.5
