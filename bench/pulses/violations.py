"""How many of a method's pulses break a limit of the driver: the one place that knows which driver it is."""

import numpy as np

from bench.pulses.pulses import AxisPulses
from emulator.tb6560 import Pins, Tb6560
from host.robot import Board


def violations(axis: AxisPulses, board: Board) -> int:
    """Limits broken at a board's TB6560 that is out of reset from the start."""
    driver = Tb6560(board.osc_pf)
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
