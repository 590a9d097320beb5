"""Place steps by a fixed-rate digital differential analyser (DDA), as LinuxCNC's software stepgen does.

A servo thread of 1 ms interpolates the records and sets the velocity that leads to the position of the next
millisecond. A base thread adds this velocity to an accumulator in every period and makes a step when the accumulator
has passed the threshold. So an edge can only fall on the base thread's grid and comes up to one period late. A timer of
its own ends each pulse, so that every period can have a step; a change of direction costs the periods that dirsetup and
dirhold need. One thing is in the DDA's favour: it knows the position a servo period ahead, so that it does not lag.

Source: LinuxCNC, src/hal/components/stepgen.c and its manual page (position mode).
"""

from math import floor

from steptwin.host.common.arrays import Int64Array
from steptwin.host.studies.step_methods.motions import PlannedMotion
from steptwin.host.studies.step_methods.pulses import (
    THRESHOLD_Q16,
    PinTimes,
    PlacedPulses,
    PlannedAxis,
    compiled,
    place_axes,
)
from steptwin.protocol.timer import COUNTS_PER_MS, COUNTS_PER_SECOND

Q32 = 1 << 32
THRESHOLD_Q32 = THRESHOLD_Q16 << 16


def dda(base_hz: int, motion: PlannedMotion) -> PlacedPulses:
    """Place a motion with a base thread of `base_hz`, which must divide 72 MHz."""
    period_counts = COUNTS_PER_SECOND // base_hz
    pins = PinTimes.of(motion.board)

    def place(axis: PlannedAxis, rises: Int64Array, direction: Int64Array) -> tuple[int, int]:
        return _run(axis, period_counts, pins, rises, direction)

    return place_axes(place, motion)


@compiled
def hermite(p0: float, v0: float, p1: float, v1: float, duration_ms: float, t_ms: float) -> float:
    """Return the position within a record: the cubic Hermite polynomial; velocities are in steps per ms."""
    s = t_ms / duration_ms
    a, e, d = v0 * duration_ms, v1 * duration_ms, p1 - p0
    return p0 + s * (a + s * (3 * d - 2 * a - e + s * (a + e - 2 * d)))


@compiled
def _run(
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
