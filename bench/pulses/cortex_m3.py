"""Estimate what each method would cost the board's Cortex-M3 at 72 MHz, from counted work; it is not measured.

Interrupt entry and exit take 12 cycles each (ARM, Cortex-M3 Technical Reference Manual), SMULL 3 to 5, a 32-bit
division 2 to 12. The processor has neither a 64-bit division nor a floating-point unit, so that both are library calls.
"""

from dataclasses import dataclass
from typing import Final

import numpy as np

from steptwin.bench.pulses.motions import PlannedMotion
from steptwin.controller.motion import TICKS_PER_SECOND
from steptwin.host.common.arrays import Int64Array
from steptwin.protocol.timer import COUNTS_PER_SECOND

CYCLES_PER_SECOND: Final = 72_000_000
WINDOW_COUNTS: Final = COUNTS_PER_SECOND // 100
"""Length of the window whose load counts, 10 ms: a mean over a whole motion would hide an overload."""

_INTERRUPT: Final = 24
_COMPARE_EVENT: Final = 88
"""Cycles of a timer event that toggles one pin: Klipper's benchmark steps three steppers in 264 cycles."""
_SOFT_FLOAT: Final = 60
"""Cycles of one 32-bit floating-point operation in software."""


@dataclass(frozen=True, slots=True)
class Cycles:
    """Cycles of each event of a method, and the frequency of its timer interrupt."""

    timer_hz: int
    per_interrupt: int
    """Cycles of one interrupt of that timer, without the axes."""
    per_axis_and_interrupt: int
    per_step: int
    per_common_step: int
    """Cycles for each step of the axis that steps most, in whose interrupt every axis is examined."""
    per_axis_and_common_step: int
    """Cycles for each axis in that interrupt."""
    per_record: int
    """Cycles for each axis, 100 times a second."""


def _dda(base_hz: int) -> Cycles:
    """Count the work of a DDA.

    Per axis and period: load, add and store a 64-bit accumulator, compare, branch. Per step: set a pin, arm the timer
    that clears it, take its interrupt. A record is interpolated ten times with ten operations each.
    """
    return Cycles(base_hz, _INTERRUPT, 20, 20 + _COMPARE_EVENT, 0, 0, 10 * 10 * _SOFT_FLOAT)


CYCLES: Final = {
    # Per axis and tick: three SMULL with rounding, one division of 64 by 32 bits, comparisons and stores; about 200
    # instructions of 1.3 cycles. Per step: one compare match for the rise and one for the fall.
    "kernel": Cycles(TICKS_PER_SECOND, _INTERRUPT, 260, 2 * _COMPARE_EVENT, 0, 0, 300),
    "dda-20k": _dda(20_000),
    "dda-40k": _dda(40_000),
    "dda-100k": _dda(100_000),
    # One interrupt for all axes and one that ends their pulses; per axis an addition and a comparison. Per record: two
    # divisions.
    "bresenham": Cycles(0, 0, 0, 10, _INTERRUPT + 40 + _COMPARE_EVENT, 20, 100),
    # Per step: a timer event with the recurrence's division, and one that ends the pulse. Per record: two roots, five
    # divisions and five products in floating point.
    "austin": Cycles(0, 0, 0, _COMPARE_EVENT + 35 + _COMPARE_EVENT, 0, 0, 20 * _SOFT_FLOAT),
}
"""The cost of each method, by its key."""


def load_percent(cycles: Cycles, motion: PlannedMotion, rises: list[Int64Array]) -> float:
    """Return the processor load in the busiest 10 ms of a motion."""
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
