"""The trajectory's time from ramps of its rate: against sums over single ticks, on both sides of each ramp's ends."""

from fractions import Fraction

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from steptwin.host.verify.evidence import AS_PLANNED, RateRamps

TICK = 18_000
SECOND = 72_000_000
FULL = 65_536

SCRIPTS = st.lists(
    st.tuples(st.integers(0, 400), st.sampled_from([0, 6_554, 32_768, FULL, 98_304]), st.integers(0, 300)), max_size=8
)
"""Ticks to the next ramp, the rate at its end, and the ticks that it takes."""


def ramps_of(script: list[tuple[int, int, int]], start: int) -> tuple[RateRamps, list[Fraction]]:
    """Return ramps as a board records them, and the rate in the middle of each tick from the start on."""
    rows, rates = [], list[Fraction]()
    tick, rate = start, Fraction(FULL)
    begin, from_rate, to, lasts = start, rate, FULL, 0

    def at(when: Fraction) -> Fraction:
        return Fraction(to) if when >= begin + lasts else from_rate + (to - from_rate) * (when - begin) / lasts

    for wait, target, ticks in [*script, (500, FULL, 0)]:
        rates += [at(tick + i + Fraction(1, 2)) for i in range(wait)]
        tick += wait
        from_rate = Fraction(int(at(Fraction(tick))))
        begin, to, lasts = tick, target, ticks
        rows.append((tick * TICK, int(from_rate), target, ticks * TICK))
    rates += [at(tick + i + Fraction(1, 2)) for i in range(500)]
    return RateRamps(*np.array(rows, np.int64).T), rates


@pytest.mark.slow
@given(script=SCRIPTS, start=st.integers(0, 10**6))
def test_it_is_the_sum_of_the_rates_of_all_ticks(script: list[tuple[int, int, int]], start: int) -> None:
    """The middle of a tick has its mean rate, unless a ramp ends within it; ramps end at ticks."""
    ramps, rates = ramps_of(script, start)
    sums_s = np.cumsum([0.0, *(float(rate) / FULL * TICK / SECOND for rate in rates)])
    counts = (start + np.arange(len(rates) + 1)) * TICK
    found_s = ramps.trajectory_s(counts, start * TICK)
    assert np.abs(found_s - sums_s).max() < 1e-9
    assert (np.diff(found_s) >= 0).all()


def test_before_the_start_and_without_ramps_it_is_the_clocks() -> None:
    counts = np.array([-SECOND, 0, SECOND, 5 * SECOND])
    assert AS_PLANNED.trajectory_s(counts, SECOND).tolist() == [-2, -1, 0, 4]
    half = RateRamps(*np.array([(3 * SECOND, FULL, FULL // 2, 0)], np.int64).T)
    assert half.trajectory_s(counts, SECOND).tolist() == [-2, -1, 0, 3]
    assert (
        half.trajectory_s(counts, 3 * SECOND + 1).tolist() == AS_PLANNED.trajectory_s(counts, 3 * SECOND + 1).tolist()
    )


def test_a_single_instant_has_its_time_and_the_time_its_instant() -> None:
    """1 s as planned, 2 s down to rest, 3 s of rest, then half as fast: 2 s of the trajectory are over after 6 s."""
    ramps = RateRamps(*np.array([(SECOND, FULL, 0, 2 * SECOND), (6 * SECOND, 0, FULL // 2, 0)], np.int64).T)
    assert float(ramps.trajectory_s(np.array(4 * SECOND), 0)) == 2.0
    assert float(ramps.trajectory_s(np.array(8 * SECOND), 0)) == 3.0
    for t_s, instant_s in ((0.5, 0.5), (1.75, 2.0), (2.5, 7.0), (9.0, 20.0)):
        assert ramps.instant_counts(t_s, 0, 20 * SECOND) == pytest.approx(instant_s * SECOND, abs=1)


def test_the_speeds_of_a_motion_and_when_they_began() -> None:
    rows = [(0, FULL, FULL // 2, 0), (SECOND, FULL, 0, 2 * SECOND), (6 * SECOND, 0, 98_304, SECOND)]
    ramps = RateRamps(*np.array(rows, np.int64).T)
    found = ramps.speeds(SECOND // 2)
    assert [(each.percent, each.after_s, each.at_s, each.ramp_s) for each in found] == [
        (0.0, 0.5, 0.5, 2.0),
        (150.0, 5.5, 1.5, 1.0),
    ]
    assert AS_PLANNED.speeds(0) == ()
