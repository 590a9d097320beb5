"""Meter what the firmware's kernel costs a Cortex-M3 at 72 MHz: its C, executed on an emulated core.

The instructions are counted; the cycles follow from a model of the core's timings (`features/kernel_c/meter.py`), for
code that need not wait for the flash. Only the kernel is metered: the interrupt around it, CAN and the timers' work
come on top. The other methods have no version for this core, so they are not metered.
"""

from bisect import bisect_right
from dataclasses import dataclass
from typing import TYPE_CHECKING, Final

import numpy as np

from steptwin.bench.step_methods.kernel import POINTS_AHEAD, place_once
from steptwin.bench.step_methods.motions import PlannedMotion
from steptwin.controller.motion import kernel as k
from steptwin.controller.motion.backend import Kernel
from steptwin.features.kernel_c.layout import Layout
from steptwin.host.common.arrays import Int64Array
from steptwin.protocol.timer import COUNTS_PER_SECOND

if TYPE_CHECKING:
    from steptwin.features.kernel_c.meter import Metered

LOADS: Final = ((1, False), (4, False), (1, True))
"""Ticks that a call of the kernel computes, one for every interrupt of the servo timer or a millisecond at once; and
whether the axes halt and resume meanwhile, in ramps of 50 ms."""
_WINDOW_TICKS: Final = 400
_BUSY_COUNTS: Final = COUNTS_PER_SECOND // 100
COLUMNS: Final = (
    "motion", "ticks a call", "instructions", "cycles low", "typical", "high", "waits", "mean %", "busiest 10 ms %",
    "worst %", "RAM", "stack",
)  # fmt: skip
"""Instructions, cycles and waits for the flash per axis and tick; load of the processor by the typical cycles without
waits; RAM with the stack, and the stack alone, in bytes."""


@dataclass(frozen=True, slots=True)
class CoreFigures:
    """What the kernel costs on the core, in the busiest 100 ms of a motion."""

    motion: str
    ticks_a_call: int
    halting: bool
    instructions: float
    """Per axis and tick, like the cycles."""
    cycles_low: float
    cycles_typical: float
    cycles_high: float
    flash_waits: float
    """What the flash of an STM32F103 adds, in cycles per axis and tick."""
    mean_percent: float
    busiest_percent: float
    worst_percent: float
    stack_bytes: int
    text_bytes: int
    ram_bytes: int


def core_figures(motion: PlannedMotion, fast: Kernel) -> list[CoreFigures]:
    """Meter a motion in each of LOADS; return nothing if Unicorn, compiler or numba is missing."""
    try:
        from steptwin.features.kernel_c.image import CompilerMissingError, kernel_image
        from steptwin.features.kernel_c.meter import Storage, meter, stopping_at
    except ModuleNotFoundError:
        return []
    if fast.name != "numba":
        return []
    try:
        image = kernel_image()
    except CompilerMissingError:
        return []
    window = _busiest_window(motion, [axis.rise_counts for axis in place_once(fast, motion).axes])
    starts: list[Storage] = []
    place_once(stopping_at(fast, window.start, starts.append), motion)
    found = []
    for ticks_a_call, halting in LOADS:
        metered = meter(image, starts[0], window, ticks_a_call, halting=halting)
        found.append(_figures(motion, metered, ticks_a_call, len(image.code), halting=halting))
    return found


def _figures(
    motion: PlannedMotion, metered: "Metered", ticks_a_call: int, text_bytes: int, *, halting: bool
) -> CoreFigures:
    """Return means per axis and tick, and the load of a processor of 72 MHz by the typical cycles."""
    cycles = np.array(metered.calls)
    ticks = len(cycles) * ticks_a_call
    low, typical, high = (cycles.sum(axis=0) / (ticks * motion.axes)).tolist()
    percent = 100 * cycles[:, 1] / (ticks_a_call * k.TICK_COUNTS)
    calls_in_10_ms = min(10 * k.TICKS_PER_MS // ticks_a_call, len(cycles))
    return CoreFigures(
        motion=motion.name,
        ticks_a_call=ticks_a_call,
        halting=halting,
        instructions=metered.instructions / (ticks * motion.axes),
        cycles_low=low,
        cycles_typical=typical,
        cycles_high=high,
        flash_waits=metered.flash_waits / (ticks * motion.axes),
        mean_percent=float(percent.mean()),
        busiest_percent=float(np.convolve(percent, np.ones(calls_in_10_ms) / calls_in_10_ms, "valid").max()),
        worst_percent=float(percent.max()),
        stack_bytes=metered.stack_bytes,
        text_bytes=text_bytes,
        ram_bytes=ram_bytes(motion.axes, ticks_a_call, metered.stack_bytes),
    )


def ram_bytes(axes: int, ticks_a_call: int, stack_bytes: int) -> int:
    """Return the RAM of the kernel: axes and their copy, queues, group, rows of edges at 15 kHz, and its stack."""
    clk_edges = 8 * ticks_a_call + 4
    direction_edges = ticks_a_call  # a tick turns an axis once at most
    rows = axes * (4 * (clk_edges + direction_edges) + 2 * 4)  # the edges, and pointers to both rows
    axis, segment, group = (Layout(name).size for name in ("axis", "segment", "group"))
    return axes * (2 * axis + k.QUEUE_DEPTH * segment) + group + rows + stack_bytes


def core_rows(figures: list[CoreFigures]) -> list[list[str]]:
    """Return the figures as texts, one row each, in the order of COLUMNS."""
    return [
        [
            f"{row.motion}, halting" if row.halting else row.motion,
            str(row.ticks_a_call),
            *(
                f"{value:.0f}"
                for value in (row.instructions, row.cycles_low, row.cycles_typical, row.cycles_high, row.flash_waits)
            ),
            *(f"{value:.1f}" for value in (row.mean_percent, row.busiest_percent, row.worst_percent)),
            str(row.ram_bytes),
            str(row.stack_bytes),
        ]
        for row in figures
    ]


def _busiest_window(motion: PlannedMotion, rises: list[Int64Array]) -> range:
    """Return 100 ms around the 10 ms when all axes together step most, in ticks.

    They are moved to lie between two instants when records are queued, so that all of them are queued at once.
    """
    every = np.sort(np.concatenate(rises))
    within = np.searchsorted(every, every + _BUSY_COUNTS) - np.arange(len(every))
    middle = int(every[int(within.argmax())] + _BUSY_COUNTS // 2) // k.TICK_COUNTS
    feeds = [*(motion.times_ms[:-1:POINTS_AHEAD] * k.TICKS_PER_MS).tolist(), int(motion.times_ms[-1]) * k.TICKS_PER_MS]
    batch = bisect_right(feeds, min(middle, feeds[-1] - 1))
    last = min(max(middle + _WINDOW_TICKS // 2, feeds[batch - 1] + _WINDOW_TICKS), feeds[batch] - 1)
    return range(max(last - _WINDOW_TICKS, feeds[batch - 1]), last)
