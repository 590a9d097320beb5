"""Place steps by Austin's integer ramp, as in Atmel's AVR446: each interval from the last one, c -= 2 c / (4 n + 1).

Each record is a ramp of constant acceleration between its two velocities; a record with a reversal is two ramps. A ramp
begins with its first step solved exactly and makes the number of steps that the step rule gives it. The recurrence then
needs one division a step and keeps the remainder, as AVR446 does. Two things are better than in the original: n is
rounded to quarters of a step, which keeps 4 n + 1 whole, and the timer runs at 72 MHz. Each ramp begins on time, so
that errors do not add up from record to record and axes stay together; steps that are left at a ramp's end are made
there.

Source: D. Austin, "Generate stepper-motor speed profiles in real time", Embedded Systems Programming, January 2005;
Atmel application note AVR446, "Linear speed control of stepper motor", 2006.
"""

from math import floor, sqrt
from typing import NamedTuple

from steptwin.host.common.arrays import Int64Array
from steptwin.host.studies.step_methods.motions import PlannedMotion
from steptwin.host.studies.step_methods.pulses import (
    THRESHOLD_Q16,
    PinTimes,
    PlacedPulses,
    PlannedAxis,
    compiled,
    counter_at,
    place_axes,
)
from steptwin.protocol.timer import COUNTS_PER_SECOND

CONSTANT_FROM_STEPS = 1 << 30
"""Distance from standstill, in steps, beyond which an interval no longer changes."""

LAST_DIVISOR = -3
"""4 n + 1 for the last interval before standstill, n = -1."""


def austin(motion: PlannedMotion) -> PlacedPulses:
    """Place a motion as ramps of constant acceleration."""
    pins = PinTimes.of(motion.board)

    def place(axis: PlannedAxis, rises: Int64Array, direction: Int64Array) -> tuple[int, int]:
        return _run(axis, pins, rises, direction)

    return place_axes(place, motion)


class AustinRamp(NamedTuple):
    """A ramp of constant acceleration: its time, and `way` steps from its begin to its first step.

    Velocity at the begin and acceleration count along the motion, in steps/s and steps/s^2.
    """

    begin_counts: int
    end_counts: int
    way: float
    velocity_hz: float
    acceleration: float


@compiled
def place_ramp(ramp: AustinRamp, rises: Int64Array, earliest_counts: int, pulse_counts: int) -> int:
    """Place a ramp's steps, one in each of `rises`; return the earliest instant of the next rise."""
    at_first_hz = sqrt(max(ramp.velocity_hz**2 + 2 * ramp.acceleration * ramp.way, 0.0))
    mean_hz = (ramp.velocity_hz + at_first_hz) / 2
    due = ramp.end_counts if mean_hz <= 0 else ramp.begin_counts + min(ramp.way / mean_hz * COUNTS_PER_SECOND, 1e15)
    due_counts = int(due)
    interval, divisor = _first_interval(at_first_hz, ramp.acceleration, ramp.end_counts - ramp.begin_counts)
    rest = 0
    for k in range(len(rises)):
        rise = max(min(due_counts, ramp.end_counts), earliest_counts)
        rises[k] = rise
        earliest_counts = rise + pulse_counts
        due_counts += interval
        if (
            divisor <= LAST_DIVISOR or divisor > 1
        ):  # between the two n passes through standstill, where the recurrence does not hold
            numerator = 2 * interval + rest
            interval -= numerator // divisor
            rest = numerator % divisor
            divisor += 4
    return earliest_counts


@compiled
def _first_interval(rate_hz: float, acceleration: float, longest_counts: int) -> tuple[int, int]:
    """Return the interval after a step at this rate, and 4 n + 1 for the interval after that; 0 at constant rate.

    The step number n counts from standstill, n = v^2 / 2a; it is negative while the motion slows down.
    """
    next_hz = sqrt(max(rate_hz**2 + 2 * acceleration, 0.0))
    mean_hz = (rate_hz + next_hz) / 2
    interval = longest_counts if mean_hz <= 0 else int(min(COUNTS_PER_SECOND / mean_hz, longest_counts))
    if acceleration == 0.0 or rate_hz**2 >= 2 * abs(acceleration) * CONSTANT_FROM_STEPS:
        return interval, 0
    return interval, floor(4 * rate_hz**2 / (2 * acceleration) + 0.5) + 5


@compiled
def _run(axis: PlannedAxis, pins: PinTimes, rises: Int64Array, direction: Int64Array) -> tuple[int, int]:
    """Place one axis; return its number of steps and of DIR edges."""
    times_ms, points_q16, velocities_hz, counter = axis
    made = turns = level = 0
    earliest = 0
    for record in range(len(times_ms) - 1):
        duration_s = (times_ms[record + 1] - times_ms[record]) / 1000
        begin_hz, end_hz = velocities_hz[record], velocities_hz[record + 1]
        acceleration = (end_hz - begin_hz) / duration_s
        begin_q16 = points_q16[record]
        begin = int(times_ms[record]) * (COUNTS_PER_SECOND // 1000)
        end = int(times_ms[record + 1]) * (COUNTS_PER_SECOND // 1000)
        turning = begin
        phases = 1
        if begin_hz * end_hz < 0:
            turning = begin + int(-begin_hz / acceleration * COUNTS_PER_SECOND)
            phases = 2
        for phase in range(phases):
            goal_q16 = points_q16[record + 1]
            until = end
            if phase < phases - 1:
                goal_q16 = begin_q16 - int(begin_hz**2 / (2 * acceleration) * 65_536)
                until = turning
            goal = counter_at(counter, goal_q16)
            if goal != counter:
                up = 1 if goal > counter else 0
                sign = 2 * up - 1
                if up != level:
                    level = up
                    edge = max(begin, earliest - pins.pulse + pins.dirhold)
                    direction[turns] = 2 * edge + up
                    turns += 1
                    earliest = max(earliest, edge + pins.dirsetup)
                way = ((counter << 16) * sign + THRESHOLD_Q16 - begin_q16 * sign) / 65_536
                steps = abs(goal - counter)
                ramp = AustinRamp(begin, until, max(way, 0.0), max(begin_hz * sign, 0.0), acceleration * sign)
                earliest = place_ramp(ramp, rises[made : made + steps], earliest, pins.pulse)
                made += steps
                counter = goal
            begin, begin_q16, begin_hz = until, goal_q16, 0.0
    return made, turns
