"""Every driver keeps its datasheet's limits, on both sides of each: the figures here are the documents' own."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest

from steptwin.emulator.drivers.driver import Driver
from steptwin.emulator.drivers.driver_module import fitted
from steptwin.emulator.drivers.limits import Rule
from steptwin.emulator.drivers.terminals import LevelChange
from steptwin.protocol import drivers
from steptwin.protocol.drivers import GENERIC, DriverFigures, Grade
from tests.emulator.pins import WIDTH, at, pins
from tests.messages import refusing

FIGURES = DriverFigures(
    microsteps=(1, 5, 8, 256),
    steplen_ns=1_300,
    stepspace_ns=2_100,
    dirsetup_ns=400,
    dirhold_ns=3_300,
    enable_ns=70_000,
    wake_ns=5_000_000,
    step_rate_max_hz=100_000,
    current_max_a=2.2,
)
PROFILES = {**drivers.PROFILES, GENERIC: FIGURES.profile()}
NAMES = ("a4988", "drv8825", "a3967", "tmc2209", "tmc5160", "dm542", "dm542t", "tb6600", GENERIC)
UP = 100
"""Instant of power-up, in counts."""
SETTLED = 72_000_000
"""A second after it."""
WIDE = 1440
"""A period that suits all, in counts."""
SUPPLY = tuple(LevelChange(UP, pin, 1) for pin in ("VDD", "VM", "ENABLE"))


def counts(ns: int) -> int:
    """Return a time in counts of 1/72 us, rounded up."""
    return -(-ns * 72 // 1000)


def made(
    name: str,
    rises: Sequence[int],
    widths: int = WIDTH,
    directions: Sequence[tuple[int, int]] = (),
    *,
    steps: int,
    enable: int = UP,
) -> list[Rule]:
    """Feed pulses to a driver with 8 microsteps; check how many steps it counts; return the rules that were broken."""
    driver = Driver(fitted(PROFILES[name], 8))
    driver.feed(pins(changes=(*SUPPLY[:2], LevelChange(enable, "ENABLE", 1)), until=enable + 1))
    driver.feed(pins(rises, widths, directions))
    driver.feed(pins(until=10**13))
    assert driver.steps[0].size == steps
    return driver.violations.rules()


@pytest.mark.parametrize(
    ("name", "ns"),
    [
        ("a4988", 1_000),
        ("drv8825", 1_900),
        ("a3967", 1_000),
        ("tmc2209", 104),
        ("tmc5160", 104),
        ("dm542", 2_500),
        ("dm542t", 2_500),
        ("tb6600", 5_000),
        (GENERIC, 1_300),
    ],
)
def test_high_as_long_as_the_document_says(name: str, ns: int) -> None:
    assert made(name, (SETTLED,), widths=counts(ns), steps=1) == []
    assert made(name, (SETTLED,), widths=counts(ns) - 1, steps=0) == [Rule.CLK_HIGH]


@pytest.mark.parametrize(
    ("name", "ns", "period_ns"),
    [
        ("a4988", 1_000, 2_000),
        ("drv8825", 1_900, 4_000),
        ("a3967", 1_000, 2_000),
        ("tmc2209", 104, 167),
        ("tmc5160", 104, 167),
        ("dm542", 2_500, 5_000),
        ("dm542t", 2_500, 5_000),
        ("tb6600", 5_000, 0),
        (GENERIC, 2_100, 10_000),
    ],
)
def test_low_as_long_as_the_document_says_and_no_faster_than_its_rate(name: str, ns: int, period_ns: int) -> None:
    """The widths are such that only one of the two limits is near."""
    low, wide = counts(ns), 4 * counts(ns) + counts(period_ns)
    assert made(name, (SETTLED, SETTLED + wide + low), widths=wide, steps=2) == []
    assert made(name, (SETTLED, SETTLED + wide + low - 1), widths=wide, steps=1) == [Rule.CLK_LOW]
    period = period_ns * 72 // 1000
    both = 2 * low
    if period > both:
        assert made(name, (SETTLED, SETTLED + period), widths=low, steps=2) == []
        assert made(name, (SETTLED, SETTLED + period - 1), widths=low, steps=1) == [Rule.CLK_PERIOD]


@pytest.mark.parametrize(
    ("name", "setup_ns", "hold_ns"),
    [
        ("a4988", 200, 200),
        ("drv8825", 650, 650),
        ("a3967", 200, 200),
        ("tmc2209", 20, 20),
        ("tmc5160", 20, 20),
        ("dm542", 5_000, 10_000),
        ("dm542t", 5_000, 10_000),
        ("tb6600", 5_000, 5_000),
        (GENERIC, 400, 3_300),
    ],
)
def test_dir_stands_still_around_the_edge(name: str, setup_ns: int, hold_ns: int) -> None:
    def broken(before: int, after: int) -> list[Rule]:
        turns = [(SETTLED - before, 1), (SETTLED + after, 0)]
        return made(name, (SETTLED,), widths=1000, directions=turns, steps=1)

    setup, hold = counts(setup_ns), counts(hold_ns)
    assert broken(setup, hold) == []
    assert broken(setup - 1, hold) == [Rule.DIR_SETUP]
    assert broken(setup, hold - 1) == [Rule.DIR_HOLD]


@pytest.mark.parametrize(
    ("name", "ns"), [("drv8825", 650), ("dm542", 10_000), ("dm542t", 200_000_000), (GENERIC, 70_000)]
)
def test_enabled_before_the_first_step(name: str, ns: int) -> None:
    enable = SETTLED - counts(ns)
    assert made(name, (SETTLED,), steps=1, enable=enable) == []
    assert made(name, (SETTLED,), steps=0, enable=enable + 1) == [Rule.ENABLE_SETUP]


@pytest.mark.parametrize("name", [name for name in NAMES if name not in ("drv8825", "dm542", "dm542t", GENERIC)])
def test_others_ask_for_no_time_after_enable(name: str) -> None:
    assert made(name, (SETTLED,), steps=1, enable=SETTLED - 1) == []


@pytest.mark.parametrize(("early_counts", "steps"), [(0, 0), (1, 0), (46, 0), (47, 1)])
def test_enabled_again_before_a_step(early_counts: int, steps: int) -> None:
    """Within one stretch, after a second in which it was enabled: the 650 ns begin anew, also in the very count."""
    driver = Driver(fitted(PROFILES["drv8825"], 8))
    driver.feed(pins(changes=SUPPLY, until=UP + 1))
    changes = (*at(SETTLED - 9000, ENABLE=0), *at(SETTLED - early_counts, ENABLE=1))
    driver.feed(pins((SETTLED,), changes=changes, until=SETTLED + 9000))
    assert driver.steps[0].size == steps
    assert driver.violations.rules() == [Rule.ENABLE_SETUP] * (1 - steps)


@pytest.mark.parametrize(
    ("name", "ns"), [("a4988", 1_000_000), ("drv8825", 1_700_000), ("a3967", 1_000_000), (GENERIC, 5_000_000)]
)
def test_awake_before_the_first_step(name: str, ns: int) -> None:
    assert made(name, (UP + counts(ns),), steps=1) == []
    assert made(name, (UP + counts(ns) - 1,), steps=0) == [Rule.WAKE_UP]


@pytest.mark.parametrize(
    ("name", "counts_on"),
    [
        ("a4988", True),
        ("drv8825", False),
        ("a3967", True),
        ("tmc2209", True),
        ("tmc5160", True),
        ("dm542", False),
        ("dm542t", False),
        ("tb6600", False),
        (GENERIC, False),
    ],
)
def test_while_disabled(name: str, counts_on: bool) -> None:
    """The fact that an A4988's counter goes on, and a DRV8825's does not, is on their data sheets' pages 10 and 12."""
    driver = Driver(fitted(PROFILES[name], 8))
    driver.feed(pins(changes=SUPPLY, until=UP + 1))
    driver.feed(pins((SETTLED, SETTLED + 9000), changes=at(SETTLED - 10, ENABLE=0)))
    assert driver.steps[0].size == (2 if counts_on else 0)
    assert driver.violations.rules() == ([] if counts_on else [Rule.DISABLED] * 2)


def test_a_generic_driver_may_count_while_it_is_off() -> None:
    driver = Driver(fitted(replace(FIGURES, counts_while_off=True).profile(), 8))
    driver.feed(pins(changes=SUPPLY, until=UP + 1))
    driver.feed(pins((SETTLED, SETTLED + 9000), changes=at(SETTLED - 10, ENABLE=0)))
    assert driver.steps[0].size == 2
    assert driver.violations.rules() == []


@pytest.mark.parametrize(
    ("name", "table"),
    [
        ("a4988", {1: "000", 2: "100", 4: "010", 8: "110", 16: "111"}),
        ("drv8825", {1: "000", 2: "001", 4: "010", 8: "011", 16: "100", 32: "101 110 111"}),
        ("a3967", {1: "00", 2: "10", 4: "01", 8: "11"}),
        ("tmc2209", {8: "000----", 32: "001----", 64: "010----", 16: "011----"}),
        (
            "tmc5160",
            dict(zip((256, 128, 64, 32, 16, 8, 4, 2, 1), (f"{number:04b}" for number in range(9)), strict=True)),
        ),
        (
            "dm542",
            {2: "0111", 4: "1011", 8: "0011", 16: "1101", 32: "0101", 64: "1001", 128: "0001"}
            | {5: "1110", 10: "0110", 20: "1010", 25: "0010", 40: "1100", 50: "0100", 100: "1000", 125: "0000"},
        ),
        ("tb6600", {1: "110", 2: "101 011", 4: "100", 8: "010", 16: "001", 32: "000"}),
        (GENERIC, {1: "00000", 5: "00001", 8: "00010", 256: "00011"}),
    ],
)
def test_pins_and_switches_select_the_microsteps(name: str, table: dict[int, str]) -> None:
    modes = PROFILES[name].chip.modes.value
    for microsteps, rows in table.items():
        found = [dict(zip(modes.pins, map(int, row.replace("-", "0")), strict=True)) for row in rows.split()]
        assert {modes.selected(levels) for levels in found} == {microsteps}
        assert modes.levels(microsteps) == found[0]
    rest = (1, 2, 4, 128, 256) if name == "tmc2209" else ()  # by its register
    assert sorted(modes.values) == sorted((*table, *rest))


@pytest.mark.parametrize("name", NAMES)
def test_as_many_steps_as_microsteps_are_a_full_step(name: str) -> None:
    """Each is as long as the others, and a cycle of four full steps ends where it began: no rounding in any mode."""
    sheet = PROFILES[name].chip
    for microsteps in sheet.microsteps:
        driver = Driver(fitted(PROFILES[name], microsteps))
        driver.feed(pins(changes=SUPPLY, until=UP + 1))
        cycle = range(SETTLED, SETTLED + 4 * microsteps * WIDE, WIDE)
        moved = [driver.feed(pins(cycle, WIDE // 2, [(SETTLED - WIDE, 1)])), driver.feed(pins(until=10**13))]
        moves = np.concatenate([each for _, each in moved])
        assert moves.size == 4 * microsteps
        assert set((moves * microsteps).tolist()) == {sheet.substeps}
        assert driver.chip.position_substeps == 4 * sheet.substeps


@pytest.mark.parametrize(
    ("name", "output", "degrees"),
    [
        ("a4988", None, 45.0),
        ("drv8825", ("nHOME", 0), 45.0),
        ("tmc2209", ("INDEX", 1), 90.0),
        ("tmc5160", ("DIAG1", 1), 90.0),
        ("dm542", None, 0.0),
        ("tb6600", None, 45.0),
    ],
)
def test_home(name: str, output: tuple[str, int] | None, degrees: float) -> None:
    sheet = PROFILES[name].chip
    assert sheet.home_deg.value == degrees
    assert (sheet.home_output and tuple(sheet.home_output.value)) == output


@pytest.mark.parametrize(
    ("name", "most_a"),
    [
        ("a4988", 2.0),
        ("drv8825", 2.5),
        ("a3967", 0.75),
        ("tmc2209", 2.8),
        ("dm542", 4.2),
        ("dm542t", 4.2),
        (GENERIC, 2.2),
    ],
)
def test_the_highest_current(name: str, most_a: float) -> None:
    assert fitted(PROFILES[name], 8, most_a).full_a == most_a
    with refusing(ValueError):
        fitted(PROFILES[name], 8, most_a + 0.01)


@pytest.mark.parametrize(
    ("name", "printed_a"),
    [
        ("dm542", (1.0, 1.46, 1.91, 2.37, 2.84, 3.31, 3.76, 4.2)),
        ("dm542t", (1.0, 1.46, 1.91, 2.37, 2.84, 3.31, 3.76, 4.2)),
        ("tb6600", (0.5, 1.0, 1.5, 2.0, 2.5, 2.8, 3.0, 3.5)),
    ],
)
def test_the_switches_currents(name: str, printed_a: tuple[float, ...]) -> None:
    currents = PROFILES[name].currents
    assert currents is not None
    assert tuple(setting.printed_a for setting in currents.value) == printed_a
    assert len({setting.switches for setting in currents.value}) == 8


@pytest.mark.parametrize(
    ("name", "celsius", "again"),
    [("a4988", 165, 150), ("a3967", 165, 150), ("tmc2209", 143, 120), ("tmc5160", 136, 120)],
)
def test_it_switches_off_when_hot_and_on_by_itself_when_cool(name: str, celsius: int, again: int) -> None:
    shutdown = PROFILES[name].chip.shutdown
    assert shutdown is not None
    assert (shutdown.value.celsius, shutdown.value.celsius - shutdown.value.hysteresis_k) == (celsius, again)
    driver = Driver(fitted(PROFILES[name], 8))
    assert Rule.TOO_HOT in [limit.rule for limit in driver.violations.limits]


def test_what_was_only_quoted_or_assumed_says_so() -> None:
    assert PROFILES["a4988"].chip.times.steplen_ns is not None
    assert PROFILES["a4988"].chip.times.steplen_ns.grade is Grade.STATED
    assert PROFILES["drv8825"].chip.times.steplen_ns is not None
    assert PROFILES["drv8825"].chip.times.steplen_ns.grade is Grade.QUOTED
    assert PROFILES["tb6600"].chip.times.steplen_ns is not None
    assert PROFILES["tb6600"].chip.times.steplen_ns.grade is Grade.ASSUMED
