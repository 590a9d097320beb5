"""Place steps as other controllers do: by Bresenham's line, by a fixed-rate DDA, by Austin's integer ramp."""

from math import floor, sqrt
from typing import NamedTuple

import numpy as np

from steptwin.bench.step_methods import (
    THRESHOLD_Q16,
    PinTimes,
    PlacedPulses,
    PlannedAxis,
    compiled,
    counter_at,
    place_axes,
    place_with,
)
from steptwin.bench.step_methods.motions import PlannedMotion
from steptwin.host.common.arrays import Int64Array
from steptwin.protocol.timer import COUNTS_PER_MS, COUNTS_PER_SECOND

Q32 = 1 << 32
THRESHOLD_Q32 = THRESHOLD_Q16 << 16
CONSTANT_FROM_STEPS = 1 << 30
"""Distance from standstill, in steps, beyond which an interval no longer changes."""

LAST_DIVISOR = -3
"""4 n + 1 for the last interval before standstill, n = -1."""


def bresenham(motion: PlannedMotion) -> PlacedPulses:
    """Place steps in segments of 10 ms at constant rate by Bresenham's line, as Grbl does.

    At the beginning of each record the number of whole steps of every axis in it is known. The axis with the most
    steps, the dominant axis, makes them evenly over the record; the others make theirs in the same interrupts, where
    Bresenham's algorithm puts them. So the rate is a staircase, and a step of another axis waits for up to one dominant
    interval.

    Source: Grbl 1.1, stepper.c (segment buffer at ACCELERATION_TICKS_PER_SECOND = 100, without AMASS).
    """

    def place(rises: Int64Array, direction: Int64Array, made: Int64Array) -> None:
        _draw_lines(motion.times_ms, motion.points_q16, np.array(motion.start_steps), rises, direction, made)

    return place_with(place, motion)


@compiled
def _draw_lines(
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


def dda(base_hz: int, motion: PlannedMotion) -> PlacedPulses:
    """Place steps by a fixed-rate digital differential analyser (DDA), as LinuxCNC's software stepgen does.

    A servo thread of 1 ms interpolates the records and sets the velocity that leads to the position of the next
    millisecond. A base thread adds this velocity to an accumulator in every period and makes a step when the
    accumulator has passed the threshold. So an edge can only fall on the base thread's grid and comes up to one period
    late. A timer of its own ends each pulse, so that every period can have a step; a change of direction costs the
    periods that dirsetup and dirhold need. One thing is in the DDA's favour: it knows the position a servo period
    ahead, so that it does not lag. The base thread runs at `base_hz`, which must divide 72 MHz.

    Source: LinuxCNC, src/hal/components/stepgen.c and its manual page (position mode).
    """
    period_counts = COUNTS_PER_SECOND // base_hz
    pins = PinTimes.of(motion.board)

    def place(axis: PlannedAxis, rises: Int64Array, direction: Int64Array) -> tuple[int, int]:
        return _run_base_thread(axis, period_counts, pins, rises, direction)

    return place_axes(place, motion)


@compiled
def hermite(p0: float, v0: float, p1: float, v1: float, duration_ms: float, t_ms: float) -> float:
    """Return the position within a record: the cubic Hermite polynomial; velocities are in steps per ms."""
    s = t_ms / duration_ms
    a, e, d = v0 * duration_ms, v1 * duration_ms, p1 - p0
    return p0 + s * (a + s * (3 * d - 2 * a - e + s * (a + e - 2 * d)))


@compiled
def _run_base_thread(
    axis: PlannedAxis, period_counts: int, pins: PinTimes, rises: Int64Array, direction: Int64Array
) -> tuple[int, int]:
    """Place one axis; return its number of steps and of DIR edges."""
    times_ms, counter = axis.times_ms, axis.start_steps
    positions, velocities = axis.points_q16 / 65_536, axis.velocities_hz / 1000
    steps = turns = level = 0
    periods = COUNTS_PER_MS // period_counts
    accumulator = floor(positions[0] * Q32)
    ready_counts = hold_counts = counts = 0
    last_ms = int(times_ms[-1])
    record = ms = 0
    while ms < last_ms or abs(accumulator - counter * Q32) >= THRESHOLD_Q32:
        if ms < last_ms:
            if ms == times_ms[record + 1]:
                record += 1
            begin_ms = times_ms[record]
            target = hermite(
                positions[record], velocities[record], positions[record + 1], velocities[record + 1],
                times_ms[record + 1] - begin_ms, ms + 1 - begin_ms,
            )  # fmt: skip
            velocity = (floor(target * Q32) - accumulator) // periods
        else:
            velocity = 0
        ms += 1
        for _ in range(periods):
            away = accumulator - counter * Q32
            if abs(away) >= THRESHOLD_Q32:
                up = 1 if away > 0 else 0
                if up != level and counts >= hold_counts:
                    level = up
                    direction[turns] = 2 * counts + up
                    turns += 1
                    ready_counts = counts + pins.dirsetup
                if up == level and counts >= ready_counts:
                    rises[steps] = counts
                    steps += 1
                    counter += 2 * up - 1
                    hold_counts = counts + pins.dirhold
            accumulator += velocity
            counts += period_counts
    return steps, turns


def austin(motion: PlannedMotion) -> PlacedPulses:
    """Place steps by Austin's integer ramp, as in Atmel's AVR446: each interval is c -= 2 c / (4 n + 1) from the last.

    Each record is a ramp of constant acceleration between its two velocities; a record with a reversal is two ramps. A
    ramp begins with its first step solved exactly and makes the number of steps that the step rule gives it. The
    recurrence then needs one division a step and keeps the remainder, as AVR446 does. Two things are better than in the
    original: n is rounded to quarters of a step, which keeps 4 n + 1 whole, and the timer runs at 72 MHz. Each ramp
    begins on time, so that errors do not add up from record to record and axes stay together; steps that are left at a
    ramp's end are made there.

    Source: D. Austin, "Generate stepper-motor speed profiles in real time", Embedded Systems Programming, January 2005;
    Atmel application note AVR446, "Linear speed control of stepper motor", 2006.
    """
    pins = PinTimes.of(motion.board)

    def place(axis: PlannedAxis, rises: Int64Array, direction: Int64Array) -> tuple[int, int]:
        return _run_ramps(axis, pins, rises, direction)

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
def _run_ramps(axis: PlannedAxis, pins: PinTimes, rises: Int64Array, direction: Int64Array) -> tuple[int, int]:
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
