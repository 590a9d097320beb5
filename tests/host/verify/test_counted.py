"""Compare the count around an instant with a count of the steps by hand."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from steptwin.host.verify.counted import clk_durations, counted_steps, motor_moves
from steptwin.host.verify.evidence import NO_SLIPS, AxisEvidence, Phases, Slips
from steptwin.protocol.drivers import ActiveEdge
from steptwin.protocol.timer import COUNTS_PER_SECOND
from tests.host.verify.motions import NO_PHASES, NO_VIOLATIONS

INSTANTS = st.integers(0, 40)
"""Instants in counts, from a range so small that several steps and instants often coincide."""


NONE = np.empty(0, dtype=np.int64)


def stepping(steps: list[tuple[int, int]], slips: Slips = NO_SLIPS) -> AxisEvidence:
    """Return the evidence of an axis at 100 steps that makes these steps: instants and signs."""
    return AxisEvidence(
        name="joint",
        start_steps=100,
        clk_rise_counts=NONE,
        clk_fall_counts=NONE,
        active_edge=ActiveEdge.RISING,
        dir_edge_counts=NONE,
        dir_levels=NONE.astype(np.int8),
        step_counts=np.array([counts for counts, _ in steps], dtype=np.int64),
        step_signs=np.array([sign for _, sign in steps], dtype=np.int8),
        violations=NO_VIOLATIONS,
        phases=NO_PHASES,
        pins={},
        slips=slips,
    )


@pytest.mark.slow
@given(
    steps=st.lists(st.tuples(INSTANTS, st.sampled_from([-1, 1])), max_size=20),
    instants=st.lists(INSTANTS, min_size=1, max_size=20),
    start_counts=st.integers(0, 20),
)
def test_counts_just_before_and_just_after_an_instant(
    steps: list[tuple[int, int]], instants: list[int], start_counts: int
) -> None:
    """A step at the instant itself lies between the two counts; steps before t = 0 set the start."""
    steps.sort(key=lambda step: step[0])
    instants.sort()
    axis = stepping(steps)
    t_s = np.array(instants) / COUNTS_PER_SECOND
    before, after = counted_steps(axis, start_counts).around(t_s)
    made = [[sign for counts, sign in steps if counts < start_counts + i] for i in instants]
    assert before.tolist() == [100 + sum(signs) for signs in made]
    made = [[sign for counts, sign in steps if counts <= start_counts + i] for i in instants]
    assert after.tolist() == [100 + sum(signs) for signs in made]


@pytest.mark.parametrize(("slip_counts", "start_steps"), [(9, 140), (10, 100), (11, 100)])
def test_a_slip_before_t_0_is_in_the_count_at_the_start(slip_counts: int, start_steps: int) -> None:
    """Five full steps of 8 microsteps; t = 0 is at 10 counts, before the only step."""
    slips = Slips(np.array([slip_counts]), np.array([5]))
    counted = counted_steps(stepping([(20, 1)], slips), 10, microsteps=8)
    assert counted.start_steps == start_steps
    assert counted.positions.tolist() == [140, 141]


@pytest.mark.parametrize(
    ("per_full_step", "step", "planned", "move"),
    [
        pytest.param(16, 1, 16, 1.0, id="1/16 as planned"),
        pytest.param(16, 2, 16, 2.0, id="1/8 for 1/16"),
        pytest.param(16_000, 125, 128, 1.0, id="1/128 as planned"),
        pytest.param(16_000, 3200, 5, 1.0, id="1/5 as planned"),
        pytest.param(16_000, 128, 128, 1.024, id="1/125 for 1/128"),
        pytest.param(256, 1, 256, 1.0, id="1/256 as planned"),
    ],
)
def test_a_step_is_as_long_as_the_field_turned(per_full_step: int, step: int, planned: int, move: float) -> None:
    """Three steps up, against the field, across the end of its cycle."""
    instants = np.array([100, 200, 300])
    angles = (step - step * np.arange(4)) % (4 * per_full_step)
    currents = np.zeros(4, np.int16)
    phases = Phases(np.array([0, *instants]), angles.astype(np.int32), currents, currents, per_full_step)
    axis = replace(stepping([(at, 1) for at in instants]), phases=phases)
    assert motor_moves(axis, planned).tolist() == [move] * 3


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
