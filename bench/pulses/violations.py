"""How many of a method's pulses break a limit of the driver: the one place that knows which driver it is."""

import numpy as np

from bench.pulses.pulses import AxisPulses
from emulator.tb6560 import Pins, Tb6560

OSC_PF = 330.0
"""As on the robots' boards: CLK high for at least 30 us."""


def violations(axis: AxisPulses) -> int:
    """Limits broken at a TB6560 that is out of reset from the start."""
    driver = Tb6560(OSC_PF)
    driver.feed(
        Pins(
            axis.rise_counts,
            axis.fall_counts,
            axis.dir_counts,
            axis.dir_levels,
            np.array([-1], np.int64),
            np.array([1], np.int8),
        )
    )
    return driver.violation_count
