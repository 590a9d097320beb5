"""Stretches of edges at a driver's pins, made by hand."""

from collections.abc import Iterable, Sequence

import numpy as np

from steptwin.controller.node.pins import Pin
from steptwin.emulator.drivers.driver_chip import LevelChange, Rail, TerminalEdges
from steptwin.emulator.drivers.driver_module import Module
from steptwin.emulator.drivers.tb6560.chip import Tb6560Kind
from steptwin.emulator.drivers.tb6560.pins import TERMINALS

WIDTH = 2160
"""30 us."""
PERIOD = 4800
"""1 / 15 kHz."""
FOREVER = 10**12

CHIP = Tb6560Kind(330)
WIRES = Module(CHIP)
"""A chip on the board itself."""
_BY_NAME = {terminal.name: terminal for terminal in TERMINALS}

POWER_UP = tuple(LevelChange(0, pin, 1) for pin in (Rail.VDD, Rail.VM, Pin.RESET, Pin.ENABLE))
"""The power-up sequence of the datasheet."""


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
    return tuple(LevelChange(counts, _BY_NAME[name], level) for name, level in levels.items())


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
