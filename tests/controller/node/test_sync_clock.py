"""The SYNC slots alone: the slot of each SYNC, and when and how fast slots are moved."""

import random

import pytest
from hypothesis import given
from hypothesis import strategies as st

from steptwin.controller.node.sync_clock import TICK_US, WINDOW, Slot, SyncClock

START_US = 10_123


class Host:
    """Sends one SYNC each period to a clock with one axis."""

    def __init__(self, period_us: int) -> None:
        self.period_us = period_us
        self.clock = SyncClock()
        assert self.clock.join(0, period_us, START_US)
        self.clock.hear(START_US)
        self.syncs = 1

    def send(self, late_us: int) -> int:
        """Open the next slot and send its SYNC; return the duration of the slot."""
        slot = self.clock.slot
        opened = self.clock.after(slot)
        self.clock.hear(START_US + self.syncs * self.period_us + late_us)
        self.syncs += 1
        return opened.end_us - slot.end_us

    @property
    def middle_us(self) -> int:
        """Time by which the slots have been moved."""
        return self.clock.slot.end_us - START_US - self.period_us // 2 - (self.syncs - 1) * self.period_us


@given(end_us=st.integers(0, 10**9), phase_us=st.integers(0, TICK_US - 1))
def test_a_slot_closes_in_the_first_tick_after_its_end(end_us: int, phase_us: int) -> None:
    slot = Slot(end_us, phase_us)
    assert 0 <= slot.close_tick * TICK_US - end_us < TICK_US
    assert -TICK_US < slot.excess_us < TICK_US
    assert slot.excess_us == slot.close_tick * TICK_US - end_us - phase_us


@pytest.mark.parametrize("period_us", [1000, 3000, 10_000])
def test_a_slot_reaches_half_a_period_either_way(period_us: int) -> None:
    host = Host(period_us)
    half_us = period_us // 2
    for i in range(1, 20):
        host.clock.after(host.clock.slot)
        due_us = START_US + i * period_us
        slots = [host.clock.hear(due_us + late_us) for late_us in (-half_us, 0, half_us - 1, half_us)]
        assert slots == [0, 0, 0, 1]
        assert host.clock.slot.excess_us == 0


def test_each_axis_may_report_a_sync_and_open_the_next_slot() -> None:
    alone, shared = Host(1000), Host(1000)
    assert shared.clock.join(1, 1000, START_US + 10)
    for i in range(1, 4 * WINDOW):
        slot = shared.clock.slot
        assert shared.clock.after(slot) == shared.clock.after(slot)
        for _ in range(2):
            shared.clock.hear(START_US + 1000 * i + 200)
        alone.send(200)
        assert alone.clock.slot == shared.clock.slot
    assert alone.middle_us == 200 * (WINDOW - 1) // WINDOW


def test_one_period_at_a_time() -> None:
    clock = Host(1000).clock
    assert not clock.join(1, 2000, START_US)
    clock.leave(0)
    assert clock.join(1, 2000, START_US + 777)
    assert clock.slot.end_us == START_US + 777 + 1000


@pytest.mark.parametrize("sign", [1, -1])
@pytest.mark.parametrize(("late_us", "moves"), [(125, False), (127, True)])
def test_the_mean_moves_them_if_it_is_beyond_an_eighth(late_us: int, moves: bool, sign: int) -> None:
    """The very first SYNC, at 0, counts among the 128 of the mean."""
    host = Host(1000)
    lengths_us = {host.send(sign * late_us) for _ in range(WINDOW - 1)}
    assert lengths_us == {1000}
    lengths_us = {host.send(sign * late_us) for _ in range(300)}
    assert lengths_us == ({1000, 1000 + sign} if moves else {1000})
    assert abs(host.middle_us - (sign * 126 if moves else 0)) <= 1


@pytest.mark.parametrize("period_us", [1000, 2000, 10_000])
def test_a_slot_grows_or_shrinks_by_little(period_us: int) -> None:
    host = Host(period_us)
    lengths_us = [host.send(-period_us * 2 // 5) for _ in range(600)]
    assert {period_us - length_us for length_us in lengths_us} <= {*range(max(1, period_us // 512) + 1)}
    assert abs(host.middle_us + period_us * 2 // 5) <= period_us // 100


@pytest.mark.parametrize("seed", range(20))
@pytest.mark.parametrize("period_us", [1000, 10_000])
def test_jitter_moves_nothing(period_us: int, seed: int) -> None:
    """SYNCs come up to half a period early or late, 1000 times."""
    host, drawn = Host(period_us), random.Random(seed)
    assert {host.send(drawn.randrange(-period_us // 2, period_us // 2)) for _ in range(1000)} == {period_us}


@pytest.mark.parametrize("ppm", [-500, -200, -20, 20, 200, 500])
@pytest.mark.parametrize("period_us", [1000, 10_000])
def test_drift_is_followed(period_us: int, ppm: int) -> None:
    """A drift of any duration leaves every SYNC within a quarter of a period from the middle of its slot."""
    host = Host(period_us)
    for i in range(20_000):
        late_us = i * period_us * ppm // 1_000_000
        assert abs(late_us - host.middle_us) <= period_us // 4
        host.send(late_us)
