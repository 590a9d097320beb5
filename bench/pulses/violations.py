"""Count the driver limits that a method's pulses break; no other module here knows the drivers."""

from typing import Final

import numpy as np

from steptwin.bench.pulses.pulses import AxisPulses
from steptwin.emulator.driver import Driver
from steptwin.emulator.edges import NO_COUNTS, NO_LEVELS
from steptwin.emulator.tb6560 import Input, LevelChange, Pins
from steptwin.host.robots.board_settings import BoardSettings
from steptwin.host.twin.drivers import driver_profile, fitted_module
from steptwin.protocol.timer import COUNTS_PER_MS

_POWERED: Final = tuple(LevelChange(0, pin, 1) for pin in (Input.VDD, Input.VM, Input.RESET, Input.ENABLE))
_BEGIN_COUNTS: Final = COUNTS_PER_MS
"""The motion's t = 0, in counts after power-up."""
_SETTLED_COUNTS: Final = 1000 * COUNTS_PER_MS
"""Time after the last pulse, longer than any delay within a driver."""


def violations(axis: AxisPulses, microsteps: int, board: BoardSettings) -> int:
    """Feed the pulses to a driver of the board's profile; return the number of broken limits."""
    profile = driver_profile(board)
    driver = Driver(profile.osc_pf, fitted_module(board, profile, microsteps))
    driver.feed(Pins(NO_COUNTS, NO_COUNTS, NO_COUNTS, NO_LEVELS, _POWERED, _BEGIN_COUNTS))
    rises, falls, turns = (counts + _BEGIN_COUNTS for counts in (axis.rise_counts, axis.fall_counts, axis.dir_counts))
    until_counts = int(np.max(falls, initial=_BEGIN_COUNTS)) + _SETTLED_COUNTS
    driver.feed(Pins(rises, falls, turns, axis.dir_levels, (), until_counts))
    return driver.violation_count
