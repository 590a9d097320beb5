"""What the models do with arrays of edges."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from steptwin.emulator.board.edges import merged


@given(st.lists(st.lists(st.integers(-5, 40)), max_size=4))
def test_merged_parts_are_a_sorted_set(parts: list[list[int]]) -> None:
    counts = np.array([count for part in parts for count in sorted(part)], dtype=np.int64)
    assert merged(counts).tolist() == sorted({*counts.tolist()})
