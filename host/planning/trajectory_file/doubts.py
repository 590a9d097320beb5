"""Question a file that hardly moves its robot: angles are probably in radians, lengths in metres or times in ms.

Such a file breaks no limit, so it would run: a motion in radians, read in degrees, has 1/57 of its size and speed.
"""

from collections.abc import Callable
from typing import Final

import numpy as np

from steptwin.host.common.errors import InputError
from steptwin.host.planning.peaks import Quantity
from steptwin.host.planning.plan import Plan
from steptwin.host.planning.planner import plan
from steptwin.host.planning.trajectory_file.file_motion import FileMotion

SMALL_PERCENT: Final = 5.0
"""Percentage of every limit and of every joint's range below which a motion is questioned."""
_LARGER: Final = {
    "rad": "angles are then 57.3 times as large",
    "m": "lengths are then 1000 times as large",
    "rad,m": "angles are then 57.3 times, lengths 1000 times as large",
}
"""The units that may have been meant, and by which factor positions grow."""
_MS: Final = 1000.0
_ACCELERATIONS: Final = (Quantity.ACCELERATION, Quantity.AXIS_ACCELERATION)


def doubt(motion: FileMotion, planned: Plan, read_in: Callable[[str], FileMotion]) -> str | None:
    """Return what to ask about a file's units, in one line; None if a joint moves far or fast enough, or none moves.

    It names other units that fit as `units=rad,m`, as `read_trajectory` takes them.

    Args:
        motion: the motion as it was read, in its file's own time.
        planned: its plan, which may be stretched.
        read_in: reads the file again in other units, or raises InputError.
    """
    peaks = _peaks_percent(planned, planned.trajectory.duration_s / motion.trajectory.duration_s)
    largest = max(_travel_percent(planned), *peaks.values())
    if not 0.0 < largest < SMALL_PERCENT:
        return None
    units = [each for each in ("rad", "m") if _fits(motion, read_in, each)]
    if len(units) == 2 and _fits(motion, read_in, ",".join(units)):
        units = [",".join(units)]
    fitting = [f"units={each} fits, too: {_LARGER[each]}" for each in units]
    if all(_MS ** _power(quantity) * percent <= 100.0 for quantity, percent in peaks.items()):
        fitting.append("times in ms fit, too: divide them by 1000")
    return "; ".join(
        [
            f"every joint stays below {SMALL_PERCENT:g} % of its limits and of its range, at {largest:.2g} % at most."
            " Is it in s, mm and degrees?",
            *fitting,
        ]
    ).replace("?;", "?")


def _travel_percent(planned: Plan) -> float:
    """Return the largest part of its range that a joint goes through, in percent."""
    travels = np.ptp(planned.robot.to_positions(planned.points_units), axis=0)
    ranges = np.array([joint.upper - joint.lower for joint in planned.robot.joints])
    return float((100.0 * travels / ranges).max())


def _peaks_percent(planned: Plan, stretched: float) -> dict[Quantity, float]:
    """Return the peak of each quantity in percent of its limit, as it would be without the stretching of the plan."""
    quantities = dict.fromkeys(peak.quantity for peak in planned.peaks)
    return {each: stretched ** _power(each) * planned.highest(each).percent for each in quantities}


def _power(quantity: Quantity) -> int:
    """Return the power of the pace with which a quantity grows."""
    return 2 if quantity in _ACCELERATIONS else 1


def _fits(motion: FileMotion, read_in: Callable[[str], FileMotion], units: str) -> bool:
    """Return whether the file is another motion in these units, and one that the robot can make."""
    try:
        other = read_in(units)
        if np.array_equal(other.points.positions, motion.points.positions):
            return False
        plan(motion.robot, other.trajectory)
    except InputError:
        return False
    return True
