"""The driver chip TB6560AHQ, modelled by the behaviour of its pins.

Source, cited by page throughout: Toshiba "TB6560AHQ/AFG", datasheet of 2014-10-01.
"""

from steptwin.emulator.drivers.tb6560.chip import (
    CLK_RATE_MAX_HZ,
    CURRENT_MAX_A,
    PERIOD_MIN_COUNTS,
    SENSE_OHM,
    Pins,
    Tb6560,
)
from steptwin.emulator.drivers.tb6560.excitation import CYCLE_SIXTEENTHS, FULL_STEP_SIXTEENTHS, Excitation
from steptwin.emulator.drivers.tb6560.limits import Limit, LimitUnit, Rule, ViolationLog, Violations, merged
from steptwin.emulator.drivers.tb6560.oscillator import OSC_PF_MIN, chopping_hz, clk_width_min_counts, oscillator_hz
from steptwin.emulator.drivers.tb6560.output_follower import FieldTurns, OutputChanges, OutputFollower, Steady
from steptwin.emulator.drivers.tb6560.outputs import Outputs
from steptwin.emulator.drivers.tb6560.pins import EXCITATIONS, PINS, LevelChange, LevelPin
from steptwin.emulator.drivers.tb6560.thermal import Cooling

__all__ = [
    "CLK_RATE_MAX_HZ",
    "CURRENT_MAX_A",
    "CYCLE_SIXTEENTHS",
    "EXCITATIONS",
    "FULL_STEP_SIXTEENTHS",
    "OSC_PF_MIN",
    "PERIOD_MIN_COUNTS",
    "PINS",
    "SENSE_OHM",
    "Cooling",
    "Excitation",
    "FieldTurns",
    "LevelChange",
    "LevelPin",
    "Limit",
    "LimitUnit",
    "OutputChanges",
    "OutputFollower",
    "Outputs",
    "Pins",
    "Rule",
    "Steady",
    "Tb6560",
    "ViolationLog",
    "Violations",
    "chopping_hz",
    "clk_width_min_counts",
    "merged",
    "oscillator_hz",
]
