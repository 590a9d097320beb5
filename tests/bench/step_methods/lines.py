"""Make a motion whose crossings fall on whole timer counts: 1000 steps/s for 100 ms, step k at (k + 9/16) ms."""

from dataclasses import dataclass

import numpy as np

from steptwin.bench.step_methods import AxisPulses
from steptwin.bench.step_methods.motions import UNITS_PER_STEP, PlannedMotion
from steptwin.host.common.arrays import FloatArray
from steptwin.host.planning.trajectory import OutputChange
from steptwin.host.robots import load_robot

STEPS = 100
BOARD = load_robot("warehouse-scara").board


@dataclass(frozen=True, slots=True)
class Line:
    """A `Trajectory` at constant speed, except that it does not begin and end at rest."""

    joint_names: tuple[str, ...] = ("line",)
    duration_s: float = 0.1
    breakpoints_s: tuple[float, ...] = ()
    output_changes: tuple[OutputChange, ...] = ()

    def positions(self, t_s: FloatArray) -> FloatArray:
        return 1000 * t_s[:, None]

    def velocities(self, t_s: FloatArray) -> FloatArray:
        return np.full((len(t_s), 1), 1000.0)


LINE = PlannedMotion(
    "line",
    Line(),
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
