"""Meter the kernel on the emulated core: instructions, cycles and stack.

Cycles are by a model with a low, a typical and a high end; no silicon was measured.

Source: ARM, Cortex-M3 Technical Reference Manual (DDI 0337), instruction set summary with cycle counts. Where it gives
a range, the model has its ends and a value between: the refill of the pipeline after a branch takes 1 to 3 cycles, a
division 2 to 12 (early where the quotient is short), a long product 3 to 5 and one that accumulates 4 to 7. A load or
store takes 2, or 1 right after another one, into which it is pipelined; the low end pipelines all of them. An
instruction whose condition fails counts as if it were executed.

Waits for the flash are counted apart. An STM32F103 at 72 MHz has two wait states and a prefetch buffer of two times 64
bits (ST, RM0008 and PM0075): it fetches 8 bytes in 3 cycles, so a run of short instructions that are long in bytes
waits for the rest, and a jump waits for the two cycles. Loads of constants from flash, which also take turns with the
fetching, are left out.
"""

import re
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import Any, Final

import numpy as np
from unicorn import UC_HOOK_BLOCK

from steptwin.controller.motion import kernel as k
from steptwin.controller.motion.backend import Kernel
from steptwin.features.kernel_c.core_kernel import STACK_TOP, Core, CoreKernel
from steptwin.features.kernel_c.image import Image
from steptwin.features.kernel_c.layout import Cells

WAIT_STATES: Final = 2
_FETCH_BYTES: Final = 8
Ends = tuple[int, int, int]
"""Cycles at the low end, typical, at the high end."""
REFILL: Final[Ends] = (1, 2, 3)
_LINE: Final = re.compile(r"^ *([0-9a-f]+):\t((?:[0-9a-f]{4} ?)+)\s*\t(\S+)(?:\t(.*))?$")
_CONDITION: Final = "(eq|ne|cs|cc|mi|pl|vs|vc|hi|ls|ge|lt|gt|le)?"
_COSTS: Final[tuple[tuple[str, Ends], ...]] = (
    (r"[us]div", (2, 7, 12)),
    (r"[us]mull", (3, 4, 5)),
    (r"[us]mlal", (4, 5, 7)),
    (r"mla|mls", (2, 2, 2)),
    (r"ldrd|strd", (3, 3, 3)),
    (r"it[te]*", (0, 1, 1)),
)
_SINGLE: Final = re.compile(rf"(ldr|str)(s?[bh])?{_CONDITION}$")
_MANY: Final = re.compile(r"(ldm|stm)(ia|db)?|push|pop")


@dataclass(frozen=True, slots=True)
class Block:
    """A run of instructions, without the jump at its end.

    Attributes:
        instructions: their number.
        cycles: their cycles from a memory without wait states.
        flash_waits: what the flash adds to the typical cycles.
        end: the address after them.
    """

    instructions: int
    cycles: Ends
    flash_waits: int
    end: int


class Disassembly:
    """The cycles of every instruction of an image, from its disassembly."""

    def __init__(self, disassembly: str) -> None:
        self._instructions: dict[int, tuple[int, str, str]] = {}
        for line in disassembly.splitlines():
            found = _LINE.match(line)
            if found:
                size = len(found[2].replace(" ", "")) // 2
                self._instructions[int(found[1], 16)] = (
                    size,
                    found[3].removesuffix(".w").removesuffix(".n"),
                    found[4] or "",
                )

    def block(self, address: int, size: int) -> Block:
        """Return the block of this length at an address; raise KeyError if there is no code."""
        at, count, memory_before = address, 0, False
        low = typical = high = 0
        while at < address + size:
            length, name, operands = self._instructions[at]
            a, b, c = _cost(name, operands, pipelined=memory_before)
            low, typical, high = low + a, typical + b, high + c
            memory_before = bool(_SINGLE.match(name))
            count += 1
            at += length
        fetching = -(-size // _FETCH_BYTES) * (1 + WAIT_STATES)
        return Block(count, (low, typical, high), max(fetching - typical, 0), at)


def _cost(name: str, operands: str, *, pipelined: bool) -> Ends:
    for pattern, ends in _COSTS:
        if re.fullmatch(pattern + _CONDITION, name):
            return ends
    if _SINGLE.match(name):
        return (1, 1 if pipelined else 2, 2)
    if _MANY.match(name):
        registers = _registers(operands)
        return (1 + registers,) * 3
    return (1, 1, 1)


def _registers(operands: str) -> int:
    """Count the registers of a list such as {r0, r4-r7, lr}."""
    count = 0
    for part in operands[operands.index("{") + 1 : operands.index("}")].split(","):
        ends = [int(number) for number in re.findall(r"\br(\d+)", part)]
        count += ends[1] - ends[0] + 1 if len(ends) == 2 else 1
    return count


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
        self.instructions: int = 0
        self.flash_waits: int = 0
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
