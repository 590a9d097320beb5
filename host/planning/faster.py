"""How much faster than planned a motion may be executed: by its peaks beside their limits, and by the bus."""

from math import floor, sqrt
from typing import Final, NamedTuple

from steptwin.host.planning.peaks import Peak, Quantity
from steptwin.host.planning.plan import Plan
from steptwin.protocol.od import FULL_RATE_Q16, RATE_PERCENT_MAX, rate_q16

PLANNED_PERCENT: Final = 100
BITS_OF_A_RECORD: Final = 135
"""Longest frame of eight bytes with a standard identifier and the space after it, in bits (ISO 11898-1).

That is 47 + 64, and a stuff bit for every fourth of the 34 + 64 - 1 bits after the first that may be stuffed.
"""
BUS_PART: Final = 0.8
"""Part of the bus that the records may take: the rest is for the nodes' reports and for records that are sent again."""
_ACCELERATIONS: Final = (Quantity.ACCELERATION, Quantity.AXIS_ACCELERATION)
_ROUNDING: Final = 1e-9


class HighestSpeed(NamedTuple):
    """The highest speed at which a motion may be executed, in percent of the planned one, and what allows no more."""

    percent: int
    by: str


def highest_speed(plan: Plan) -> HighestSpeed:
    """Return the highest speed of a motion, a whole percentage from 100 to 150.

    At r times the planned speed, speeds and step rates are r times as high and accelerations r^2 times. So r is at most
    the least limit / peak, for accelerations its square root. Step rates are compared in the board's integers.
    """
    found = [HighestSpeed(RATE_PERCENT_MAX, "this is the highest speed"), _by_bus(plan)]
    found += [HighestSpeed(_by_peak(peak), f"{peak.joint}: {peak.quantity}") for peak in plan.peaks]
    lowest = min(found, key=lambda each: each.percent)
    return lowest._replace(percent=max(PLANNED_PERCENT, lowest.percent))


def _by_peak(peak: Peak) -> int:
    if not peak.value:
        return RATE_PERCENT_MAX
    if peak.quantity is Quantity.STEP_RATE:
        return _by_step_rate(peak)
    ratio = peak.limit / peak.value
    factor = sqrt(ratio) if peak.quantity in _ACCELERATIONS else ratio
    return min(RATE_PERCENT_MAX, floor(100 * factor * (1 + _ROUNDING)))


def _by_step_rate(peak: Peak) -> int:
    """Return the highest percentage at which the board takes the fastest record (see `AxisMotion.push_record`)."""
    limit_q16 = round(peak.limit * FULL_RATE_Q16 / 1000)
    percent = min(RATE_PERCENT_MAX, floor(100 * peak.limit / peak.value))
    while (
        percent > PLANNED_PERCENT and peak.value > limit_q16 * FULL_RATE_Q16 // rate_q16(percent) * 1000 / FULL_RATE_Q16
    ):
        percent -= 1
    return percent


def _by_bus(plan: Plan) -> HighestSpeed:
    records = plan.points_units.shape[1] * (len(plan.times_ms) - 1)
    bits_per_s = records * BITS_OF_A_RECORD / (plan.times_ms[-1] / 1000)
    percent = floor(100 * BUS_PART * plan.robot.board.bitrate / bits_per_s)
    return HighestSpeed(min(RATE_PERCENT_MAX, percent), f"the bus of {plan.robot.board.bitrate} bit/s")
