"""Bounds of trajectory time, from the sequence numbers of executed records."""

import pytest

from steptwin.host.client.queue_feed import TrajectoryTime


def test_between_begin_and_end_of_the_record() -> None:
    reached = TrajectoryTime([10, 20, 30], now_s=100.0)
    assert reached.least_s == 0.0
    assert reached.most_s(100.005) == pytest.approx(0.015)
    reached.report(1, now_s=100.02)
    assert reached.least_s == 0.01
    assert reached.most_s(100.02) == pytest.approx(0.03)
    assert reached.most_s(107.0) == pytest.approx(7.01)
    reached.report(2, now_s=110.0)
    assert reached.least_s == 0.03
    assert reached.most_s(110.0) == pytest.approx(0.06)
    reached.end()
    assert reached.least_s == 0.06
    assert reached.most_s(110.0) == pytest.approx(0.06)


@pytest.mark.parametrize("stride", [1, 100, 127])
def test_numbers_wrap(stride: int) -> None:
    reached = TrajectoryTime([10] * 1000, now_s=0.0)
    for executing in range(0, 1000, stride):
        reached.report(executing % 256, now_s=0.0)
        assert reached.least_s == executing / 100


def test_old_numbers_are_ignored() -> None:
    reached = TrajectoryTime([10] * 1000, now_s=0.0)
    reached.report(255, now_s=1.0)  # nothing is executed yet
    assert reached.least_s == 0.0
    reached.report(40, now_s=2.0)
    reached.report(39, now_s=3.0)
    assert reached.least_s == 0.4
    assert reached.most_s(3.0) == pytest.approx(1.41)


def test_no_number_leads_beyond_the_last_record() -> None:
    reached = TrajectoryTime([10, 20, 30], now_s=0.0)
    reached.report(7, now_s=0.0)
    assert reached.least_s == 0.03


def test_a_stream_that_may_be_made_faster_may_be_further() -> None:
    """At 150 % of its speed a second of the clock is up to 1.5 s of the trajectory."""
    reached = TrajectoryTime([10, 20, 30], now_s=100.0, highest_percent=150)
    assert reached.most_s(100.0) == pytest.approx(0.01)
    assert reached.most_s(101.0) == pytest.approx(0.01 + 1.5)
    reached.report(1, now_s=101.0)
    assert reached.most_s(101.002) == pytest.approx(0.03 + 0.003)
