"""Arrays of edges: their levels, their delays, and parts put together."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from steptwin.emulator.board.edges import Delay, levels_at, merged
from tests.one_example import one_example


@pytest.mark.slow
@given(st.lists(st.lists(st.integers(-5, 40)), max_size=4))
def test_merged_parts_are_a_sorted_set(parts: list[list[int]]) -> None:
    counts = np.array([count for part in parts for count in sorted(part)], dtype=np.int64)
    assert merged(counts).tolist() == sorted({*counts.tolist()})


@pytest.mark.parametrize(("width", "arrivals"), [(49, []), (50, []), (51, [150, 151])])
def test_a_level_that_lasts_no_longer_than_the_delays_differ_is_lost(width: int, arrivals: list[int]) -> None:
    edges, levels = np.array([100, 100 + width]), np.array([1, 0], dtype=np.int8)
    passed, levels_after = Delay(to_high=50).passed(edges, levels)
    assert passed.tolist() == arrivals
    assert levels_after.tolist() == [1, 0][: len(arrivals)]


def test_an_edge_has_happened_at_its_very_time() -> None:
    times, edges, levels = np.array([9, 10, 19, 20]), np.array([10, 20]), np.array([1, 0], dtype=np.int8)
    assert levels_at(times, edges, levels, before=0).tolist() == [0, 1, 1, 0]


@pytest.mark.parametrize("parts", [[], [[]], [[3, 3, 40], [-5, 3]], [[1, 2], [2, 1], [0]]])
def test_some_merged_parts(parts: list[list[int]]) -> None:
    one_example(test_merged_parts_are_a_sorted_set, parts)
