"""Heat: the junction against an integration in small steps, the shutdown on both sides, and what ends it."""

from math import ceil, exp, log

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from steptwin.emulator.drivers.chip import DriverChip
from steptwin.emulator.drivers.limits import Rule
from steptwin.emulator.drivers.protection import Junction
from steptwin.protocol.drivers import Cooling, Release, Shutdown
from tests.emulator.pins import POWER_UP, a_tb6560, at, pins
from tests.emulator.simulations import SECOND

BARE = Cooling()
"""25 K/W, 100 s, 25 degC."""
SHUTDOWN = Shutdown(170, 20, Release.RESET)


def hot_chip(full_a: float = 3.0, cooling: Cooling = BARE) -> DriverChip:
    """Two-phase mode at 3 A: 2 * 9 * 0.6 = 10.8 W, on the way to 295 degC."""
    chip = a_tb6560(330, full_a, cooling)
    chip.feed(pins(changes=POWER_UP, until=1))
    return chip


def shutdown_counts(chip: DriverChip) -> int:
    """The first count at which Protect is low, by bisection."""
    high, low = 0, 1000 * SECOND
    while low - high > 1:
        middle = (high + low) // 2
        high, low = (middle, low) if chip.fault_level(middle) else (high, middle)
    return low


class TestJunction:
    def test_follows_an_exponential(self) -> None:
        junction = Junction(BARE, SHUTDOWN)
        junction.heat(0, 4.0)
        for t_s in (0, 1, 10, 100, 1000):
            assert junction.celsius(t_s * SECOND) == pytest.approx(25 + 100 * (1 - exp(-t_s / 100)))

    @pytest.mark.slow
    @given(st.lists(st.tuples(st.integers(1, 60), st.floats(0, 12)), min_size=1, max_size=8))
    def test_against_small_steps(self, stretches: list[tuple[int, float]]) -> None:
        """Powers for some seconds each; the integration knows the shutdown too, and that nothing ends it."""
        junction, celsius, shut_down, now_s = Junction(BARE, SHUTDOWN), 25.0, False, 0
        for duration_s, power_w in stretches:
            junction.heat(now_s * SECOND, power_w)
            for _ in range(duration_s * 100):
                celsius += ((0.0 if shut_down else power_w) - (celsius - 25) / 25) / 4 * 0.01
                shut_down = shut_down or celsius >= 170
            now_s += duration_s
            assert junction.celsius(now_s * SECOND) == pytest.approx(celsius, abs=0.1)
            assert junction.shut_down(now_s * SECOND) == shut_down

    def test_a_change_of_power_changes_nothing_before_it(self) -> None:
        """Shut down and free again, all before the power falls: the junction is heated from then until it does."""
        asked, unasked = Junction(BARE, SHUTDOWN), Junction(BARE, SHUTDOWN)
        for junction in (asked, unasked):
            junction.heat(0, 10.8)
            junction.release(SECOND, on=True)
        for t_s in range(2, 100):
            asked.celsius(t_s * SECOND)
        for junction in (asked, unasked):
            junction.heat(100 * SECOND, 0.0)
        assert unasked.shutdowns(200 * SECOND) == asked.shutdowns(200 * SECOND)
        assert unasked.celsius(101 * SECOND) == asked.celsius(101 * SECOND) > 150


class TestShutdown:
    def test_at_170_degrees_and_not_a_count_sooner(self) -> None:
        """77.0 s: 100 s * ln(270 / 125)."""
        chip = hot_chip()
        trip = shutdown_counts(chip)
        assert trip / SECOND == pytest.approx(77.01, abs=0.01)
        assert (chip.fault_level(trip - 1), chip.fault_level(trip)) == (1, 0)
        assert chip.junction_celsius(trip - 1) < 170 <= chip.junction_celsius(trip) + 1e-6
        assert chip.junction_celsius(trip + 100 * SECOND) == pytest.approx(25 + 145 / 2.71828, abs=0.01)

    def test_the_outputs_are_off_and_the_counter_counts(self) -> None:
        chip = hot_chip()
        trip = shutdown_counts(chip)
        chip.feed(pins([trip - 20_000, trip + 20_000], until=trip + 40_000))
        currents = chip.outputs.currents_a(pins([trip - 1, trip]).clk_rise_counts)
        assert currents[0].tolist() == [pytest.approx(3), pytest.approx(3)]
        assert currents[1].tolist() == [0, 0]
        assert chip.position_steps == -2

    def test_is_noted_when_it_has_come(self) -> None:
        chip = hot_chip()
        trip = shutdown_counts(chip)
        chip.feed(pins(until=trip - 1))
        assert not chip.violations.counts.size
        chip.feed(pins(until=trip))
        found = chip.violations
        assert (found.counts.tolist(), found.rules(), found.values.tolist()) == ([trip], [Rule.OVER_TEMPERATURE], [170])

    def test_does_not_come_where_the_outputs_go_off_before(self) -> None:
        chip = hot_chip()
        trip = shutdown_counts(chip)
        chip.feed(pins(changes=at(trip - 1, ENABLE=0), until=2 * trip))
        assert chip.fault_level(trip) == 1
        assert not chip.violations.counts.size

    @pytest.mark.parametrize(
        ("changes", "trips"),
        [
            pytest.param({}, True, id="3 A in two-phase"),
            pytest.param({"TQ1": 1}, True, id="75 %: 6.1 W, 177 degC"),
            pytest.param({"TQ2": 1}, False, id="50 %"),
        ],
    )
    def test_torque_decides(self, changes: dict[str, int], trips: bool) -> None:
        chip = hot_chip()
        chip.feed(pins(changes=at(1, **changes)))
        assert chip.fault_level(1000 * SECOND) == (0 if trips else 1)

    def test_microsteps_heat_half_as_much(self) -> None:
        """5.4 W: 160 degC, just below."""
        chip = a_tb6560(330, 3.0, BARE)
        chip.feed(pins(changes=(*POWER_UP[:2], *at(0, M2=1), *POWER_UP[2:])))
        assert chip.junction_celsius(5000 * SECOND) == pytest.approx(160)
        assert chip.fault_level(5000 * SECOND) == 1

    def test_a_heat_sink_prevents_it(self) -> None:
        assert hot_chip(cooling=Cooling(resistance_k_per_w=8)).fault_level(5000 * SECOND) == 1


class TestRelease:
    """The junction falls from 170 to 150 degC in 100 s * ln(145 / 125) = 14.84 s."""

    @pytest.mark.parametrize(("after_s", "level"), [(14.8, 0), (14.9, 1)])
    def test_reset_ends_a_shutdown_once_it_has_cooled(self, after_s: float, level: int) -> None:
        chip = hot_chip()
        reset = shutdown_counts(chip) + round(after_s * SECOND)
        chip.feed(pins(changes=(*at(reset, RESET=0), *at(reset + 100, RESET=1))))
        assert chip.fault_level(reset - 1) == 0
        assert chip.fault_level(reset + 100) == level

    def test_cooling_ends_it_while_reset_is_low(self) -> None:
        """Not RESET's edge, at 151 degC: 14.84 s after the shutdown; no count sooner, and RESET need not rise."""
        chip = hot_chip()
        trip = shutdown_counts(chip)
        chip.feed(pins(changes=at(trip + 14 * SECOND, ENABLE=0, RESET=0), until=trip + 15 * SECOND))
        cool = trip + ceil(100 * SECOND * log(145 / 125))
        assert [chip.fault_level(counts) for counts in (trip, cool - 1, cool, 2 * cool)] == [0, 0, 1, 1]
        assert chip.junction_celsius(cool) == pytest.approx(150)
        assert chip.fault_stays_until(cool - 1) == cool
        assert not chip.outputs.currents_a(pins([cool]).clk_rise_counts).any()
        assert chip.violations.rules() == [Rule.OVER_TEMPERATURE]

    def test_a_reset_that_is_over_before_it_has_cooled_does_not(self) -> None:
        chip = hot_chip()
        trip = shutdown_counts(chip)
        chip.feed(pins(changes=(*at(trip + 5 * SECOND, RESET=0), *at(trip + 14 * SECOND, RESET=1))))
        assert chip.fault_level(trip + 1000 * SECOND) == 0
        assert chip.fault_stays_until(trip + 1000 * SECOND) is None

    def test_enabled_in_reset_it_goes_back_and_forth(self) -> None:
        """The outputs are driven at the initial currents, so 20 K are made up for in 100 s * ln(145 / 125) again."""
        chip = hot_chip()
        trip = shutdown_counts(chip)
        chip.feed(pins(changes=at(trip + SECOND, RESET=0), until=trip + 60 * SECOND))
        assert (np.diff(chip.violations.counts) / SECOND).tolist() == [pytest.approx(29.684, abs=0.001)] * 2
        currents = chip.outputs.currents_a(trip + np.array([0, 14, 15, 29, 30]) * SECOND)
        assert (currents[:, 0] > 0).tolist() == [False, False, True, True, False]

    def test_cooling_alone_does_not(self) -> None:
        chip = hot_chip()
        assert chip.fault_level(shutdown_counts(chip) + 1000 * SECOND) == 0

    def test_nor_does_enable(self) -> None:
        chip = hot_chip()
        later = shutdown_counts(chip) + 100 * SECOND
        chip.feed(pins(changes=(*at(later, ENABLE=0), *at(later + 100, ENABLE=1))))
        assert chip.fault_level(later + 100) == 0

    def test_then_it_may_come_again(self) -> None:
        chip = hot_chip()
        reset = shutdown_counts(chip) + 20 * SECOND
        chip.feed(pins(changes=(*at(reset, RESET=0), *at(reset + 100, RESET=1)), until=reset + 100 * SECOND))
        assert chip.violations.rules() == [Rule.OVER_TEMPERATURE] * 2
