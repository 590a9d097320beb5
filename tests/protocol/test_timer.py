"""Nanoseconds in counts of the timer."""

import pytest

from steptwin.protocol.timer import counts_of_ns


@pytest.mark.parametrize(
    ("ns", "counts"), [(0, 0), (1, 1), (13, 1), (14, 2), (30_000, 2160), (33_000, 2376), (33_666, 2424)]
)
def test_nanoseconds_round_up_to_counts(ns: int, counts: int) -> None:
    """One count is 13.89 ns; a minimum time must never become shorter."""
    assert counts_of_ns(ns) == counts
