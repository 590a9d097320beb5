"""Measure how many CLK edges a second a driver processes, beside a plain numpy copy of the edges."""

import time
from dataclasses import dataclass
from typing import Final

import numpy as np

from steptwin.emulator.board.edges import Int64Array
from steptwin.emulator.drivers.driver import Driver
from steptwin.emulator.drivers.driver_profiles import PROFILES
from steptwin.emulator.drivers.tb6560 import LevelChange, LevelPin, Pins

PULSES: Final = 32_768
"""Number of pulses fed at a time: as many as the board's edge buffer holds."""
REPEATS: Final = 30
_PERIOD_COUNTS: Final = 36_000
_WIDTH_COUNTS: Final = 11_000
_TURNS: Final = 200
_DRIVERS: Final = ("chip-330pf", "3a-module", "slow-blue-board")


@dataclass(frozen=True)
class DriverFigure:
    """One row of the table: the best of REPEATS stretches."""

    profile: str
    edges_per_s: float
    copy_ratio: float
    """Driver's time divided by the time of copying the edges once."""


def figures() -> list[DriverFigure]:
    """Measure each driver with pulses at 2 kHz that break no limit, with about 200 reversals in each stretch."""
    return [_measure(name) for name in _DRIVERS]


def _measure(name: str) -> DriverFigure:
    profile = PROFILES[name]
    driver = Driver(profile.osc_pf, profile.fitted(16))
    driver.feed(_stretch(0))
    best_s = copy_s = float("inf")
    for index in range(1, REPEATS + 1):
        stretch = _stretch(index)
        clk = np.ravel(np.column_stack((stretch.clk_rise_counts, stretch.clk_fall_counts)))
        copy = clk.copy()
        started = time.perf_counter()
        np.copyto(copy, clk)
        copied = time.perf_counter()
        driver.feed(stretch)
        copy_s = min(copy_s, copied - started)
        best_s = min(best_s, time.perf_counter() - copied)
    assert not driver.violations.counts.size
    return DriverFigure(name, 2 * PULSES / best_s, best_s / copy_s)


def _stretch(index: int) -> Pins:
    begin = index * (PULSES + 1) * _PERIOD_COUNTS
    rises: Int64Array = begin + np.arange(1, PULSES + 1, dtype=np.int64) * _PERIOD_COUNTS
    turns = rises[:: PULSES // _TURNS] - 2_500
    levels = (np.arange(turns.size) % 2).astype(np.int8)
    supply = (LevelPin.VDD, LevelPin.VM, LevelPin.RESET, LevelPin.ENABLE)
    changes = () if index else tuple(LevelChange(0, pin, 1) for pin in supply)
    return Pins(rises, rises + _WIDTH_COUNTS, turns, levels, changes, begin + (PULSES + 1) * _PERIOD_COUNTS)
