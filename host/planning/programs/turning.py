"""Turn the tool on the spot: the law by which it turns as fast as a pace of the joints allows."""

from dataclasses import replace

import numpy as np

from steptwin.host.common.arrays import FloatArray
from steptwin.host.planning.laws import Law, SCurve
from steptwin.host.planning.motions.composer import JERK_TIME_S
from steptwin.host.planning.motions.joint_move import limits_along
from steptwin.host.planning.motions.tool_move import ToolMove
from steptwin.host.planning.paths import Turn
from steptwin.host.planning.peaks import speed_peaks
from steptwin.host.planning.samples import Samples
from steptwin.host.robots.robot import Robot


def turning_law(robot: Robot, turn: Turn, branch: str, start: FloatArray, goal: FloatArray, percent: float) -> Law:
    """Return the jerk-limited law of the angle, within a percentage of the joints' limits of speed and acceleration.

    The joints do not turn in proportion to the angle. So the law for their way as a whole, from `start` to `goal`, is
    tried, and stretched by as much as the peaks are beyond the percentage.
    """
    whole = limits_along(robot, goal - start)
    speed, acceleration = (turn.length_mm * limit * percent / 100 for limit in whole)

    def law(stretch: float) -> SCurve:
        slower = acceleration / stretch**2
        return SCurve.fastest(turn.length_mm, speed / stretch, slower, slower / (stretch * JERK_TIME_S))

    tried = ToolMove.along(robot, turn, law(1.0), branch, start)
    peaks = speed_peaks(robot, Samples.of(tried, np.array([round(1000 * tried.duration_s)])))
    return law(max(replace(peak, limit=peak.limit * percent / 100).stretch for peak in peaks))
