"""The driver's inputs: counting, direction, RESET, and each limit on both sides."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from emulator.tb6560 import Pins, Rule, Tb6560, clk_width_min_counts, oscillator_hz

WIDTH = 2160
PERIOD = 4800


def pins(
    rises: list[int],
    widths: int | list[int] = WIDTH,
    directions: tuple[tuple[int, int], ...] = ((0, 1),),
    resets: tuple[tuple[int, int], ...] = (),
) -> Pins:
    rise = np.array(rises, dtype=np.int64)
    dirs = np.array(directions, dtype=np.int64).reshape(-1, 2)
    reset = np.array(resets, dtype=np.int64).reshape(-1, 2)
    return Pins(rise, rise + widths, dirs[:, 0], dirs[:, 1].astype(np.int8), reset[:, 0], reset[:, 1].astype(np.int8))


def powered(osc_pf: float = 330) -> Tb6560:
    driver = Tb6560(osc_pf)
    driver.feed(pins([], directions=(), resets=((0, 1),)))
    return driver


class TestDatasheet:
    @pytest.mark.parametrize(("osc_pf", "width_us"), [(100, 10), (330, 30), (1000, 90)])
    def test_clk_width_at_the_stated_capacitors(self, osc_pf: float, width_us: int) -> None:
        assert clk_width_min_counts(osc_pf) == 72 * width_us

    @pytest.mark.parametrize(("osc_pf", "khz"), [(100, 400), (330, 130), (1000, 44)])
    def test_oscillator_formula(self, osc_pf: float, khz: float) -> None:
        assert oscillator_hz(osc_pf) / 1000 == pytest.approx(khz, rel=0.01)

    def test_other_capacitors_take_four_oscillator_periods(self) -> None:
        assert clk_width_min_counts(470) == pytest.approx(4 * 72e6 / oscillator_hz(470), abs=1)

    @pytest.mark.parametrize("osc_pf", [0, -330])
    def test_a_capacitor_has_a_positive_value(self, osc_pf: float) -> None:
        with pytest.raises(ValueError, match="330"):
            clk_width_min_counts(osc_pf)


@pytest.mark.parametrize("osc_pf", [100, 330, 1000])
def test_clk_width_on_both_sides(osc_pf: float) -> None:
    limit = clk_width_min_counts(osc_pf)
    driver = powered(osc_pf)
    driver.feed(pins([10_000, 30_000], [limit, limit - 1]))
    assert driver.position_steps == 1
    found = driver.violations
    assert (found.counts.tolist(), found.rules.tolist()) == ([30_000], [Rule.CLK_HIGH])
    assert (found.values - found.limits).tolist() == [-1]


def test_clk_rate_on_both_sides() -> None:
    driver = powered()
    driver.feed(pins([10_000, 10_000 + PERIOD, 10_000 + 2 * PERIOD - 1]))
    assert driver.position_steps == 2
    found = driver.violations
    assert (found.rules.tolist(), found.values.tolist(), found.limits.tolist()) == ([Rule.CLK_RATE], [4799], [4800])


def test_rate_is_watched_across_batches() -> None:
    driver = powered()
    driver.feed(pins([10_000]))
    driver.feed(pins([14_799], directions=()))
    assert driver.position_steps == 1
    assert driver.violations.counts.tolist() == [14_799]


def test_direction_is_sampled_at_the_rise() -> None:
    """DIR high counts up; an edge at the very count of the rise is seen, one count later is not."""
    driver = powered()
    driver.feed(pins([10_000, 20_000, 30_000], directions=((0, 1), (20_000, 0), (30_001, 1))))
    assert driver.steps[1].tolist() == [1, -1, -1]
    driver.feed(pins([40_000], directions=()))
    assert driver.position_steps == 0


def test_reset_ignores_clk_without_a_violation() -> None:
    driver = Tb6560(330)
    driver.feed(pins([10_000, 20_000, 40_000], 5, resets=((30_000, 1),)))
    assert driver.position_steps == 0
    assert driver.violations.counts.tolist() == [40_000]
    driver.feed(pins([50_000, 60_000], resets=((55_000, 0),), directions=()))
    assert driver.position_steps == 1


def test_nothing_happens_without_pulses() -> None:
    driver = powered()
    driver.feed(pins([], directions=()))
    assert driver.position_steps == 0
    assert driver.steps[0].size == driver.violations.counts.size == 0


@given(
    gaps=st.lists(st.integers(1, 9000), min_size=1, max_size=60),
    widths=st.lists(st.integers(1, 4000), min_size=60, max_size=60),
    turns=st.lists(st.integers(0, 400_000), max_size=10, unique=True),
    cut=st.integers(0, 60),
)
def test_against_a_chip_stepped_edge_by_edge(gaps: list[int], widths: list[int], turns: list[int], cut: int) -> None:
    """The same rules, one pulse at a time; and feeding in two batches changes nothing."""
    rises = np.cumsum([0, *(gap + width for gap, width in zip(gaps, widths, strict=False))])[:-1].tolist()
    width = widths[: len(rises)]
    directions = tuple((counts, i % 2) for i, counts in enumerate(sorted(turns), start=1))

    position, previous = 0, -PERIOD
    for rise, high in zip(rises, width, strict=True):
        level = [0, *(level for counts, level in directions if counts <= rise)][-1]
        if high >= WIDTH and rise - previous >= PERIOD:
            position += 2 * level - 1
        previous = rise

    driver = powered()
    edge = rises[cut] if cut < len(rises) else 10**9
    driver.feed(pins(rises[:cut], width[:cut], tuple(d for d in directions if d[0] < edge)))
    driver.feed(pins(rises[cut:], width[cut:], tuple(d for d in directions if d[0] >= edge)))
    assert driver.position_steps == position == driver.steps[1].sum()
