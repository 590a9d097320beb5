"""What each method would cost the board's Cortex-M3 at 72 MHz: an estimate from counted work, not a measurement.

Interrupt entry and exit take 12 cycles each (ARM, Cortex-M3 Technical Reference Manual), SMULL 3 to 5, a division of
32 bits 2 to 12; there is no division of 64 bits and no floating-point unit, so that these are library calls.
"""

from dataclasses import dataclass
from typing import Final

import numpy as np

from steptwin.bench.loads import Int64Array
from steptwin.bench.pulses.motions import PlannedMotion
from steptwin.controller.motion import TICKS_PER_SECOND
from steptwin.protocol.timer import COUNTS_PER_SECOND

CYCLES_PER_SECOND: Final = 72_000_000
WINDOW_COUNTS: Final = COUNTS_PER_SECOND // 100
"""Loads are those of the busiest 10 ms: a mean over a whole motion would hide where it does not fit."""

_INTERRUPT: Final = 24
_COMPARE_EVENT: Final = 88
"""A timer event that toggles one pin: Klipper's benchmark takes 264 cycles for a step of each of three steppers."""
_SOFT_FLOAT: Final = 60
"""One operation in floating point of 32 bits, done in software."""


@dataclass(frozen=True, slots=True)
class Cycles:
    """Cycles of the events that a method consists of, with how often its timer interrupts."""

    timer_hz: int
    per_interrupt: int
    """Of that timer."""
    per_axis_and_interrupt: int
    per_step: int
    per_common_step: int
    """For each step of the axis with the most of them, in whose interrupt all axes are looked at ..."""
    per_axis_and_common_step: int
    """... and for each axis then."""
    per_record: int
    """For each axis, 100 times a second."""


def _dda(base_hz: int) -> Cycles:
    """Per axis and period: load, add and store an accumulator of 64 bits, compare, branch. Per step: set a pin, arm
    the timer that clears it, its interrupt. A record is interpolated ten times, ten operations each."""
    return Cycles(base_hz, _INTERRUPT, 20, 20 + _COMPARE_EVENT, 0, 0, 10 * 10 * _SOFT_FLOAT)


CYCLES: Final = {
    # Per axis and tick: three SMULL with rounding, one division of 64 by 32 bits, the rest comparisons and stores, some
    # 200 instructions at 1.3 cycles. Per step: a compare match each for the rise and the fall.
    "kernel": Cycles(TICKS_PER_SECOND, _INTERRUPT, 260, 2 * _COMPARE_EVENT, 0, 0, 300),
    "dda-20k": _dda(20_000),
    "dda-40k": _dda(40_000),
    "dda-100k": _dda(100_000),
    # One interrupt for all axes and one that ends their pulses; per axis an addition and a comparison. A record: two
    # divisions.
    "bresenham": Cycles(0, 0, 0, 10, _INTERRUPT + 40 + _COMPARE_EVENT, 20, 100),
    # A timer event with the recurrence's division, and the pulse's end. A record: two roots, five divisions and
    # as many products in floating point.
    "austin": Cycles(0, 0, 0, _COMPARE_EVENT + 35 + _COMPARE_EVENT, 0, 0, 20 * _SOFT_FLOAT),
}
"""By the methods' keys."""


def load_percent(cycles: Cycles, motion: PlannedMotion, rises: list[Int64Array]) -> float:
    """The part of the processor's time that the busiest 10 ms of a motion need."""
    end_counts = max([int(axis[-1]) for axis in rises if axis.size], default=0)
    windows = np.arange(0, end_counts + 2 * WINDOW_COUNTS, WINDOW_COUNTS)
    per_axis = np.array([np.histogram(axis, windows)[0] for axis in rises])
    steps, common = per_axis.sum(axis=0), per_axis.max(axis=0)
    stepping = steps * cycles.per_step + common * (
        cycles.per_common_step + motion.axes * cycles.per_axis_and_common_step
    )
    ticking = cycles.timer_hz / 100 * (cycles.per_interrupt + motion.axes * cycles.per_axis_and_interrupt)
    busiest = stepping.max() + ticking + motion.axes * cycles.per_record
    return float(busiest * 100 / CYCLES_PER_SECOND * 100)
