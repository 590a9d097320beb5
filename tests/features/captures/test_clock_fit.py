"""The plan's time in a capture is found for any clock and any beginning, with steps lost, doubled or before it."""

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from steptwin.host.verify.clock_fit import fit_clock
from steptwin.host.verify.clock_line import CapturedSteps
from steptwin.host.verify.oracle import IdealSteps, ideal_steps
from tests.host.verify.motions import expect, motion, sines, trapezoid

WAYS = sines([(20.0, 2.0, 0.0)]), trapezoid(10.0, -150.3, 3.0, 1.0), sines([(9.7, 3.0, 1.0), (4.0, 0.3, 0.0)])
MOTION = expect(motion(10.0, *WAYS), 80.0, 40.0, 44.4)
IDEAL = ideal_steps(MOTION.axis_motion, MOTION.steps_per_unit, (0, 0, round(9.7 * np.sin(1.0) * 44.4)))


def seen(plan: IdealSteps, offset_s: float, ppm: float, lost: list[int], before: int) -> CapturedSteps:
    """Return the steps of a plan by another clock, without some, and with others before the motion."""
    keep = np.ones(plan.time_s.size, np.bool_)
    keep[np.array(lost, np.int64) % plan.time_s.size] = False
    time_s = offset_s + plan.time_s[keep] * (1.0 + ppm * 1e-6)
    early_s = offset_s - 1.0 - 2e-3 * np.arange(before)[::-1]
    signs = np.concatenate([np.full(before, -1, np.int8), plan.signs[keep]])
    return CapturedSteps(np.concatenate([early_s, time_s]), signs)


@pytest.mark.slow
@example(offset_s=29.0, ppm=1.0, lost=[0], before=0)
@given(
    offset_s=st.floats(0.0, 30.0),
    ppm=st.floats(-200.0, 200.0),
    lost=st.lists(st.integers(0, 10_000), max_size=5),
    before=st.integers(0, 50),
)
def test_offset_and_ratio_are_found(offset_s: float, ppm: float, lost: list[int], before: int) -> None:
    clock = fit_clock(IDEAL, [seen(plan, offset_s + 2.0, ppm, lost, before) for plan in IDEAL])
    assert clock.found
    assert (clock.inverted, clock.swapped) == ((), ())
    assert abs(clock.ppm - ppm) < 0.2
    assert abs(clock.offset_s - offset_s - 2.0) < 0.1e-6


@pytest.mark.slow
def test_an_axis_that_turns_the_other_way_and_two_that_are_swapped() -> None:
    there = [seen(plan, 1.0, 20.0, [], 0) for plan in IDEAL]
    turned = [there[0], CapturedSteps(there[1].time_s, -there[1].signs), there[2]]
    assert fit_clock(IDEAL, turned).inverted == (1,)
    assert abs(fit_clock(IDEAL, turned).ppm - 20.0) < 0.2
    assert fit_clock(IDEAL, [there[1], there[0], there[2]]).swapped == ((0, 1),)


def test_nothing_is_found_where_nothing_moves() -> None:
    rest = CapturedSteps(np.empty(0), np.empty(0, np.int8))
    assert not fit_clock(IDEAL, [rest] * 3).found
