"""Each chip's home output is active in one state of an electrical cycle, at its home angle, in every microstep mode."""

import numpy as np
import pytest

from steptwin.emulator.board.edges import Int64Array
from steptwin.emulator.drivers.driver import Driver
from steptwin.emulator.drivers.driver_module import fitted
from steptwin.emulator.drivers.terminals import LevelChange
from steptwin.protocol.drivers import PROFILES
from tests.emulator.pins import WIDTH, pins
from tests.messages import refusing

UP, SETTLED, PERIOD = 100, 72_000_000, 3 * WIDTH
HOMES = {
    "3a-module": (0.0, 315.0, "MO", 0),
    "drv8825": (45.0, 45.0, "nHOME", 0),
    "tmc2209": (90.0, 135.0, "INDEX", 1),
    "tmc5160": (90.0, 135.0, "DIAG1", 1),
}
"""Home angle in microstep modes and in full steps, and the pin with its level there."""
MODES = [(name, mode) for name in HOMES for mode in PROFILES[name].chip.microsteps]


def turned(name: str, mode: int, steps: int, dir_level: int) -> tuple[Driver, Int64Array]:
    """Return a driver after so many steps from power-up, and an instant before the first and after each."""
    driver = Driver(fitted(PROFILES[name], mode))
    driver.feed(pins(changes=[LevelChange(UP, pin, 1) for pin in ("VDD", "VM", "ENABLE")], until=SETTLED - PERIOD))
    rises = SETTLED + PERIOD * np.arange(steps)
    driver.feed(pins(rises.tolist(), directions=[(SETTLED - PERIOD // 2, 1)] if dir_level else []))
    driver.feed(pins(until=10**13))
    return driver, np.append(SETTLED - PERIOD, rises + PERIOD // 2)


@pytest.mark.parametrize(("name", "mode"), MODES)
@pytest.mark.parametrize("dir_level", [0, 1])
def test_once_a_cycle_of_four_full_steps(name: str, mode: int, dir_level: int) -> None:
    home_deg, full_deg, pin, level = HOMES[name]
    output = PROFILES[name].chip.home_output
    assert output is not None
    assert tuple(output.value) == (pin, level)
    cycle = 4 * mode
    driver, instants = turned(name, mode, 2 * cycle + 1, dir_level)
    assert driver.steps[0].size == 2 * cycle + 1
    active = driver.chip.outputs.home_levels(instants) == level
    assert np.flatnonzero(active).tolist() == [0, cycle, 2 * cycle]
    angles = driver.chip.outputs.angle_deg(instants)
    assert set(angles[active].tolist()) == {full_deg if mode == 1 else home_deg}


@pytest.mark.parametrize("name", ["a4988", "a3967", "dm542", "dm542t", "tb6600"])
def test_others_have_none(name: str) -> None:
    driver, instants = turned(name, 8, 4, 0)
    with refusing(ValueError):
        driver.chip.outputs.home_levels(instants)


def test_trinamics_index_is_where_phase_a_crosses_zero_and_b_is_at_its_peak() -> None:
    """TMC2226 datasheet Rev. 1.06, section 13.4."""
    driver, instants = turned("tmc2209", 16, 64, 0)
    outputs = driver.chip.outputs
    at_index = instants[outputs.home_levels(instants) == 1]
    a, b = outputs.currents_a(at_index).T
    assert np.abs(a).max() < 1e-9
    assert b == pytest.approx(driver.module.full_a)
