"""The steps that the chip counts and the violations that it notes, with each limit on both sides."""

from random import Random

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from steptwin.controller.node.pins import Pin
from steptwin.emulator.drivers.chip import DriverChip
from steptwin.emulator.drivers.limits import LimitUnit, Rule
from steptwin.emulator.drivers.terminals import LevelChange, Rail, TerminalEdges
from steptwin.protocol.drivers import Oscillator
from steptwin.protocol.drivers.tb6560 import PINS, PinKind
from tests.emulator.pins import PERIOD, POWER_UP, TERMINALS, WIDTH, a_tb6560, at, cut, pins
from tests.messages import refusing
from tests.one_example import one_example

UP = ((1, 1),)
"""DIR is high from the start."""


def powered(osc_pf: float = 330) -> DriverChip:
    chip = a_tb6560(osc_pf)
    chip.feed(pins(changes=POWER_UP, until=1))
    return chip


class TestDatasheet:
    @pytest.mark.parametrize(("osc_pf", "width_us"), [(100, 10), (330, 30), (1000, 90)])
    def test_clk_width_at_the_stated_capacitors(self, osc_pf: float, width_us: int) -> None:
        assert Oscillator(osc_pf).clk_width_min_counts == 72 * width_us

    @pytest.mark.parametrize(("osc_pf", "khz"), [(100, 400), (330, 130), (1000, 44)])
    def test_oscillator_formula(self, osc_pf: float, khz: float) -> None:
        assert Oscillator(osc_pf).hz / 1000 == pytest.approx(khz, rel=0.01)
        assert Oscillator(osc_pf).chopping_hz / 1000 == pytest.approx(khz / 4, rel=0.01)

    def test_other_capacitors_take_four_oscillator_periods(self) -> None:
        assert Oscillator(470).clk_width_min_counts == pytest.approx(4 * 72e6 / Oscillator(470).hz, abs=1)

    @pytest.mark.parametrize("osc_pf", [0, -330, float("nan")])
    def test_a_capacitor_has_a_positive_value(self, osc_pf: float) -> None:
        with refusing(ValueError):
            Oscillator(osc_pf)

    @pytest.mark.parametrize("full_a", [0, -0.5])
    def test_a_current_has_a_positive_value(self, full_a: float) -> None:
        with refusing(ValueError):
            a_tb6560(330, full_a)

    def test_the_oscillator_is_600_khz_at_most(self) -> None:
        """44e6 / (C + 10) by page 25's formula: 603 kHz at 63 pF, 595 kHz at 64 pF."""
        assert Oscillator(64).hz == pytest.approx(44e6 / 74)
        with refusing(ValueError):
            Oscillator(63)
        with refusing(ValueError):
            a_tb6560(5)

    def test_the_outputs_carry_3_amperes_at_most(self) -> None:
        assert a_tb6560(330, 3).violation_count == 0
        with refusing(ValueError):
            a_tb6560(330, 3.01)
        with refusing(ValueError):
            a_tb6560(330, 10)

    def test_the_pins(self) -> None:
        """HZIP25, page 3: the order along the package."""
        assert [pin.number for pin in PINS] == list(range(1, 26))
        assert " ".join(pin.name for pin in PINS) == (
            "TQ2 TQ1 CLK ENABLE RESET SGND OSC VMB OUT_BM PGNDB NFB OUT_BP OUT_AM NFA PGNDA OUT_AP MO VMA Protect VDD"
            " CW/CCW M2 M1 DCY2 DCY1"
        )
        inputs = {pin.name for pin in PINS if pin.kind is PinKind.INPUT}
        assert inputs == set(TERMINALS) - {"VDD", "VM"} | {"CLK", "CW/CCW"}
        assert [pin.name for pin in PINS if pin.kind is PinKind.OPEN_DRAIN] == ["MO", "Protect"]

    def test_the_pages_of_the_pins(self) -> None:
        """All are of the pin table, page 3, but Protect: page 3 says high after shutdown, text and table of 10 low."""
        pages = [3] * 25
        pages[19 - 1] = 10
        assert [pin.page for pin in PINS] == pages

    def test_where_the_limits_are_from(self) -> None:
        """Typed from the datasheet: operating ranges and timing are on pages 6 to 8, M1 and M2 on 15, power on 28."""
        assert [(limit.rule.name, limit.value, limit.source) for limit in a_tb6560(330).violations.limits] == [
            ("CLK_HIGH", 30 * 72, "TB6560AHQ datasheet, page 8"),
            ("CLK_PERIOD", 72_000_000 // 15_000, "TB6560AHQ datasheet, page 7"),
            ("MODE_CHANGE", 0, "TB6560AHQ datasheet, page 15, level of RESET"),
            ("POWER_ORDER", 1, "TB6560AHQ datasheet, page 28, level of VDD as VM rises"),
            ("POWER_ORDER", 1, "TB6560AHQ datasheet, page 28, level of VM as an input rises"),
            ("POWER_ORDER", 0, "TB6560AHQ datasheet, page 28, level of an input as VM falls"),
            ("POWER_ORDER", 0, "TB6560AHQ datasheet, page 28, level of VM as VDD falls"),
            ("OVER_TEMPERATURE", 170, "TB6560AHQ datasheet, pages 6 to 8"),
        ]


@pytest.mark.parametrize("osc_pf", [100, 330, 1000])
def test_clk_width_on_both_sides(osc_pf: float) -> None:
    limit = Oscillator(osc_pf).clk_width_min_counts
    chip = powered(osc_pf)
    chip.feed(pins([10_000, 30_000], [limit, limit - 1], UP))
    assert chip.position_steps == 1
    found = chip.violations
    assert (found.counts.tolist(), found.rules()) == ([30_000], [Rule.CLK_HIGH])
    assert (found.values.tolist(), found.margins().tolist()) == ([limit - 1], [-1])


def test_clk_rate_on_both_sides() -> None:
    chip = powered()
    chip.feed(pins([10_000, 10_000 + PERIOD, 10_000 + 2 * PERIOD - 1], directions=UP))
    assert chip.position_steps == 2
    found = chip.violations
    assert (found.rules(), found.values.tolist(), found.margins().tolist()) == ([Rule.CLK_PERIOD], [4799], [-1])


def test_rate_is_watched_across_batches() -> None:
    chip = powered()
    chip.feed(pins([10_000], directions=UP))
    chip.feed(pins([14_799]))
    assert chip.position_steps == 1
    assert chip.violations.counts.tolist() == [14_799]


def test_a_pulse_may_break_two_limits() -> None:
    chip = powered()
    chip.feed(pins([10_000, 11_000], [WIDTH, 5]))
    assert [rule.name for rule in chip.violations.rules()] == ["CLK_HIGH", "CLK_PERIOD"]
    assert chip.violations.counts.tolist() == [11_000, 11_000]
    assert {limit.unit for limit in chip.violations.limits[:2]} == {LimitUnit.COUNTS}


def test_direction_is_sampled_at_the_rise() -> None:
    """DIR high counts up; an edge at the very count of the rise is seen, one count later is not."""
    chip = powered()
    chip.feed(pins([10_000, 20_000, 30_000], directions=((0, 1), (20_000, 0), (30_001, 1))))
    assert chip.steps[1].tolist() == [1, -1, -1]
    chip.feed(pins([40_000]))
    assert chip.position_steps == 0


def test_reset_ignores_clk_without_a_violation() -> None:
    chip = a_tb6560(330)
    chip.feed(pins([10_000, 20_000, 40_000], 5, UP, (*at(0, VDD=1, VM=1), *at(30_000, RESET=1))))
    assert chip.position_steps == 0
    assert chip.violations.counts.tolist() == [40_000]
    chip.feed(pins([50_000, 60_000], changes=at(55_000, RESET=0)))
    assert chip.position_steps == 1


def test_reset_at_the_very_count_of_a_rise_is_seen() -> None:
    chip = powered()
    chip.feed(pins([10_000, 20_000, 30_000], directions=UP, changes=(*at(10_000, RESET=0), *at(30_000, RESET=1))))
    assert chip.steps[0].tolist() == [30_000]


def test_a_reset_within_one_count_loses_no_step() -> None:
    chip = powered()
    chip.feed(pins([10_000], directions=UP, changes=(*at(10_000, RESET=0), *at(10_000, RESET=1))))
    assert chip.position_steps == 1


def test_the_counter_follows_clk_while_the_outputs_are_off() -> None:
    chip = powered()
    chip.feed(pins([10_000, 20_000, 30_000], directions=UP, changes=(*at(15_000, ENABLE=0), *at(25_000, ENABLE=1))))
    assert chip.position_steps == 3
    assert not chip.violations.counts.size


def test_without_its_supply_the_chip_counts_nothing() -> None:
    chip = a_tb6560(330)
    chip.feed(pins([10_000, 20_000, 30_000], directions=UP, changes=(*POWER_UP, *at(15_000, VM=0, VDD=0))))
    assert chip.position_steps == 1


class TestPowerOrder:
    """Page 28: VDD, VM, then the inputs; off in reverse. Each rule on both sides."""

    def rules_and_margins(self, *changes: LevelChange) -> list[tuple[Rule, int]]:
        chip = a_tb6560(330)
        chip.feed(pins(changes=changes))
        found = chip.violations
        return list(zip(found.rules(), found.margins().tolist(), strict=True))

    def test_in_order(self) -> None:
        supplies, released = [Rail.VDD, Rail.VM], [Pin.RESET, Pin.ENABLE]
        order = [*supplies, *(pin for pin in TERMINALS if pin not in (*supplies, *released)), *released]
        on = (LevelChange(i, pin, 1) for i, pin in enumerate(order))
        off = (LevelChange(100 + i, pin, 0) for i, pin in enumerate(reversed(order)))
        assert self.rules_and_margins(*on, *off) == []

    def test_vm_before_vdd(self) -> None:
        assert self.rules_and_margins(*at(0, VM=1), *at(1, VDD=1)) == [(Rule.POWER_ORDER, -1)]

    def test_vdd_off_before_vm(self) -> None:
        assert self.rules_and_margins(*at(0, VDD=1, VM=1), *at(1, VDD=0)) == [(Rule.POWER_ORDER, 1)]

    @pytest.mark.parametrize("pin", ["RESET", "ENABLE", "M1", "TQ2", "DCY1"])
    def test_vm_off_before_an_input(self, pin: str) -> None:
        on = (*at(0, VDD=1, VM=1), *at(1, **{pin: 1}))
        assert self.rules_and_margins(*on, *at(2, VM=0), *at(3, **{pin: 0}), *at(4, VDD=0)) == [(Rule.POWER_ORDER, 1)]
        assert self.rules_and_margins(*on, *at(2, **{pin: 0}), *at(3, VM=0), *at(4, VDD=0)) == []

    def test_both_supplies_off_before_all_inputs(self) -> None:
        """Said once for VM's fall, however many inputs are high; VDD falls after VM."""
        chip = a_tb6560(330)
        chip.feed(pins(changes=(*POWER_UP, *at(10, VM=0), *at(20, VDD=0))))
        found = chip.violations
        assert (found.counts.tolist(), found.values.tolist()) == ([10], [1])
        assert "page 28, level of an input as VM falls" in found.limits[found.which[0]].source

    @pytest.mark.parametrize(("dir_falls", "times"), [(10, 0), (11, 1)])
    def test_vm_off_before_direction(self, dir_falls: int, times: int) -> None:
        chip = a_tb6560(330)
        changes = (*POWER_UP, *at(10, ENABLE=0, RESET=0, VM=0), *at(20, VDD=0))
        chip.feed(pins(directions=[(5, 1), (dir_falls, 0)], changes=changes))
        assert chip.violations.rules() == [Rule.POWER_ORDER] * times
        assert chip.violations.counts.tolist() == [10] * times

    @pytest.mark.parametrize("pieces", [[], [9_000], [11_000, 25_000]])
    @pytest.mark.parametrize("supplies", [(), ("VDD",)])
    def test_clk_and_direction_before_vm(self, supplies: tuple[str, ...], pieces: list[int]) -> None:
        """Two pulses and DIR's rise too soon, the third pulse at the very count of VM."""
        chip = a_tb6560(330)
        up = (*at(0, **dict.fromkeys(supplies, 1)), *at(30_000, **dict.fromkeys(("VDD", "VM"), 1)))
        for piece in cut(pins([10_000, 20_000, 30_000], directions=[(5_000, 1)], changes=up), pieces):
            chip.feed(piece)
        found = chip.violations
        assert sorted(found.counts.tolist()) == [5_000, 10_000, 20_000]
        assert set(zip(found.rules(), found.margins().tolist(), strict=True)) == {(Rule.POWER_ORDER, -1)}
        assert chip.position_steps == 0

    def test_clk_after_vm(self) -> None:
        """Also where VDD is left, with which the counter counts on."""
        chip = powered()
        chip.feed(pins([10_000, 20_000, 30_000], changes=at(20_000, RESET=0, ENABLE=0, VM=0)))
        assert chip.violations.counts.tolist() == [20_000, 30_000]

    @pytest.mark.parametrize("pin", ["RESET", "ENABLE", "M1", "TQ2", "DCY1"])
    def test_an_input_before_vm(self, pin: str) -> None:
        assert self.rules_and_margins(*at(0, VDD=1, **{pin: 1}), *at(1, VM=1)) == [(Rule.POWER_ORDER, -1)]


class TestModeChange:
    @pytest.mark.parametrize("pin", ["M1", "M2"])
    @pytest.mark.parametrize("reset", [0, 1])
    def test_only_in_reset(self, pin: str, reset: int) -> None:
        chip = powered()
        chip.feed(pins(changes=(*at(100, RESET=reset), *at(200, **{pin: 1}), *at(300, RESET=1))))
        found = chip.violations
        assert found.rules() == [Rule.MODE_CHANGE] * reset
        assert found.margins().tolist() == [1] * reset

    def test_the_same_level_again_is_no_change(self) -> None:
        chip = powered()
        chip.feed(pins(changes=at(200, M1=0)))
        assert not chip.violations.counts.size


def test_nothing_happens_without_pulses() -> None:
    chip = powered()
    chip.feed(pins())
    assert chip.position_steps == 0
    assert chip.steps[0].size == chip.violations.counts.size == 0


PULSES = st.lists(st.tuples(st.integers(1, 9000), st.integers(1, 4000)), min_size=1, max_size=60)
TURNS = st.lists(st.integers(0, 400_000), max_size=10, unique=True)
CHANGES = st.lists(
    st.tuples(st.integers(1, 400_000), st.sampled_from(list(TERMINALS)[1:]), st.integers(0, 1)), max_size=12
)


def stream(pulses: list[tuple[int, int]], turns: list[int], changes: list[tuple[int, str, int]]) -> TerminalEdges:
    """Gaps and widths of pulses, where DIR turns, and what the other inputs do once the supply is up."""
    gaps, widths = zip(*pulses, strict=True)
    rises = np.cumsum(np.array(gaps) + np.concatenate(([0], widths[:-1]))).tolist()
    directions = [(counts, (i + 1) % 2) for i, counts in enumerate(sorted(turns))]
    later = sorted((LevelChange(*change) for change in changes), key=lambda change: change.counts)
    return pins(rises, widths, directions, (*POWER_UP, *later))


def levels_at_rises(whole: TerminalEdges) -> list[int]:
    turned = np.searchsorted(whole.dir_counts, whole.clk_rise_counts, side="right").tolist()
    return [int(whole.dir_levels[n - 1]) if n else 0 for n in turned]


@pytest.mark.slow
@given(pulses=PULSES, turns=TURNS, changes=CHANGES)
def test_against_a_chip_stepped_edge_by_edge(
    pulses: list[tuple[int, int]], turns: list[int], changes: list[tuple[int, str, int]]
) -> None:
    """The same rules, one pulse at a time."""
    whole = stream(pulses, turns, changes)
    steps, previous = [], -PERIOD
    for rise, fall in zip(whole.clk_rise_counts.tolist(), whole.clk_fall_counts.tolist(), strict=True):
        reset = [change.level for change in whole.changes if change.terminal == Pin.RESET and change.counts <= rise][-1]
        turned = np.searchsorted(whole.dir_counts, rise, side="right")
        level = int(whole.dir_levels[turned - 1]) if turned else 0
        if reset and fall - rise >= WIDTH and rise - previous >= PERIOD:
            steps.append((rise, 2 * level - 1))
        previous = rise
    chip = a_tb6560(330)
    chip.feed(whole)
    assert list(zip(*(values.tolist() for values in chip.steps), strict=True)) == steps
    assert chip.position_steps == sum(sign for _, sign in steps)
    meant = [2 * int(level) - 1 for level in levels_at_rises(whole)]
    assert chip.position_steps + chip.lost_steps == sum(meant)
    assert chip.violation_count == chip.violations.counts.size


@pytest.mark.slow
@given(pulses=PULSES, turns=TURNS, changes=CHANGES, cuts=st.lists(st.integers(0, 450_000), max_size=6))
def test_pieces_make_no_difference(
    pulses: list[tuple[int, int]], turns: list[int], changes: list[tuple[int, str, int]], cuts: list[int]
) -> None:
    """Nor do looks at the chip in between."""
    whole = stream(pulses, turns, changes)
    once, pieced = a_tb6560(330), a_tb6560(330)
    once.feed(whole)
    for piece in cut(whole, cuts):
        pieced.feed(piece)
        assert pieced.outputs.home_levels(np.array([piece.until_counts])).size == 1
    assert pieced.position_steps == once.position_steps
    assert recorded(pieced) == recorded(once)
    times = np.linspace(-100, 500_000, 300).astype(np.int64)
    assert np.array_equal(pieced.outputs.currents_a(times), once.outputs.currents_a(times))


def recorded(chip: DriverChip) -> list[list[int]]:
    """Steps and violations; those of one instant in any order."""
    found = chip.violations
    order = np.lexsort((found.which, found.counts))
    kept = (*chip.steps, found.counts[order], found.which[order], found.values[order])
    return [[int(value) for value in values] for values in kept]


@pytest.mark.parametrize("seed", range(4))
def test_a_stream_edge_by_edge_and_in_pieces(seed: int) -> None:
    draw = Random(seed)
    pulses = [(draw.randint(1, 9000), draw.randint(1, 4000)) for _ in range(60)]
    turns = draw.sample(range(400_000), 10)
    changes = [(draw.randint(1, 400_000), draw.choice(list(TERMINALS)[1:]), draw.randint(0, 1)) for _ in range(seed)]
    one_example(test_against_a_chip_stepped_edge_by_edge, pulses, turns, changes)
    one_example(test_pieces_make_no_difference, pulses, turns, changes, [draw.randint(0, 450_000) for _ in range(6)])
