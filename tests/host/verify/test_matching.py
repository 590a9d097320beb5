"""Which step answers a crossing, and which have a timing error: those at crossings that are not slow, by the docs."""

import numpy as np
import pytest

from steptwin.host.verify.counted import CountedSteps
from steptwin.host.verify.matching import match_steps, timing_errors_us
from steptwin.host.verify.oracle import IdealSteps

LATE_US = 3.0


def test_crossings_slower_than_1_percent_of_the_fastest_have_no_timing_error() -> None:
    """Of 10 kHz: 100 Hz still counts, 99.9 Hz does not."""
    speeds_hz = np.array([10_000.0, 100.0, 99.9, 400.0, 0.0])
    time_s = np.arange(1.0, 6.0)
    signs = np.ones(5, np.int8)
    ideal = IdealSteps(0, time_s, signs, speeds_hz, time_s[-1:])
    late_us = LATE_US * np.arange(1, 6)
    counted = CountedSteps(time_s + late_us / 1e6, signs, np.arange(6), np.arange(6.0))
    errors_us = timing_errors_us(ideal, counted, match_steps(ideal, counted))
    assert np.round(errors_us, 3).tolist() == [3.0, 6.0, 12.0]


def test_of_two_steps_that_are_equally_near_the_earlier_answers() -> None:
    ideal = IdealSteps(0, np.array([1.0]), np.ones(1, np.int8), np.ones(1), np.ones(1))
    counted = CountedSteps(np.array([0.5, 1.5]), np.ones(2, np.int8), np.arange(3), np.arange(3.0))
    matching = match_steps(ideal, counted)
    assert (matching.ideal.tolist(), matching.counted.tolist(), matching.unmatched) == ([0], [0], 1)


def test_a_crossing_is_slow_by_the_fastest_of_the_axis_even_if_no_step_answers_that() -> None:
    """100 Hz is below 1 % of the 20 kHz of the crossing that lost its step."""
    ideal = IdealSteps(
        0, np.array([1.0, 2.0, 3.0]), np.array([1, -1, 1], np.int8), np.array([100.0, 20_000.0, 400.0]), np.array([3.0])
    )
    counted = CountedSteps(np.array([1.1, 3.1]), np.ones(2, np.int8), np.arange(3), np.arange(3.0))
    matching = match_steps(ideal, counted)
    assert (matching.ideal.tolist(), matching.unmatched) == ([0, 2], 1)
    assert timing_errors_us(ideal, counted, matching) == pytest.approx([1e5])
