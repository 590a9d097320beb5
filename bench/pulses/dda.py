"""A fixed-rate digital differential analyser, as LinuxCNC's software stepgen and its kin.

A servo thread of 1 ms interpolates the records and sets a velocity that leads to the position of the next millisecond;
a base thread adds it to an accumulator in every period and makes a step where the accumulator has passed the
threshold. An edge can only fall on the base thread's grid: it comes up to one period late. A pulse's end is timed by
itself, so that a step can be made in each period; a change of direction costs the periods that dirsetup and dirhold
need. More generous than the original: the position is known a servo period ahead, so that nothing lags behind.

Source: LinuxCNC, src/hal/components/stepgen.c and its manual page (position mode).
"""

from math import floor

from steptwin.bench.loads import Int64Array
from steptwin.bench.pulses.buffers import Buffers, PinTimes, place_with
from steptwin.bench.pulses.compiled import compiled
from steptwin.bench.pulses.motions import PlannedMotion
from steptwin.bench.pulses.pulses import Placed
from steptwin.bench.pulses.rule import THRESHOLD_Q16
from steptwin.host.common.arrays import FloatArray
from steptwin.protocol.timer import COUNTS_PER_SECOND

COUNTS_PER_MS = COUNTS_PER_SECOND // 1000
Q32 = 1 << 32
THRESHOLD_Q32 = THRESHOLD_Q16 << 16


def dda(base_hz: int, motion: PlannedMotion) -> Placed:
    """Place a motion with a base thread of so many Hz, a divisor of 72 MHz."""
    period_counts = COUNTS_PER_SECOND // base_hz
    positions, velocities = motion.points_q16 / 65_536, motion.velocities_hz / 1000
    pins = PinTimes.of(motion.board)

    def place(buffers: Buffers) -> None:
        for axis, start in enumerate(motion.start_steps):
            buffers.counts[axis] = _run(
                motion.times_ms, positions[axis], velocities[axis], start, period_counts, pins,
                buffers.rises[axis], buffers.direction[axis],
            )  # fmt: skip

    return place_with(place, motion)


@compiled
def hermite(p0: float, v0: float, p1: float, v1: float, duration_ms: float, t_ms: float) -> float:
    """Position within a record; velocities in steps per ms."""
    s = t_ms / duration_ms
    a, e, d = v0 * duration_ms, v1 * duration_ms, p1 - p0
    return p0 + s * (a + s * (3 * d - 2 * a - e + s * (a + e - 2 * d)))


@compiled
def _run(
    times_ms: Int64Array,
    positions: FloatArray,
    velocities: FloatArray,
    counter: int,
    period_counts: int,
    pins: PinTimes,
    rises: Int64Array,
    direction: Int64Array,
) -> tuple[int, int]:
    """One axis; returns how many steps and DIR edges there are."""
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
