"""Wilson's intervals, against values from elsewhere."""

import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.stats import binomtest

from steptwin.features.campaigns.summary import PassRate


@pytest.mark.slow
@given(st.integers(1, 10**6), st.data())
def test_intervals_are_those_of_scipy(runs: int, data: st.DataObject) -> None:
    passed = data.draw(st.integers(0, runs))
    reference = binomtest(passed, runs).proportion_ci(0.95, method="wilson")
    assert PassRate(passed, runs).interval == pytest.approx((reference.low, reference.high), abs=1e-12)


def test_all_of_some_runs() -> None:
    """After n runs that all passed, the lower end is n / (n + z^2)."""
    assert PassRate(1000, 1000).interval == pytest.approx((1000 / (1000 + 1.959963984540054**2), 1.0), abs=1e-12)
    assert PassRate(0, 0).interval == (0.0, 1.0)
