"""The histogram of lateness: of bounded size, and right to a sixteenth."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from steptwin.emulator.live.lateness import Lateness


def lateness_of(values_ns: list[int]) -> Lateness:
    lateness = Lateness()
    for value in values_ns:
        lateness.add(value)
    return lateness


def test_nothing_was_never_late() -> None:
    lateness = Lateness()
    assert (lateness.count, lateness.max_ns, lateness.percentile_ns(99)) == (0, 0, 0)


def test_small_ones_are_exact() -> None:
    lateness = lateness_of(list(range(32)))
    assert [lateness.percentile_ns(percent) for percent in (0, 50, 75, 100)] == [0, 15, 23, 31]


def test_early_events_count_as_not_late() -> None:
    assert lateness_of([-5, -1]).percentile_ns(100) == 0


def test_one_outlier_is_the_maximum_and_no_more() -> None:
    lateness = lateness_of([1000] * 999 + [10**9])
    assert lateness.max_ns == 10**9
    assert 1000 <= lateness.percentile_ns(99) <= 1000 * 17 / 16


@given(st.lists(st.integers(0, 10**12), min_size=1), st.integers(1, 100))
def test_a_percentile_is_at_most_a_sixteenth_too_large(values_ns: list[int], percent: int) -> None:
    exact = sorted(values_ns)[-(-percent * len(values_ns) // 100) - 1]
    assert exact <= lateness_of(values_ns).percentile_ns(percent) <= exact * 17 / 16


@pytest.mark.parametrize("count", [10, 10_000])
def test_it_does_not_grow_with_their_number(count: int) -> None:
    lateness = lateness_of([10**6 + i % 7 for i in range(count)])
    assert lateness.count == count
    assert len(lateness._counts) == 1  # noqa: SLF001
