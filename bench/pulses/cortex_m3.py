"""Meter what the firmware's kernel costs a Cortex-M3 at 72 MHz: its C, executed on an emulated core.

The instructions are counted; the cycles follow from a model of the core's timings (`emulator/cortex_m3/cycles.py`). Only
the kernel is metered: the interrupt around it, CAN and the timers' work come on top. The other methods are not metered,
since nobody has written them for this core in the same way.
"""

from dataclasses import dataclass
from typing import Final

import numpy as np

from steptwin.bench.pulses.kernel import place_once
from steptwin.bench.pulses.motions import PlannedMotion
from steptwin.controller import kernel as k
from steptwin.controller.backend import Kernel
from steptwin.emulator.kernel_c.source import kernel_source
from steptwin.protocol.timer import COUNTS_PER_SECOND

TICKS_A_CALL: Final = (1, 4)
"""Ticks that a call of the kernel computes: one for every interrupt of the servo timer, or a millisecond at once."""
_WINDOW_TICKS: Final = 400
_BUSY_COUNTS: Final = COUNTS_PER_SECOND // 100
COLUMNS: Final = (
    "motion", "ticks a call", "instructions", "cycles low", "typical", "high", "mean %", "busiest 10 ms %", "worst %",
    "stack",
)  # fmt: skip
"""Instructions and cycles per axis and tick; load of the processor by the typical cycles; stack in bytes."""


@dataclass(frozen=True, slots=True)
class CoreFigures:
    """What the kernel costs on the core, in the busiest 100 ms of a motion."""

    motion: str
    ticks_a_call: int
    instructions: float
    """Per axis and tick, like the cycles."""
    cycles_low: float
    cycles_typical: float
    cycles_high: float
    mean_percent: float
    busiest_percent: float
    worst_percent: float
    stack_bytes: int
    text_bytes: int
    ram_bytes: int


def core_figures(motion: PlannedMotion, fast: Kernel) -> list[CoreFigures]:
    """Meter a motion for each number of ticks a call; return nothing if Unicorn, compiler or numba is missing."""
    try:
        from steptwin.emulator.cortex_m3.image import CompilerMissingError, kernel_image
        from steptwin.emulator.cortex_m3.meter import metered_kernel
    except ModuleNotFoundError:
        return []
    if fast.name != "numba":
        return []
    try:
        image = kernel_image()
    except CompilerMissingError:
        return []
    window = _busiest_window([axis.rise_counts for axis in place_once(fast, motion).axes])
    found = []
    for ticks_a_call in TICKS_A_CALL:
        kernel, metered = metered_kernel(image, fast, window, ticks_a_call)
        place_once(kernel, motion)
        low, typical, high = (metered.per_axis_and_tick(end) for end in range(3))
        found.append(
            CoreFigures(
                motion.name,
                ticks_a_call,
                metered.instructions_per_axis_and_tick,
                low,
                typical,
                high,
                metered.mean_percent,
                metered.busiest_percent,
                metered.worst_percent,
                metered.stack_bytes,
                image.text_bytes,
                ram_bytes(motion.axes, ticks_a_call, metered.stack_bytes),
            )
        )
    return found


def ram_bytes(axes: int, ticks_a_call: int, stack_bytes: int) -> int:
    """Return the RAM of the kernel: axes and their copy, queues, group, rows of edges at 15 kHz, and its stack."""
    size = {name: record.size for name, record in kernel_source().records.items()}
    clk_edges = 8 * ticks_a_call + 4
    direction_edges = ticks_a_call  # a tick turns an axis once at most
    rows = axes * (4 * (clk_edges + direction_edges) + 2 * 4)  # the edges, and pointers to both rows
    return axes * (2 * size["axis"] + k.QUEUE_DEPTH * size["segment"]) + size["group"] + rows + stack_bytes


def core_rows(figures: list[CoreFigures]) -> list[list[str]]:
    """Return the figures as texts, one row each, in the order of COLUMNS."""
    return [
        [
            row.motion,
            str(row.ticks_a_call),
            *(f"{value:.0f}" for value in (row.instructions, row.cycles_low, row.cycles_typical, row.cycles_high)),
            *(f"{value:.1f}" for value in (row.mean_percent, row.busiest_percent, row.worst_percent)),
            str(row.stack_bytes),
        ]
        for row in figures
    ]


def _busiest_window(rises: list[np.ndarray[tuple[int, ...], np.dtype[np.int64]]]) -> range:
    """Return 100 ms around the 10 ms in which all axes together step most, in ticks."""
    every = np.sort(np.concatenate(rises))
    within = np.searchsorted(every, every + _BUSY_COUNTS) - np.arange(len(every))
    middle = int(every[int(within.argmax())] + _BUSY_COUNTS // 2) // k.TICK_COUNTS
    first = max(middle - _WINDOW_TICKS // 2, 0)
    return range(first, first + _WINDOW_TICKS)
