"""The excitation modes against the datasheet's tables, through the chip's pins: currents, angles, MO, torque, RESET."""

import numpy as np
import pytest

from steptwin.controller.node.pins import Pin
from steptwin.emulator.drivers.chip import DriverChip
from steptwin.emulator.drivers.excitation import excitations
from steptwin.emulator.drivers.limits import Rule
from steptwin.emulator.drivers.terminals import LevelChange
from tests.emulator.pins import CHIP, MODES, POWER_UP, TERMINALS, a_tb6560, at, pins

# Pages 12 to 14, clockwise from the initial state.
A_EIGHTHS = [100, 98, 92, 83, 71, 56, 38, 20, 0, -20, -38, -56, -71, -83, -92, -98]
B_EIGHTHS = [0, 20, 38, 56, 71, 83, 92, 98, 100, 98, 92, 83, 71, 56, 38, 20]
A_SIXTEENTHS = [
    100, 100, 98, 96, 92, 88, 83, 77, 71, 63, 56, 47, 38, 29, 20, 10,
    0, -10, -20, -29, -38, -47, -56, -63, -71, -77, -83, -88, -92, -96, -98, -100,
]  # fmt: skip
B_SIXTEENTHS = [
    0, 10, 20, 29, 38, 47, 56, 63, 71, 77, 83, 88, 92, 96, 98, 100,
    100, 100, 98, 96, 92, 88, 83, 77, 71, 63, 56, 47, 38, 29, 20, 10,
]  # fmt: skip


def half_wave(values: list[int]) -> list[int]:
    """Return a cycle whose second half is the negated first half."""
    return values + [-value for value in values]


TABLES = {
    (0, 0): ([100, 100, -100, -100], [-100, 100, 100, -100]),
    (0, 1): ([100, 71, 0, -71, -100, -71, 0, 71], [0, 71, 100, 71, 0, -71, -100, -71]),
    (1, 1): (half_wave(A_EIGHTHS), half_wave(B_EIGHTHS)),
    (1, 0): (half_wave(A_SIXTEENTHS), half_wave(B_SIXTEENTHS)),
}
"""Currents of A and B in percent by the levels of M2 and M1."""

STEP = 10_000
FIRST = 100_000


def chip_in_mode(m2: int, m1: int, *changes: LevelChange, full_a: float = 1.0) -> DriverChip:
    """Return a chip with supply, out of reset and enabled; by default 1 A."""
    chip = a_tb6560(330, full_a)
    supplies, released = POWER_UP[:2], POWER_UP[2:]
    chip.feed(pins(changes=(*supplies, *at(0, M2=m2, M1=m1), *released, *changes), until=1))
    return chip


def rises(count: int) -> list[int]:
    return [FIRST + i * STEP for i in range(count)]


def instants(count: int) -> np.ndarray[tuple[int], np.dtype[np.int64]]:
    """Before the first step, then just at each of them."""
    return np.array([FIRST - 1, *rises(count)], dtype=np.int64)


def percent(chip: DriverChip, times: np.ndarray[tuple[int], np.dtype[np.int64]]) -> list[list[int]]:
    currents = chip.outputs.currents_a(times) * 100
    assert np.abs(currents - np.rint(currents)).max() < 1e-9
    return [[round(value) for value in phase] for phase in currents.T.tolist()]


@pytest.mark.parametrize("levels", TABLES)
class TestTables:
    def test_clockwise(self, levels: tuple[int, int]) -> None:
        """DIR low, once around and on into the initial state."""
        a, b = TABLES[levels]
        chip = chip_in_mode(*levels)
        chip.feed(pins(rises(len(a))))
        assert percent(chip, instants(len(a))) == [[*a, a[0]], [*b, b[0]]]

    def test_counterclockwise(self, levels: tuple[int, int]) -> None:
        a, b = TABLES[levels]
        chip = chip_in_mode(*levels)
        chip.feed(pins(rises(len(a)), directions=[(1, 1)]))
        assert percent(chip, instants(len(a))) == [[a[0], *reversed(a)], [b[0], *reversed(b)]]

    def test_mo_is_low_in_one_state_of_a_cycle(self, levels: tuple[int, int]) -> None:
        """From the edge that enters the initial state to the edge that leaves it; every 4, 8, 32 or 64 steps."""
        cycle = len(TABLES[levels][0])
        assert cycle == 4 * MODES[levels]
        chip = chip_in_mode(*levels)
        chip.feed(pins(rises(2 * cycle + 1)))
        low = [0, *[1] * (cycle - 1)]
        assert chip.outputs.home_levels(instants(2 * cycle + 1)).tolist() == [*low, *low, 0, 1]
        around = np.array(rises(cycle)[-1:], dtype=np.int64)
        assert chip.outputs.home_levels(around - 1).tolist() == [1]
        assert chip.outputs.home_levels(around).tolist() == [0]

    def test_a_step_turns_the_field_by_its_part_of_a_full_step(self, levels: tuple[int, int]) -> None:
        mode = MODES[levels]
        chip = chip_in_mode(*levels)
        chip.feed(pins(rises(5)))
        angles = chip.outputs.angle_deg(instants(5))
        assert angles[0] == (315 if mode == 1 else 0)
        assert np.array_equal((np.diff(angles) + 360) % 360, np.full(5, 90 / mode))

    def test_the_vector_is_as_long_as_the_table_allows(self, levels: tuple[int, int]) -> None:
        """141 % in two-phase mode, else 100 % as near as whole percents come."""
        mode = MODES[levels]
        lengths = 100 * np.hypot(*excitations(CHIP)[mode].parts.T)
        expected = 141.42 if mode == 1 else 100
        assert lengths == pytest.approx(expected, abs=1.5)

    def test_reset_goes_back_to_the_initial_state(self, levels: tuple[int, int]) -> None:
        """MO is low throughout; the next step leads to the state after the initial one; the count stays."""
        a, b = TABLES[levels]
        chip = chip_in_mode(*levels)
        chip.feed(pins(rises(3), changes=(*at(300_000, RESET=0), *at(400_000, RESET=1))))
        chip.feed(pins([350_000 + 100_000]))
        times = np.array([299_999, 300_000, 399_999, 400_000, 450_000], dtype=np.int64)
        assert percent(chip, times) == [[a[3], a[0], a[0], a[0], a[1]], [b[3], b[0], b[0], b[0], b[1]]]
        assert chip.outputs.home_levels(times).tolist() == [1, 0, 0, 0, 1]
        assert chip.position_steps == -4


class TestEnable:
    def test_the_state_advances_while_the_outputs_are_off(self) -> None:
        a, b = TABLES[1, 0]
        chip = chip_in_mode(1, 0)
        chip.feed(pins(rises(5), changes=(*at(FIRST + 1, ENABLE=0), *at(FIRST + 4 * STEP + 1, ENABLE=1))))
        times = np.array([FIRST, FIRST + 2 * STEP, FIRST + 5 * STEP], dtype=np.int64)
        assert percent(chip, times) == [[a[1], 0, a[5]], [b[1], 0, b[5]]]
        assert chip.outputs.field_substeps(times).tolist() == [1, 3, 5]

    def test_outputs_come_after_3_us_and_go_after_2_us(self) -> None:
        """Page 8."""
        chip = chip_in_mode(1, 0, *at(10_000, ENABLE=0), *at(20_000, ENABLE=1))
        times = np.array([10_000 + 143, 10_000 + 144, 20_000 + 215, 20_000 + 216], dtype=np.int64)
        assert percent(chip, times)[0] == [100, 0, 0, 100]

    def test_no_current_without_a_supply(self) -> None:
        chip = chip_in_mode(1, 0, *at(10_000, VM=0), *at(20_000, VM=1))
        assert percent(chip, np.array([9_999, 10_000, 20_000]))[0] == [100, 0, 100]


class TestModeChange:
    def test_in_reset_the_new_mode_begins_in_its_initial_state(self) -> None:
        chip = chip_in_mode(1, 0)
        changes = (*at(200_000, RESET=0), *at(200_000, M2=0), *at(200_000, RESET=1))
        chip.feed(pins([*rises(3), 210_000], changes=changes))
        assert chip.outputs.field_substeps(np.array([199_999, 200_000, 210_000])).tolist() == [3, 56, 56 + 16 - 64]
        assert not chip.violations.counts.size

    @pytest.mark.parametrize(("steps", "state"), [(0, 56), (7, 56), (8, 8), (23, 8), (24, 24)])
    def test_outside_reset_the_currents_jump_to_the_nearest_state_before(self, steps: int, state: int) -> None:
        chip = chip_in_mode(1, 0)
        chip.feed(pins(rises(steps), changes=at(900_000, M2=0)))
        assert chip.outputs.field_substeps(np.array([899_999, 900_000])).tolist() == [steps, state]
        assert chip.violations.rules() == [Rule.MODE_CHANGE]

    def test_to_a_finer_mode_without_reset_the_angle_stays(self) -> None:
        chip = chip_in_mode(0, 1)
        chip.feed(pins(rises(3), changes=at(900_000, M2=1)))
        chip.feed(pins([950_000]))
        assert chip.outputs.field_substeps(np.array([900_000, 950_000])).tolist() == [24, 26]


class TestTorqueAndDecay:
    @pytest.mark.parametrize(("tq2", "tq1", "expected"), [(0, 0, 100), (0, 1, 75), (1, 0, 50), (1, 1, 20)])
    def test_torque_scales_the_currents(self, tq2: int, tq1: int, expected: int) -> None:
        chip = chip_in_mode(1, 0, *at(5_000, TQ2=tq2, TQ1=tq1))
        assert percent(chip, np.array([5_000], dtype=np.int64))[0] == [expected]
        assert CHIP.torque_percent.value.selected({"TQ2": tq2, "TQ1": tq1}) == expected

    def test_decay(self) -> None:
        """The last 0, 1, 2 or 4 of a chopping period's 4 oscillations."""
        chip = chip_in_mode(1, 0, *at(5_000, DCY1=1), *at(6_000, DCY1=0, DCY2=1), *at(7_000, DCY1=1))
        assert chip.outputs.fast_decay(np.array([4_000, 5_000, 6_000, 7_000])).tolist() == [0, 0.25, 0.5, 1]

    @pytest.mark.parametrize("ampere", [1.0, 2.0, 0.4])
    def test_the_full_current(self, ampere: float) -> None:
        chip = chip_in_mode(1, 0, full_a=ampere)
        assert chip.outputs.currents_a(np.array([5_000])).tolist() == [[pytest.approx(ampere), 0]]


def test_instants_may_be_asked_for_in_any_order() -> None:
    chip = chip_in_mode(1, 0)
    chip.feed(pins(rises(40), directions=[(1, 1), (FIRST + 15 * STEP, 0)]))
    times = np.array(rises(40), dtype=np.int64)
    shuffled = np.random.default_rng(3).permutation(40)
    for ask in (chip.outputs.field_substeps, chip.outputs.home_levels, chip.outputs.currents_a):
        assert np.array_equal(np.asarray(ask(times))[shuffled], ask(times[shuffled]))


def test_before_the_supply_nothing_flows() -> None:
    chip = a_tb6560(330)
    assert chip.outputs.currents_a(np.array([0, 10])).tolist() == [[0, 0], [0, 0]]
    assert chip.outputs.home_levels(np.array([0])).tolist() == [0]


def test_every_mode_has_its_levels() -> None:
    table = CHIP.modes.value
    assert {levels: table.selected({"M2": levels[0], "M1": levels[1]}) for levels in MODES} == MODES
    assert set(TERMINALS) >= {Pin.M1, Pin.M2}
