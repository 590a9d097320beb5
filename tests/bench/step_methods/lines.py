"""Make a motion whose crossings fall on whole timer counts: 1000 steps/s for 100 ms, step k at (k + 9/16) ms."""

import numpy as np

from steptwin.bench.step_methods import AxisPulses
from steptwin.bench.step_methods.motions import UNITS_PER_STEP, PlannedMotion
from steptwin.host.planning.motion import JointFunctions, Motion
from steptwin.host.robots import load_robot

STEPS = 100
BOARD = load_robot("warehouse-scara").board


CONSTANT_SPEED = JointFunctions(lambda t_s: 1000 * t_s[:, None], lambda t_s: np.full((len(t_s), 1), 1000.0))

LINE = PlannedMotion(
    "line",
    Motion(("line",), 0.1, CONSTANT_SPEED),  # it does not begin and end at rest
    np.ones(1),
    np.array([16]),
    np.array([0, 100]),
    np.array([[0, STEPS * UNITS_PER_STEP]]),
    np.full((1, 2), 64 * UNITS_PER_STEP),
    BOARD,
)
EXACT_COUNTS = 72_000 * np.arange(STEPS) + 40_500


def upward(rise_counts: np.ndarray[tuple[int], np.dtype[np.int64]]) -> AxisPulses:
    """Make steps up at these counts."""
    return AxisPulses(rise_counts, rise_counts + 2376, np.array([0]), np.array([1], np.int8))
