"""The averaged parameter against sums of small parts, and its promises at both ends."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from steptwin.host.planning.fastest.averaged import Averaged


def _law(squares: list[float], average_s: float, slower: float = 1.0) -> Averaged:
    inner = np.array(squares)
    return Averaged.of(np.linspace(0.0, 3.0, len(inner) + 2), np.concatenate([[0.0], inner, [0.0]]), average_s, slower)


laws = st.builds(_law, st.lists(st.floats(0.05, 25.0), min_size=1, max_size=12), st.floats(0.005, 0.3), st.floats(1, 2))


@settings(max_examples=60, deadline=None)
@given(laws)
def test_is_the_mean_of_what_it_averages(law: Averaged) -> None:
    shrink = (law.times_s[-1] + law.average_s) / law.duration_s
    t_s = np.linspace(0.0, law.duration_s, 41)
    value, speed = law.at(t_s)
    inside = np.linspace(0.0, 1.0, 2001)
    fine_s = np.linspace(0.0, law.times_s[-1], 20_001)
    i = np.clip(np.searchsorted(law.times_s, fine_s, side="right") - 1, 0, len(law.times_s) - 2)
    part = (fine_s - law.times_s[i]) / (law.times_s[i + 1] - law.times_s[i])
    speeds = law.speeds[i] + part * (law.speeds[i + 1] - law.speeds[i])
    raw = np.concatenate([[0.0], np.cumsum((speeds[1:] + speeds[:-1]) / 2 * np.diff(fine_s))])
    for k, t in enumerate(t_s):
        window_s = t * shrink - law.average_s * (1.0 - inside)
        mean = np.trapezoid(np.interp(window_s, fine_s, raw), inside)
        assert value[k] == pytest.approx(mean, abs=2e-4)
        end, begin = np.interp([t * shrink, t * shrink - law.average_s], fine_s, raw)
        assert speed[k] == pytest.approx((end - begin) / law.average_s * shrink, abs=2e-3)


@settings(max_examples=60, deadline=None)
@given(laws)
def test_begins_and_ends_exactly_at_rest_and_never_turns_back(law: Averaged) -> None:
    value, speed = law.at(np.array([0.0, law.duration_s]))
    assert value.tolist() == [0.0, 3.0]
    assert speed == pytest.approx([0.0, 0.0], abs=1e-9)
    assert round(1000 * law.duration_s) == pytest.approx(1000 * law.duration_s, abs=1e-9)
    assert (np.diff(law.at(np.linspace(0.0, law.duration_s, 500))[0]) > -1e-12).all()


@settings(max_examples=40, deadline=None)
@given(laws, st.floats(0.01, 2.99))
def test_says_when_it_is_at_a_value(law: Averaged, s: float) -> None:
    assert law.at(np.array([law.time_at(s)]))[0][0] == pytest.approx(s, abs=1e-6)


def test_jerk_is_at_most_twice_the_acceleration_over_the_time_of_averaging() -> None:
    law = _law([4.0, 4.0, 4.0, 4.0], 0.1)
    highest = np.abs(np.diff(law.speeds) / np.diff(law.times_s)).max()
    t_s = np.arange(0.0, law.duration_s, 1e-4)
    jerk = np.diff(law.at(t_s)[1], 2) / 1e-8
    assert np.abs(jerk).max() <= 2.0 * highest / 0.1 * 1.001


def test_lasts_as_long_as_before_and_the_time_of_averaging_in_whole_milliseconds() -> None:
    law = _law([4.0], 0.02)
    assert law.duration_s == pytest.approx(np.ceil(1000 * (2 * 2 * 1.5 / 2.0 + 0.02)) / 1000)
    assert _law([4.0], 0.02, 1.5).duration_s == pytest.approx(1.5 * 3.02, abs=1e-3)
