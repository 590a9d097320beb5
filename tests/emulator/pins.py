"""Stretches of edges at a driver's pins, made by hand."""

from collections.abc import Iterable, Sequence

import numpy as np

from steptwin.controller.node.pins import Pin
from steptwin.emulator.drivers.chip import DriverChip
from steptwin.emulator.drivers.driver_module import Module
from steptwin.emulator.drivers.terminals import LevelChange, Rail, TerminalEdges
from steptwin.protocol.drivers import PROFILES, Cooling, Fact, StepTimes
from steptwin.protocol.drivers.tb6560 import tb6560

WIDTH = 2160
"""30 us."""
PERIOD = 4800
"""1 / 15 kHz."""
FOREVER = 10**12
MODES = {(0, 0): 1, (0, 1): 2, (1, 0): 16, (1, 1): 8}
"""Microsteps of a TB6560 by the levels of M2 and M1 (page 9)."""

CHIP = tb6560(330)
TERMINALS = CHIP.terminals
WIRES = Module(CHIP)
"""A chip on the board itself."""

QUICK_WITH_16 = [
    name
    for name, profile in PROFILES.items()
    if 16 in profile.chip.microsteps and profile.chip.times.ns("enable_ns") < 1_000_000
]
"""Profiles that have 16 microsteps, and no need to wait after ENABLE."""

POWER_UP = tuple(LevelChange(0, pin, 1) for pin in (Rail.VDD, Rail.VM, Pin.RESET, Pin.ENABLE))
"""The power-up sequence of the datasheet."""


def a_tb6560(osc_pf: float = 330, full_a: float = 1.5, cooling: Cooling | None = None) -> DriverChip:
    """Return a TB6560 without supply."""
    return DriverChip(tb6560(osc_pf), full_a, cooling or Cooling())


def times(**values_ns: int) -> StepTimes:
    """Return times that somebody needs, by their names."""
    return StepTimes(**{name: Fact(value, "made for a test") for name, value in values_ns.items()})


def pins(
    rises: Sequence[int] = (),
    widths: int | Sequence[int] = WIDTH,
    directions: Sequence[tuple[int, int]] = (),
    changes: Iterable[LevelChange] = (),
    until: int = FOREVER,
) -> TerminalEdges:
    """Return a stretch from the rises of pulses and their width, DIR edges as (counts, level) and input changes."""
    rise = np.array(rises, dtype=np.int64)
    dirs = np.array(directions, dtype=np.int64).reshape(-1, 2)
    return TerminalEdges(rise, rise + np.array(widths), dirs[:, 0], dirs[:, 1].astype(np.int8), tuple(changes), until)


def at(counts: int, **levels: int) -> tuple[LevelChange, ...]:
    """Return changes of inputs, given by name, at an instant."""
    return tuple(LevelChange(counts, name, level) for name, level in levels.items())


def cut(whole: TerminalEdges, instants: Iterable[int]) -> list[TerminalEdges]:
    """Divide a stretch at these instants."""
    pieces, first = [], -FOREVER
    for until in (*sorted(instants), whole.until_counts):
        pulses = (first <= whole.clk_rise_counts) & (whole.clk_rise_counts < until)
        turns = (first <= whole.dir_counts) & (whole.dir_counts < until)
        pieces.append(
            TerminalEdges(
                whole.clk_rise_counts[pulses],
                whole.clk_fall_counts[pulses],
                whole.dir_counts[turns],
                whole.dir_levels[turns],
                tuple(change for change in whole.changes if first <= change.counts < until),
                until,
            )
        )
        first = until
    return pieces
