"""How long a machine took to stand after a fault had begun, and how long it may take."""

from math import ceil

import numpy as np

from steptwin.host.robots.robot import Robot
from steptwin.host.twin.scenarios.harms import Harm
from steptwin.host.twin.scenarios.moment import Moment
from steptwin.host.twin.scenarios.reaction import Motion, Reaction
from steptwin.host.twin.scenarios.reaction_times import HOST_NOTICES_MS, TICK_MS
from steptwin.host.twin.scenarios.reactions import concerned
from steptwin.host.verify import Evidence
from steptwin.protocol.timer import COUNTS_PER_MS


def standstill_ms(evidence: Evidence, began_counts: int) -> float:
    """Return the time from an instant to the last step of any axis; 0 if there was none after it."""
    lasts = [int(axis.step_counts[-1]) for axis in evidence.axes if axis.step_counts.size]
    return max(max(lasts, default=began_counts) - began_counts, 0) / COUNTS_PER_MS


def standstill_limit_ms(robot: Robot, harm: Harm, reaction: Reaction, began: Moment) -> float:
    """Return the longest time from a harm's beginning to the last step.

    Axes that stop with one whose pulses end at once do so by a ramp as well. A ramp that begins at once is that from
    the present speeds, which may rise for a tick. Axes on other boards are stopped by the host.
    """
    axes = concerned(harm, began.boards)
    if reaction.motion is Motion.CUT and len(axes) == len(began.axes):
        return reaction.begins_ms
    if reaction.begins_ms <= TICK_MS and began.several_boards and len(axes) < len(began.axes):
        return HOST_NOTICES_MS + longest_ramp_ms(robot)
    if reaction.begins_ms <= TICK_MS:
        return reaction.begins_ms + min(_ramp_ms(began) + TICK_MS, longest_ramp_ms(robot))
    return reaction.begins_ms + longest_ramp_ms(robot)


def _ramp_ms(moment: Moment) -> float:
    """Return how long the axes take to stop from their present speeds; the firmware rounds up to 1 ms."""
    velocities = (abs(axis.velocity) * 1_000_000 / (64 * axis.deceleration) for axis in moment.axes)
    return float(max(ceil(max(velocities)), 1))


def longest_ramp_ms(robot: Robot) -> float:
    """Return how long the axes of a robot take to stop from their highest speeds; the firmware rounds up to 1 ms."""
    return float(ceil(1000 * float(np.max(robot.axis_speeds_max / robot.axis_accelerations_max))))
