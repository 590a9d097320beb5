"""The wall clock as the board's clock: exact both ways, and without drift."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from steptwin.emulator.live.live_simulation import SPEED_MAX, SPEED_MIN, Pacer
from tests.messages import refusing
from tests.one_example import one_example

COUNTS = st.integers(0, 1 << 56)
"""30 years."""
SPEEDS = st.floats(SPEED_MIN, SPEED_MAX)
STARTS = st.integers(0, 1 << 62)


def test_a_tick_is_250_us() -> None:
    pacer = Pacer(5_000)
    assert pacer.counts_at(5_000) == 0
    assert pacer.counts_at(255_000) == 18_000
    assert pacer.counts_at(254_999) == 17_999
    assert pacer.ns_at(18_000) == 255_000


def test_at_twice_the_speed_125_us() -> None:
    assert Pacer(0, 2.0).ns_at(18_000) == 125_000


def test_a_day_has_all_its_counts() -> None:
    assert Pacer(0).counts_at(86_400 * 10**9) == 86_400 * 72_000_000


@given(STARTS, SPEEDS, COUNTS)
def test_the_first_nanosecond_of_a_count(start_ns: int, speed: float, counts: int) -> None:
    """A count may be so short that no nanosecond begins in it: then the first nanosecond after it is returned."""
    pacer = Pacer(start_ns, speed)
    ns = pacer.ns_at(counts)
    assert pacer.counts_at(ns) >= counts
    assert pacer.counts_at(ns - 1) < counts


@pytest.mark.slow
@given(STARTS, SPEEDS, COUNTS, st.integers(0, 1 << 40))
def test_while_it_stands_no_count_begins(start_ns: int, speed: float, counts: int, dt_ns: int) -> None:
    """The count at the end of the pause is that at its beginning, and all later ones begin later by it."""
    pacer = Pacer(start_ns, speed)
    before_ns = pacer.ns_at(counts)
    reached = pacer.counts_at(before_ns)
    pacer.pause(dt_ns)
    assert pacer.counts_at(before_ns + dt_ns) == reached
    assert pacer.ns_at(counts) == before_ns + dt_ns
    assert pacer.paused_ns == dt_ns


@pytest.mark.parametrize("speed", [SPEED_MIN, SPEED_MAX])
def test_speeds_that_are_allowed(speed: float) -> None:
    assert Pacer(0, speed).ns_at(72_000_000) == pytest.approx(1e9 / speed)


@pytest.mark.parametrize("speed", [0.0, -1.0, SPEED_MIN * 0.999, SPEED_MAX * 1.001, float("nan"), float("inf")])
def test_speeds_out_of_range(speed: float) -> None:
    with refusing(ValueError):
        Pacer(0, speed)


@pytest.mark.parametrize("speed", [SPEED_MIN, 1.0, SPEED_MAX])
def test_some_pauses(speed: float) -> None:
    for counts, dt_ns in ((0, 1), (72_000_001, 1 << 40), (1 << 56, 0)):
        one_example(test_while_it_stands_no_count_begins, 5_000, speed, counts, dt_ns)
