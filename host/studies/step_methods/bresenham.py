"""Place steps in segments of 10 ms at constant rate by Bresenham's line, as Grbl does.

At the beginning of each record the number of whole steps of every axis in it is known. The axis with the most steps,
the dominant axis, makes them evenly over the record; the others make theirs in the same interrupts, where Bresenham's
algorithm puts them. So the rate is a staircase, and a step of another axis waits for up to one dominant interval.

Source: Grbl 1.1, stepper.c (segment buffer at ACCELERATION_TICKS_PER_SECOND = 100, without AMASS).
"""

import numpy as np

from steptwin.host.common.arrays import Int64Array
from steptwin.host.studies.step_methods.motions import PlannedMotion
from steptwin.host.studies.step_methods.pulses import PlacedPulses, compiled, counter_at, place_with
from steptwin.protocol.timer import COUNTS_PER_MS


def bresenham(motion: PlannedMotion) -> PlacedPulses:
    """Place a motion with one constant rate in each of its records."""

    def place(rises: Int64Array, direction: Int64Array, made: Int64Array) -> None:
        _run(motion.times_ms, motion.points_q16, np.array(motion.start_steps), rises, direction, made)

    return place_with(place, motion)


@compiled
def _run(
    times_ms: Int64Array,
    points_q16: Int64Array,
    counters: Int64Array,
    rises: Int64Array,
    direction: Int64Array,
    made: Int64Array,
) -> None:
    """Place all axes; write the number of steps and of DIR edges of each into `made`."""
    axes = len(counters)
    made[:] = 0
    levels = np.zeros(axes, np.int64)
    steps = np.zeros(axes, np.int64)
    error = np.zeros(axes, np.int64)
    for record in range(len(times_ms) - 1):
        begin_counts = times_ms[record] * COUNTS_PER_MS
        duration_counts = times_ms[record + 1] * COUNTS_PER_MS - begin_counts
        for axis in range(axes):
            counter = counter_at(counters[axis], points_q16[axis, record + 1])
            steps[axis] = abs(counter - counters[axis])
            up = 1 if counter > counters[axis] else 0
            if steps[axis] > 0 and up != levels[axis]:
                levels[axis] = up
                direction[axis, made[axis, 1]] = 2 * begin_counts + up
                made[axis, 1] += 1
            counters[axis] = counter
        dominant = steps.max()
        error[:] = dominant // 2
        for event in range(dominant):
            at_counts = begin_counts + (2 * event + 1) * duration_counts // (2 * dominant)
            for axis in range(axes):
                error[axis] += steps[axis]
                if error[axis] >= dominant:
                    error[axis] -= dominant
                    rises[axis, made[axis, 0]] = at_counts
                    made[axis, 0] += 1
