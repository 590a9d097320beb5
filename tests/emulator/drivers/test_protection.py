"""What a short circuit and too high a supply do to each driver, and what ends it, by their documents."""

import numpy as np
import pytest

from steptwin.emulator.drivers.driver import Driver
from steptwin.emulator.drivers.driver_module import Module, fitted
from steptwin.emulator.drivers.limits import LimitUnit, Rule
from steptwin.emulator.drivers.terminals import LevelChange
from steptwin.protocol.cia402 import DigitalInput
from steptwin.protocol.drivers import PROFILES, bare_chip
from tests.emulator.pins import at, pins

UP, SHORT = 100, 10_000_000
MS = 72_000

ENDED_BY = {
    "3a-module": "nothing",
    "a4988": "power",
    "drv8825": "power",
    "a3967": "nothing",
    "tmc2209": "ENABLE",
    "tmc5160": "ENABLE",
    "dm542": "power",
    "dm542t": "power",
    "tb6600": "power",
}
"""What ends the latch of a short circuit; a DRV8825's nRESET is not at its carrier's connector to the board."""
ON = (LevelChange(UP, "VDD", 1), LevelChange(UP, "VM", 1), LevelChange(UP + 10, "ENABLE", 1))
OFF = ("ENABLE", "VM", "VDD")


def powered(name: str, *, wired: bool = False, enable: int = 1) -> Driver:
    driver = Driver(fitted(PROFILES[name], 8, fault_wired=wired))
    driver.feed(pins(changes=ON[: 2 + enable], until=SHORT))
    return driver


def has_current(driver: Driver, counts: int) -> bool:
    driver.feed(pins(until=counts + 10 * MS))
    return bool(np.abs(driver.chip.outputs.currents_a(np.array([counts]))).max() > 0)


def enabled(driver: Driver, counts: int, level: int) -> None:
    driver.feed(pins(changes=at(counts, ENABLE=level), until=counts + MS))


def power_cycled(driver: Driver, counts: int) -> None:
    falls = tuple(LevelChange(counts + i, terminal, 0) for i, terminal in enumerate(OFF))
    rises = tuple(LevelChange(counts + MS, change.terminal, 1) for change in ON)
    driver.feed(pins(changes=falls + rises, until=counts + 2 * MS))


@pytest.mark.parametrize(("name", "ended_by"), ENDED_BY.items())
def test_a_short_circuit_switches_the_outputs_off_until(name: str, ended_by: str) -> None:
    driver = powered(name)
    assert has_current(driver, SHORT - MS)
    driver.chip.short(SHORT, shorted=True)
    assert not has_current(driver, SHORT)
    assert driver.violations.rules() == [Rule.OVER_CURRENT]
    assert (driver.violations.counts.tolist(), driver.violations.values.tolist()) == ([SHORT], [1])
    driver.chip.short(SHORT + 20 * MS, shorted=False)
    assert not has_current(driver, SHORT + 30 * MS)  # the cause has gone, the latch stays
    enabled(driver, SHORT + 50 * MS, 0)
    enabled(driver, SHORT + 60 * MS, 1)
    assert has_current(driver, SHORT + 70 * MS) == (ended_by == "ENABLE")
    power_cycled(driver, SHORT + 90 * MS)
    assert has_current(driver, SHORT + 100 * MS) == (ended_by in ("ENABLE", "power"))
    assert driver.violations.rules() == [Rule.OVER_CURRENT]


@pytest.mark.parametrize("name", [name for name, ended_by in ENDED_BY.items() if ended_by == "ENABLE"])
def test_while_the_short_lasts_it_trips_again(name: str) -> None:
    driver = powered(name)
    driver.chip.short(SHORT, shorted=True)
    enabled(driver, SHORT + 10 * MS, 0)
    enabled(driver, SHORT + 20 * MS, 1)
    assert not has_current(driver, SHORT + 30 * MS)
    assert driver.violations.rules() == [Rule.OVER_CURRENT] * 2


def test_reset_ends_a_drv8825s_latch() -> None:
    """Page 12: until nRESET or the supply; here its nRESET is wired, as no carrier's is by itself."""
    driver = Driver(Module(PROFILES["drv8825"].chip))
    levels = (*ON[1:2], LevelChange(UP + 1, "RESET", 1), ON[2])
    driver.feed(pins(changes=levels, until=SHORT))
    driver.chip.short(SHORT, shorted=True)
    driver.chip.short(SHORT + 1, shorted=False)
    assert not has_current(driver, SHORT + MS)
    driver.feed(pins(changes=at(SHORT + 20 * MS, RESET=0), until=SHORT + 21 * MS))
    driver.feed(pins(changes=at(SHORT + 22 * MS, RESET=1), until=SHORT + 23 * MS))
    assert has_current(driver, SHORT + 30 * MS)


@pytest.mark.parametrize("name", ENDED_BY)
def test_it_trips_as_soon_as_current_flows(name: str) -> None:
    driver = powered(name, enable=0)
    driver.chip.short(SHORT, shorted=True)
    driver.feed(pins(until=SHORT + 10 * MS))
    assert driver.violations.rules() == []
    enabled(driver, SHORT + 20 * MS, 1)
    assert not has_current(driver, SHORT + 30 * MS)
    assert driver.violations.rules() == [Rule.OVER_CURRENT]


@pytest.mark.parametrize(
    ("name", "wired", "told"),
    [
        ("a4988", False, None),
        ("drv8825", False, None),
        ("drv8825", True, DigitalInput.DRIVER_FAULT),
        ("tmc2209", True, DigitalInput.DRIVER_FAULT),
        ("tmc5160", True, DigitalInput.DRIVER_FAULT),
        ("3a-module", False, None),
    ],
)
def test_the_board_sees_a_fault_output_that_is_wired(name: str, wired: bool, told: DigitalInput | None) -> None:
    driver = powered(name, wired=wired)
    assert driver.fault_input is told
    driver.chip.short(SHORT, shorted=True)
    driver.feed(pins(until=SHORT + MS))
    assert driver.fault_inputs(SHORT - 1) == DigitalInput(0)
    assert driver.fault_inputs(SHORT) == (told or DigitalInput(0))


def test_protect_tells_nothing_of_a_tb6560_that_is_destroyed() -> None:
    """Its datasheet knows thermal shutdown alone."""
    driver = Driver(Module(bare_chip(330).chip))
    driver.feed(pins(changes=(*ON, LevelChange(UP + 20, "RESET", 1)), until=SHORT))
    assert driver.fault_input is DigitalInput.DRIVER_PROTECT
    driver.chip.short(SHORT, shorted=True)
    assert not has_current(driver, SHORT + MS)
    assert driver.fault_inputs(SHORT + MS) == DigitalInput(0)


@pytest.mark.parametrize("name", ["dm542", "dm542t"])
def test_too_high_a_supply_switches_it_off_until_the_power_is_off(name: str) -> None:
    driver = powered(name)
    driver.chip.supply_voltage(SHORT, 52)
    assert has_current(driver, SHORT + MS)
    assert driver.violations.rules() == []
    driver.chip.supply_voltage(SHORT + 20 * MS, 53)
    driver.chip.supply_voltage(SHORT + 21 * MS, 24)
    assert not has_current(driver, SHORT + 30 * MS)
    (limit,) = (limit for limit in driver.violations.limits if limit.rule is Rule.OVER_VOLTAGE)
    assert (limit.value, limit.unit) == (52, LimitUnit.VOLT)
    assert driver.violations.values.tolist() == [53]
    power_cycled(driver, SHORT + 50 * MS)
    assert has_current(driver, SHORT + 60 * MS)


def test_a_supply_means_nothing_to_chips_without_such_a_protection() -> None:
    driver = powered("a4988")
    driver.chip.supply_voltage(SHORT, 600)
    assert has_current(driver, SHORT + MS)


def test_what_is_forgotten_changes_nothing_of_a_latch() -> None:
    driver = powered("tmc2209")
    driver.chip.short(SHORT, shorted=True)
    driver.feed(pins(until=SHORT + 100 * MS))
    driver.forget()
    assert driver.violation_count == 1
    assert driver.violations.rules() == []
    driver.chip.short(SHORT + 200 * MS, shorted=False)
    assert not has_current(driver, SHORT + 210 * MS)
    enabled(driver, SHORT + 230 * MS, 0)
    enabled(driver, SHORT + 240 * MS, 1)
    assert has_current(driver, SHORT + 250 * MS)
