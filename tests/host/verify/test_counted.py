"""Compare the count around an instant with a count of the steps by hand."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from steptwin.host.verify.counted import counted_steps
from steptwin.host.verify.evidence import AxisEvidence
from steptwin.protocol.drivers import ActiveEdge
from steptwin.protocol.timer import COUNTS_PER_SECOND
from tests.host.verify.motions import NO_PHASES, NO_VIOLATIONS

INSTANTS = st.integers(0, 40)
"""Instants in counts, from a range so small that several steps and instants often coincide."""


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
    none = np.empty(0, dtype=np.int64)
    axis = AxisEvidence(
        name="joint",
        start_steps=100,
        clk_rise_counts=none,
        clk_fall_counts=none,
        active_edge=ActiveEdge.RISING,
        dir_edge_counts=none,
        dir_levels=none.astype(np.int8),
        step_counts=np.array([counts for counts, _ in steps], dtype=np.int64),
        step_signs=np.array([sign for _, sign in steps], dtype=np.int8),
        violations=NO_VIOLATIONS,
        phases=NO_PHASES,
        pins={},
    )
    t_s = np.array(instants) / COUNTS_PER_SECOND
    before, after = counted_steps(axis, start_counts).around(t_s)
    made = [[sign for counts, sign in steps if counts < start_counts + i] for i in instants]
    assert before.tolist() == [100 + sum(signs) for signs in made]
    made = [[sign for counts, sign in steps if counts <= start_counts + i] for i in instants]
    assert after.tolist() == [100 + sum(signs) for signs in made]
