"""Meter the kernel on the emulated core: instructions, cycles by the model, and stack."""

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import Any, Final

from unicorn import UC_HOOK_BLOCK

from steptwin.controller import kernel as k
from steptwin.controller.backend import Kernel
from steptwin.emulator.cortex_m3.core import STACK_TOP, Core
from steptwin.emulator.cortex_m3.cycles import REFILL, Block, Ends, Listing
from steptwin.emulator.cortex_m3.image import Image
from steptwin.emulator.cortex_m3.kernel import CoreKernel

_PAINT: Final = b"\xa5"
_STACK_BYTES: Final = 0x800


class Counter:
    """Counts what a core executes, by a hook on its blocks."""

    def __init__(self, core: Core) -> None:
        self._listing = Listing(core.image.listing)
        self._blocks: dict[tuple[int, int], Block] = {}
        self._core = core
        self._end = 0
        self.reset()
        core.engine.hook_add(UC_HOOK_BLOCK, self._entered)

    def reset(self) -> None:
        """Begin at 0 again."""
        self.instructions = 0
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
        self.instructions += block.instructions
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


@dataclass(slots=True)
class Metered:
    """What was measured of `st_advance` in a window of ticks."""

    axes: int = 0
    ticks_a_call: int = 1
    instructions: int = 0
    calls: list[Ends] = field(default_factory=list)
    """Cycles of each call."""
    stack_bytes: int = 0

    @property
    def ticks(self) -> int:
        """Number of ticks metered."""
        return len(self.calls) * self.ticks_a_call

    def per_axis_and_tick(self, end: int = 1) -> float:
        """Return the mean cycles; `end` is 0 for the model's low end, 1 for typical, 2 for high."""
        return sum(call[end] for call in self.calls) / (self.ticks * self.axes)

    @property
    def instructions_per_axis_and_tick(self) -> float:
        """Mean number of instructions."""
        return self.instructions / (self.ticks * self.axes)

    @property
    def mean_percent(self) -> float:
        """Typical load of a processor of 72 MHz over the window."""
        return 100 * sum(call[1] for call in self.calls) / (self.ticks * k.TICK_COUNTS)

    @property
    def busiest_percent(self) -> float:
        """Typical load in the busiest 10 ms."""
        width = 10 * k.TICKS_PER_MS // self.ticks_a_call
        sums = [sum(call[1] for call in self.calls[i : i + width]) for i in range(max(len(self.calls) - width, 0) + 1)]
        return 100 * max(sums) / (min(width, len(self.calls)) * self.ticks_a_call * k.TICK_COUNTS)

    @property
    def worst_percent(self) -> float:
        """Typical load of the worst call: its cycles over the time of its ticks."""
        return 100 * max(call[1] for call in self.calls) / (self.ticks_a_call * k.TICK_COUNTS)


def metered_kernel(image: Image, fast: Kernel, window: range, ticks_a_call: int) -> tuple[Kernel, Metered]:
    """Return a kernel that runs the ticks of a window on a metered core and all others in another form of the kernel.

    Both forms work on the same arrays of int64, so `fast` is the compiled one. The figures fill while the kernel runs.
    """
    core_kernel = CoreKernel(image)
    counter = Counter(core_kernel.core)
    counter.paint_stack()
    metered = Metered(ticks_a_call=ticks_a_call)

    def advance(*arguments: Any) -> tuple[int, int]:
        *storage, axis_count, tick, until_tick = arguments
        metered.axes = axis_count
        reached, asking = tick, 0
        while reached < until_tick and not asking:
            inside = reached in window
            end = min(until_tick, reached + ticks_a_call) if inside else _stop(reached, until_tick, window)
            before = reached
            counter.reset()
            run: Callable[..., tuple[int, int]] = core_kernel.advance if inside else fast.advance
            reached, asking = run(*storage, axis_count, reached, end)
            if inside and reached - before == ticks_a_call:
                metered.calls.append(counter.cycles)
                metered.instructions += counter.instructions
                metered.stack_bytes = counter.stack_bytes()
            if reached < end:
                break
        return reached, asking

    return replace(fast, name="cortex-m3", advance=advance), metered


def _stop(tick: int, until_tick: int, window: range) -> int:
    return min(until_tick, window.start) if tick < window.start else until_tick
