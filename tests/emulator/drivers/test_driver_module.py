"""The module around the chip: late edges, lost pulses, the wrong way, the active edge, switches, idle current."""

from collections.abc import Sequence
from dataclasses import replace
from random import Random

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from steptwin.emulator.drivers.driver import Driver
from steptwin.emulator.drivers.driver_module import Module, delay_of, fitted
from steptwin.emulator.drivers.limits import Rule
from steptwin.emulator.drivers.terminals import LevelChange, TerminalEdges
from steptwin.protocol.drivers import ActiveEdge, Coupler
from steptwin.protocol.drivers.tb6560 import SLOW_BLUE_BOARD, THREE_AMP_MODULE, tb6560
from tests.emulator.pins import CHIP, POWER_UP, TERMINALS, WIDTH, WIRES, a_tb6560, at, cut, pins, times
from tests.emulator.simulations import MS
from tests.messages import refusing
from tests.one_example import one_example

US = 72
UP = ((1, 1),)

THREE_AMP = fitted(THREE_AMP_MODULE, 16)
SLOW_BLUE = fitted(SLOW_BLUE_BOARD, 16)
LATE_DIR = 24 * US - 6
"""A DIR that falls needs this to overtake a CLK that rises: 24 us less 75 ns, rounded up."""


def driven(module: Module, *stretches: TerminalEdges, osc_pf: float = 330) -> Driver:
    """Return a driver with its supply after these stretches, and after the time that all edges take to arrive."""
    driver = Driver(replace(module, chip=tb6560(osc_pf)))
    driver.feed(pins(changes=POWER_UP, until=1))
    for stretch in stretches:
        driver.feed(stretch)
    return driver


def found(driver: Driver) -> list[tuple[Rule, int, int]]:
    """Return rule, value and limit of each violation."""
    violations = driver.violations
    limits = [violations.limits[index].value for index in violations.which.tolist()]
    return list(zip(violations.rules(), violations.values.tolist(), limits, strict=True))


def test_a_module_of_wires_is_the_chip() -> None:
    pulses = pins([10_000, 20_000, 21_000, 40_000], [WIDTH, 100, WIDTH, WIDTH], [(9_000, 1), (30_000, 0)])
    driver, chip = driven(WIRES, pulses), a_tb6560(330)
    chip.feed(pins(changes=POWER_UP, until=1))
    chip.feed(pulses)
    assert [values.tolist() for values in driver.steps] == [values.tolist() for values in chip.steps]
    assert driver.violations.counts.tolist() == chip.violations.counts.tolist()
    assert driver.chip.position_steps == 0


class TestLateDirection:
    """A DIR edge that leaves before CLK and arrives after it."""

    @pytest.mark.parametrize(("setup", "sign"), [(LATE_DIR, -1), (LATE_DIR - 1, 1), (0, 1)])
    def test_the_step_goes_the_wrong_way(self, setup: int, sign: int) -> None:
        turn = 100_000
        driver = driven(THREE_AMP, pins([50_000, turn + setup, 200_000], directions=[*UP, (turn, 0)]))
        assert driver.steps[1].tolist() == [1, sign, -1]
        assert found(driver) == ([] if sign < 0 else [(Rule.DIR_SETUP, setup, LATE_DIR)])

    @pytest.mark.parametrize(("setup", "sign"), [(4 * US - 6, 1), (4 * US - 7, -1)])
    def test_the_other_way_the_coupler_is_faster(self, setup: int, sign: int) -> None:
        driver = driven(THREE_AMP, pins([100_000 + setup], directions=[(100_000, 1)]))
        assert driver.steps[1].tolist() == [sign]
        assert len(found(driver)) == (sign < 0)

    def test_each_reversal_costs_two_steps_of_position(self) -> None:
        """Move to and fro with 15 us of setup, as Marlin has it for a TB6560: each way back begins wrong."""
        rises = [100_000 + i * 10_000 for i in range(40)]
        turns = [(rises[i] - 15 * US, 1 - i // 10 % 2) for i in range(0, 40, 10)]
        driver = driven(THREE_AMP, pins(rises, directions=turns))
        assert driver.steps[1].tolist() == ([1] * 10 + [1] + [-1] * 9) * 2
        assert driver.chip.position_steps == driver.lost_steps * -1 == 4
        assert driver.violation_count == driver.violations.counts.size == 2
        assert [rule for rule, _, _ in found(driver)] == [Rule.DIR_SETUP] * 2
        assert driven(WIRES, pins(rises, directions=turns)).chip.position_steps == 0

    def test_several_steps_go_the_wrong_way_where_clk_is_fast(self) -> None:
        """DIR takes 100 us through a slow part and CLK rises every 67 us: two rises come before it."""
        module = Module(CHIP, direction=Coupler(100_000, 100_000))
        driver = driven(module, pins([100_000 + i * 4800 for i in range(4)], directions=[(99_000, 1)]))
        assert driver.steps[1].tolist() == [-1, -1, 1, 1]
        assert [value for _, value, _ in found(driver)] == [1000, 5800]

    @pytest.mark.parametrize(("hold", "sign"), [(719, -1), (720, -1), (721, 1)])
    def test_a_dir_that_overtakes_clk(self, hold: int, sign: int) -> None:
        """CLK takes 10 us: a DIR that changes up to 720 counts after it is there with it or before."""
        driver = driven(Module(CHIP, clk=Coupler(10_000, 10_000)), pins([50_000], directions=[*UP, (50_000 + hold, 0)]))
        assert driver.steps[1].tolist() == [sign]
        assert found(driver) == ([(Rule.DIR_HOLD, hold, 721)] if sign < 0 else [])

    def test_a_dir_pulse_that_does_not_get_through(self) -> None:
        """Low for 20 us: its fall would arrive 24 us late, after its rise 4 us late."""
        directions = [*UP, (100_000, 0), (100_000 + 20 * US, 1)]
        driver = driven(THREE_AMP, pins([100_000 + 10 * US, 300_000], directions=directions))
        assert driver.steps[1].tolist() == [1, 1]


class TestPulses:
    @pytest.mark.parametrize(("width", "steps"), [(30 * US + 360, 1), (30 * US + 359, 0)])
    def test_unequal_delays_shorten_the_pulse_at_the_chip(self, width: int, steps: int) -> None:
        """Rises are 5 us later than falls."""
        driver = driven(Module(CHIP, clk=Coupler(to_high_ns=5_000)), pins([50_000], width))
        assert driver.steps[0].size == steps
        assert found(driver) == ([] if steps else [(Rule.CLK_HIGH, 30 * US - 1, 30 * US)])

    @pytest.mark.parametrize(("width", "rule"), [(360, None), (361, Rule.CLK_HIGH)])
    def test_a_pulse_may_not_get_through_at_all(self, width: int, rule: Rule | None) -> None:
        """Then the chip sees no pulse, and the broken limit is the coupler's."""
        driver = driven(Module(CHIP, clk=Coupler(to_high_ns=5_000)), pins([50_000], width))
        assert not driver.steps[0].size
        limits = [(value, limit) for _, value, limit in found(driver)]
        assert limits == ([(1, 30 * US)] if rule else [(360, 361)])

    @pytest.mark.parametrize(("gap", "steps"), [(40 * US + 1, 2), (40 * US, 1)])
    def test_pulses_may_run_into_one(self, gap: int, steps: int) -> None:
        """Falls are 40 us later than rises: a shorter pause disappears."""
        driver = driven(Module(CHIP, clk=Coupler(to_low_ns=40_000)), pins([50_000, 50_000 + WIDTH + gap]))
        assert driver.steps[0].size == steps
        assert found(driver) == ([] if steps == 2 else [(Rule.CLK_LOW, 40 * US, 40 * US + 1)])

    def test_lost_steps_are_steps_at_the_terminals_less_steps_counted(self) -> None:
        """One pulse too short for the module, one for the chip, one of the other direction that is counted."""
        rises, widths = [50_000, 60_000, 70_000, 90_000], [WIDTH, 100, WIDTH - 1, WIDTH]
        module = Module(CHIP, times=times(steplen_ns=10_000))
        driver = driven(module, pins(rises, widths, [*UP, (80_000, 0)]))
        assert (driver.chip.position_steps, driver.lost_steps, driver.violation_count) == (0, 2, 2)

    def test_the_rotor_s_moves_are_handed_out_as_the_chip_counts_steps(self) -> None:
        driver = driven(SLOW_BLUE)
        first = driver.feed(pins([1_000_000], [20_000], UP, until=1_020_000 + 100 * US))
        assert (driver.held_pulses, driver.waiting, first[0].size) == (1, True, 0)
        assert driver.held_steps == 1
        counts, sixteenths = driver.feed(pins(until=1_020_000 + 150 * US + 1))
        assert (counts.tolist(), sixteenths.tolist()) == ([1_020_000], [16])
        assert (driver.held_pulses, driver.held_steps, driver.waiting) == (0, 0, False)
        driver.feed(pins([2_000_000], [20_000], [(1_900_000, 0)], until=2_020_000 + 100 * US))
        assert driver.held_steps == -1

    def test_steps_are_told_by_their_pulses_at_the_terminals(self) -> None:
        module = Module(CHIP, clk=Coupler(20_000, 20_000))
        driver = driven(module, pins([50_000, 60_000, 70_000], [WIDTH, 100, WIDTH]))
        assert driver.steps[0].tolist() == [50_000, 70_000]
        assert driver.violations.counts.tolist() == [60_000 + 20 * US]
        assert driver.chip.steps[0].tolist() == [50_000 + 20 * US, 70_000 + 20 * US]


class TestRequirements:
    """The slow blue board's four times, each on both sides; a step is the falling edge."""

    LIMIT = 150 * US
    FALL = 1_000_000

    def steps(self, rises: Sequence[int], widths: Sequence[int], turns: Sequence[tuple[int, int]] = ()) -> list[int]:
        self.driver = driven(SLOW_BLUE, pins(rises, widths, [*UP, *turns]))
        return [int(sign) for sign in self.driver.steps[1]]

    @pytest.mark.parametrize("missing", [0, 1])
    def test_stepspace(self, missing: int) -> None:
        """STEP is high, and the chip's CLK low, before the active edge."""
        width = self.LIMIT - missing
        assert len(self.steps([self.FALL - width], [width])) == 1 - missing
        assert found(self.driver) == [(Rule.CLK_LOW, width, self.LIMIT)] * missing

    @pytest.mark.parametrize("missing", [0, 1])
    def test_steplen(self, missing: int) -> None:
        """The pause after the active edge."""
        rises = [self.FALL - self.LIMIT, self.FALL + self.LIMIT - missing]
        assert len(self.steps(rises, [self.LIMIT] * 2)) == 2 - missing
        assert found(self.driver) == [(Rule.CLK_HIGH, self.LIMIT - 1, self.LIMIT)] * missing

    @pytest.mark.parametrize("missing", [0, 1])
    def test_dirsetup(self, missing: int) -> None:
        setup = self.LIMIT - missing
        assert self.steps([self.FALL - 20_000], [20_000], [(self.FALL - setup, 0)]) == [2 * missing - 1]
        assert found(self.driver) == [(Rule.DIR_SETUP, setup, self.LIMIT)] * missing

    @pytest.mark.parametrize("missing", [0, 1])
    def test_dirhold(self, missing: int) -> None:
        hold = self.LIMIT - missing
        assert self.steps([self.FALL - 20_000], [20_000], [(self.FALL + hold, 0)]) == [1 - 2 * missing]
        assert found(self.driver) == [(Rule.DIR_HOLD, hold, self.LIMIT)] * missing

    def test_the_last_pulse_of_all_counts_too(self) -> None:
        """No later pulse ends the time for which CLK is high after it."""
        assert self.steps([self.FALL - 20_000], [20_000]) == [1]
        assert self.driver.chip.steps[0].tolist() == [self.FALL]
        assert self.driver.steps[0].tolist() == [self.FALL - 20_000]

    def test_with_the_rising_edge_steplen_is_the_pulse(self) -> None:
        module = fitted(SLOW_BLUE_BOARD, 16, active_edge=ActiveEdge.RISING)
        driver = driven(module, pins([self.FALL, 2 * self.FALL], [self.LIMIT - 1, self.LIMIT]))
        assert driver.steps[0].tolist() == [2 * self.FALL]
        assert found(driver) == [(Rule.CLK_HIGH, self.LIMIT - 1, self.LIMIT)]


class TestSwitches:
    def test_the_firmware_does_not_reach_what_the_switches_hold(self) -> None:
        """RESET is high with the supply, and the switches set the mode, here 1/8."""
        module = fitted(THREE_AMP_MODULE, 8)
        driver = driven(module, pins([10_000, 20_000], changes=at(15_000, RESET=0, M1=0)))
        assert driver.chip.position_steps == -2
        assert driver.chip.outputs.field_substeps(np.array([30_000])).tolist() == [4]
        assert not driver.violations.counts.size

    def test_enable_comes_through_its_coupler(self) -> None:
        """4 us to off and 2 us in the chip; 24 us and 3 us to on."""
        driver = driven(THREE_AMP, pins(changes=(*at(100_000, ENABLE=0), *at(200_000, ENABLE=1))))
        flows = driver.chip.outputs.currents_a(
            np.array([100_000 + 6 * US - 1, 100_000 + 6 * US, 200_000 + 27 * US - 1, 200_000 + 27 * US])
        )
        assert (flows[:, 0] > 0).tolist() == [True, False, False, True]

    def test_a_short_enable_does_not_get_through(self) -> None:
        """Off, on for 20 us, off: to on takes 24 us, to off 4 us."""
        changes = (*at(50_000, ENABLE=0), *at(100_000, ENABLE=1), *at(100_000 + 20 * US, ENABLE=0))
        driver = driven(THREE_AMP, pins(changes=changes))
        assert driver.chip.outputs.currents_a(np.array([300_000]))[0, 0] == 0

    @pytest.mark.parametrize(("idle_percent", "expected"), [(50, 0.5), (20, 0.2)])
    def test_idle_current(self, idle_percent: int, expected: float) -> None:
        """500 ms after the last step, until the next; 3 A is a setting without TQ1."""
        switches = fitted(THREE_AMP_MODULE, 1, 3.0, idle_percent=idle_percent).switches
        full_a = 0.5 * (1 / 0.33 + 1 / 0.5 + 1 / 1.2)
        module = Module(CHIP, full_a, switches=switches)
        first, second = 10 * MS, 1200 * MS
        driver = driven(module, pins([first, second], WIDTH, UP, until=5000 * MS))
        times = np.array([first, first + 500 * MS - 1, first + 500 * MS, second - 1, second, second + 500 * MS])
        currents = np.abs(driver.chip.outputs.currents_a(times)[:, 0]) / full_a
        assert currents.tolist() == pytest.approx([1, 1, expected, expected, 1, expected])

    @pytest.mark.parametrize(("idle", "fast_decay"), [(20, None), (None, 25)])
    def test_are_only_where_there_are_some(self, idle: int | None, fast_decay: int | None) -> None:
        module = fitted(THREE_AMP_MODULE, 16, idle_percent=idle, fast_decay_percent=fast_decay)
        assert module.switches != THREE_AMP.switches
        with refusing(ValueError):
            fitted(SLOW_BLUE_BOARD, 16, idle_percent=idle, fast_decay_percent=fast_decay)

    def test_idle_current_begins_after_power_up_without_a_step(self) -> None:
        driver = driven(THREE_AMP, pins(until=1000 * MS))
        full, less = np.abs(driver.chip.outputs.currents_a(np.array([499 * MS, 501 * MS])))[:, 0].tolist()
        assert less == pytest.approx(full / 0.75 / 2)

    def test_power_cycle(self) -> None:
        """The idle circuit starts again; the switches' levels go and come with the supply."""
        changes = (*at(600 * MS, VM=0, VDD=0), *at(700 * MS, VDD=1, VM=1))
        driver = driven(THREE_AMP, pins([800 * MS], changes=changes, until=1150 * MS))
        currents = driver.chip.outputs.currents_a(np.array([599 * MS, 650 * MS, 701 * MS]))[:, 0].tolist()
        assert currents[1] == 0
        assert currents[0] == pytest.approx(currents[2] / 0.75 / 2)
        assert driver.chip.position_steps == -1
        assert not driver.violations.counts.size


class TestSupply:
    """The parts between terminals and chip have the chip's supply."""

    ON = at(1000 * US, VDD=1, VM=1)
    OFF = at(2000 * US, VM=0, VDD=0)

    def flowing(self, module: Module, changes: Sequence[LevelChange], times_us: Sequence[int]) -> list[bool]:
        """Whether current flows at these times, from a module without supply; nothing is out of order at its chip."""
        driver = Driver(module)
        driver.feed(pins(changes=sorted(changes, key=lambda change: change.counts)))
        assert driver.violations.rules() == []
        currents = driver.chip.outputs.currents_a(US * np.array(times_us))
        return [bool(flows) for flows in (currents != 0).any(axis=1)]

    @pytest.mark.parametrize(("enable_us", "from_us"), [(500, 1027), (990, 1027), (1200, 1227)])
    def test_enable_is_seen_once_vm_is_up(self, enable_us: int, from_us: int) -> None:
        """24 us through its coupler and 3 us in the chip."""
        changes = (*self.ON, *at(enable_us * US, ENABLE=1))
        assert self.flowing(THREE_AMP, changes, [from_us - 1, from_us]) == [False, True]

    def test_an_enable_that_is_taken_back_before_vm_is_up_is_none(self) -> None:
        changes = (*at(500 * US, ENABLE=1), *at(600 * US, ENABLE=0), *self.ON)
        assert self.flowing(THREE_AMP, changes, [1100]) == [False]

    def test_an_enable_on_its_way_as_vm_falls_does_not_arrive(self) -> None:
        changes = (*self.ON, *at(1990 * US, ENABLE=1), *self.OFF, *at(2005 * US, ENABLE=0))
        assert self.flowing(THREE_AMP, changes, [2020]) == [False]

    @pytest.mark.parametrize("module", [THREE_AMP, Module(CHIP, enable=Coupler(70_000, 100))])
    def test_enable_may_stay_through_a_power_cycle(self, module: Module) -> None:
        changes = (*at(0, ENABLE=1), *self.ON, *self.OFF, *at(3000 * US, VDD=1, VM=1))
        resets = () if module.switches else (*at(1001 * US, RESET=1), *at(1999 * US, RESET=0), *at(3001 * US, RESET=1))
        assert self.flowing(module, (*changes, *resets), [999, 1100, 2500, 3100]) == [False, True, False, True]

    def test_direction_is_low_at_the_chip_as_vm_falls(self) -> None:
        """It is high at the terminal all the time, so that the next step goes up as well."""
        changes = (*self.ON, *at(2000 * US, VM=0), *at(2500 * US, VM=1))
        driver = Driver(THREE_AMP)
        driver.feed(pins([1500 * US, 3000 * US], WIDTH, [(1200 * US, 1)], changes))
        assert driver.steps[1].tolist() == [1, 1]
        assert driver.violations.rules() == []


assert THREE_AMP.switches is not None
SHORT_IDLE = replace(THREE_AMP, switches=replace(THREE_AMP.switches, idle_ms=1))
MODULES = [
    WIRES,
    SHORT_IDLE,
    SLOW_BLUE,
    fitted(SLOW_BLUE_BOARD, 16, active_edge=ActiveEdge.RISING),
    Module(CHIP, clk=Coupler(9_000, 60_000), direction=Coupler(5_000, 2_000), enable=Coupler(70_000, 100)),
    Module(
        CHIP,
        clk=Coupler(40_000, 3_000),
        direction=Coupler(1_000, 90_000),
        times=times(steplen_ns=10_000, stepspace_ns=8_000, dirsetup_ns=30_000, dirhold_ns=25_000),
    ),
]
PULSES = st.lists(st.tuples(st.integers(1, 12_000), st.integers(1, 12_000)), min_size=1, max_size=40)
TURNS = st.lists(st.integers(0, 500_000), max_size=40, unique=True)
CHANGES = st.lists(
    st.builds(LevelChange, st.integers(1, 500_000), st.sampled_from(list(TERMINALS)), st.integers(0, 1)), max_size=12
)


def stream(pulses: list[tuple[int, int]], turns: list[int], changes: Sequence[LevelChange] = ()) -> TerminalEdges:
    gaps, widths = zip(*pulses, strict=True)
    rises = np.cumsum(np.array(gaps) + np.concatenate(([0], widths[:-1]))).tolist()
    directions = [(counts, (i + 1) % 2) for i, counts in enumerate(sorted(turns))]
    return pins(rises, widths, directions, (*POWER_UP, *sorted(changes, key=lambda change: change.counts)))


@pytest.mark.slow
@given(pulses=PULSES, turns=TURNS, changes=CHANGES, cuts=st.lists(st.integers(0, 600_000), max_size=6))
def test_pieces_make_no_difference(
    pulses: list[tuple[int, int]], turns: list[int], changes: list[LevelChange], cuts: list[int]
) -> None:
    for module in MODULES:
        makes_no_difference(module, pulses, turns, changes, cuts)


def makes_no_difference(
    module: Module, pulses: list[tuple[int, int]], turns: list[int], changes: list[LevelChange], cuts: list[int]
) -> None:
    whole = stream(pulses, turns, changes)
    once, pieced = Driver(replace(module, chip=tb6560(100))), Driver(replace(module, chip=tb6560(100)))
    once.feed(whole)
    for piece in cut(whole, cuts):
        pieced.feed(piece)
        assert pieced.steps[0].size == pieced.steps[1].size
    assert recorded(pieced) == recorded(once)
    times = np.linspace(0, 700_000, 200).astype(np.int64)
    assert np.array_equal(pieced.chip.outputs.currents_a(times), once.chip.outputs.currents_a(times))


def recorded(driver: Driver) -> list[list[int]]:
    """Steps and violations; those of one instant in any order."""
    violations = driver.violations
    order = np.lexsort((violations.which, violations.counts))
    kept = (*driver.steps, violations.counts[order], violations.which[order], violations.values[order])
    return [[int(value) for value in values] for values in kept]


DELAYS = st.builds(Coupler, st.integers(0, 60_000), st.integers(0, 60_000))


def through(coupler: Coupler, edges: list[tuple[int, int]]) -> list[tuple[int, int]]:
    """Pass edges one by one: a new edge cancels those that would arrive after it."""
    arriving: list[tuple[int, int]] = []
    for counts, level in edges:
        arrival = counts + delay_of(coupler).of(level)
        while arriving and arriving[-1][0] >= arrival:
            arriving.pop()
        if level != (arriving[-1][1] if arriving else 0):
            arriving.append((arrival, level))
    return arriving


@pytest.mark.slow
@given(clk=DELAYS, direction=DELAYS, pulses=PULSES, turns=TURNS)
def test_against_couplers_stepped_edge_by_edge(
    clk: Coupler, direction: Coupler, pulses: list[tuple[int, int]], turns: list[int]
) -> None:
    """Which rises reach the chip, and what it reads at them; pulses are long enough for a chip with 100 pF."""
    long = [(gap, width + 720 + 60 * US) for gap, width in pulses]
    whole = stream(long, turns)
    pulse_edges = zip(whole.clk_rise_counts.tolist(), whole.clk_fall_counts.tolist(), strict=True)
    at_clk = through(clk, [edge for rise, fall in pulse_edges for edge in ((rise, 1), (fall, 0))])
    at_dir = through(direction, list(zip(whole.dir_counts.tolist(), whole.dir_levels.tolist(), strict=True)))
    expected, previous = [], -10_000
    for rise in (counts for counts, level in at_clk if level):
        level = [0, *(level for counts, level in at_dir if counts <= rise)][-1]
        if rise - previous >= 4800:
            expected.append((rise, 2 * level - 1))
        previous = rise
    driver = Driver(Module(tb6560(100), clk=clk, direction=direction))
    driver.feed(whole)
    assert list(zip(*(values.tolist() for values in driver.chip.steps), strict=True)) == expected


def test_the_same_again_is_the_same() -> None:
    rng = np.random.default_rng(5)
    pulses = list(zip(rng.integers(1, 9000, 300).tolist(), rng.integers(1, 9000, 300).tolist(), strict=True))
    turns = rng.choice(2_000_000, 200, replace=False).tolist()
    whole = stream(pulses, turns)
    first, second = (recorded(driven(THREE_AMP, whole)) for _ in range(2))
    assert first == second
    assert all(first)


def drawn(seed: int) -> tuple[list[tuple[int, int]], list[int], list[LevelChange], list[int]]:
    """Return pulses, turns, changes of the other inputs, and cuts."""
    draw = Random(seed)
    pulses = [(draw.randint(1, 12_000), draw.randint(1, 12_000)) for _ in range(40)]
    turns = draw.sample(range(500_000), 20)
    changes = [
        LevelChange(draw.randint(1, 500_000), draw.choice(list(TERMINALS)), draw.randint(0, 1)) for _ in range(4)
    ]
    return pulses, turns, changes, [draw.randint(0, 600_000) for _ in range(6)]


def test_pieces_of_one_stream_make_no_difference() -> None:
    one_example(test_pieces_make_no_difference, *drawn(1))
    pulses, turns, *_ = drawn(2)
    one_example(
        test_against_couplers_stepped_edge_by_edge, Coupler(9_000, 60_000), Coupler(5_000, 2_000), pulses, turns
    )
