"""Meter the kernel on the emulated core: instructions, cycles by the model, and stack."""

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import Any, Final

import numpy as np
from unicorn import UC_HOOK_BLOCK

from steptwin.controller.motion import kernel as k
from steptwin.controller.motion.backend import Kernel
from steptwin.emulator.cortex_m3.core import STACK_TOP, Core
from steptwin.emulator.cortex_m3.core_kernel import CoreKernel
from steptwin.emulator.cortex_m3.cycles import REFILL, WAIT_STATES, Block, Disassembly, Ends
from steptwin.emulator.cortex_m3.image import Image
from steptwin.emulator.kernel_c.layout import Cells

EDGES_A_TICK: Final = 64
"""Room for the edges of one pin: 15 kHz make 8."""
_PAINT: Final = b"\xa5"
_STACK_BYTES: Final = 0x800


class ExecutionCounter:
    """Counts what a core executes, by a hook on its blocks."""

    def __init__(self, core: Core) -> None:
        self._listing = Disassembly(core.image.listing)
        self._blocks: dict[tuple[int, int], Block] = {}
        self._core = core
        self._end = 0
        self.reset()
        core.engine.hook_add(UC_HOOK_BLOCK, self._entered)

    def reset(self) -> None:
        """Begin at 0 again."""
        self.instructions = 0
        self.flash_waits = 0
        self._low = self._typical = self._high = 0
        self._end = 0

    @property
    def cycles(self) -> Ends:
        """Cycles since the last reset, with the return of the last function."""
        return self._low + REFILL[0], self._typical + REFILL[1], self._high + REFILL[2]

    def _entered(self, _engine: Any, address: int, size: int, _data: Any) -> None:
        block = self._blocks.get((address, size))
        if block is None:
            block = self._blocks[address, size] = self._listing.block(address, size)
        low, typical, high = block.cycles
        if self._end not in (0, address):  # the block before ended in a jump that was taken
            low, typical, high = low + REFILL[0], typical + REFILL[1], high + REFILL[2]
            self.flash_waits += WAIT_STATES
        self.instructions += block.instructions
        self.flash_waits += block.flash_waits
        self._low += low
        self._typical += typical
        self._high += high
        self._end = block.end

    def paint_stack(self) -> None:
        """Fill the stack with a pattern, to see later how much of it was used."""
        self._core.write(STACK_TOP - _STACK_BYTES, _PAINT * _STACK_BYTES)

    def stack_bytes(self) -> int:
        """Return the most stack used since it was painted, arguments included."""
        stack = self._core.read(STACK_TOP - _STACK_BYTES, _STACK_BYTES)
        return len(stack.lstrip(_PAINT))


@dataclass(frozen=True, slots=True, eq=False)
class Storage:
    """What the kernel works on, at the start of a tick."""

    axes: Cells
    queue: Cells
    group: Cells
    axis_count: int


@dataclass(slots=True)
class Metered:
    """What was measured of `st_advance`.

    Attributes:
        calls: the cycles of each call.
        instructions: all instructions.
        flash_waits: all cycles in which the core waits for an STM32F103's flash.
        stack_bytes: the most stack used.
    """

    calls: list[Ends] = field(default_factory=list)
    instructions: int = 0
    flash_waits: int = 0
    stack_bytes: int = 0


def stopping_at(fast: Kernel, tick: int, seen: Callable[[Storage], None]) -> Kernel:
    """Return the kernel `fast`, on int64 arrays, that ends a call at a tick and shows a copy of its storage there."""

    def advance(*arguments: Any) -> tuple[int, int]:
        axes, before, queue, group, clk, direction, axis_count, from_tick, until_tick = arguments
        if from_tick == tick:
            seen(Storage(axes.copy(), queue.copy(), group.copy(), axis_count))
        end = tick if from_tick < tick < until_tick else until_tick
        return fast.advance(axes, before, queue, group, clk, direction, axis_count, from_tick, end)

    return replace(fast, advance=advance)


def meter(image: Image, start: Storage, window: range, ticks_a_call: int, *, halting: bool) -> Metered:
    """Meter the kernel in a window of ticks, or up to the first event, beginning with this storage.

    With `halting`, all axes ramp down to a halt in the first half of the window and up to full rate in the second.
    """
    kernel = CoreKernel(image)
    counter = ExecutionCounter(kernel.core)
    counter.paint_stack()
    axes, queue, group = (cells.copy() for cells in (start.axes, start.queue, start.group))
    before = np.zeros_like(axes)
    clk, direction = (np.zeros((start.axis_count, EDGES_A_TICK * ticks_a_call), np.int64) for _ in range(2))
    metered = Metered()
    half = len(window) // 2
    ramps = {window.start: (k.FULL_RATE_Q16, 0), window.start + half: (0, k.FULL_RATE_Q16)} if halting else {}
    for tick in window[::ticks_a_call]:
        if tick in ramps:
            group[:] = (*ramps[tick], tick, half)
            axes[k.IN_GROUP :: k.AXIS_FIELDS] = 1
        for field_of_edges in (k.CLK_EDGES, k.DIR_EDGES):
            axes[field_of_edges :: k.AXIS_FIELDS] = 0
        counter.reset()
        end = tick + ticks_a_call
        reached, asking = kernel.advance(axes, before, queue, group, clk, direction, start.axis_count, tick, end)
        if reached < end:
            break
        metered.calls.append(counter.cycles)
        metered.instructions += counter.instructions
        metered.flash_waits += counter.flash_waits
        if asking:
            break
    metered.stack_bytes = counter.stack_bytes()
    return metered
