"""The processor's time: blocks of instructions, sleep, and exceptions when they are due."""

from typing import Final

from steptwin.features.stm32.chip import cells as c
from steptwin.features.stm32.chip.cells import Cells, integer
from steptwin.features.stm32.chip.cost import REFILL_CYCLES, block_cycles, part_cycles
from steptwin.features.stm32.chip.devices import act
from steptwin.features.stm32.chip.events import next_due
from steptwin.features.stm32.chip.flash import program_flash
from steptwin.features.stm32.chip.libunicorn import read_memory, read_register, start, stop
from steptwin.features.stm32.chip.nvic import (
    EXIT_CYCLES,
    FAULTMASK,
    PC,
    PRIMASK,
    SVCALL,
    enter,
    leave,
    takes_exception,
)

_WFI, _WFE, _YIELD, _SEV = 0xBF30, 0xBF20, 0xBF10, 0xBF40
_SVC_EXCEPTION, _BREAKPOINT_EXCEPTION, _EXIT_EXCEPTION = 2, 7, 8
"""unicorn's numbers of exceptions."""
_WRITE_PROTECTED: Final = 22
"""unicorn's number of a write to memory that can only be read."""
_EDGES_LEFT: Final = 512
"""Places in the list of edges that a block may need."""


@integer
def _close_block(s: Cells, next_address: int) -> None:
    """Let the time of the block pass that has been executed; a branch out of it refills the pipeline."""
    if not s[c.BLOCK_SIZE]:
        return
    cycles = s[c.BLOCK_CYCLES]
    if next_address != s[c.BLOCK] + s[c.BLOCK_SIZE]:
        cycles += REFILL_CYCLES + s[c.WAIT_STATES]
    _spend(s, cycles)
    if s[c.MASK_CHANGES]:
        _note_mask(s)


@integer
def _spend(s: Cells, cycles: int) -> None:
    """Let cycles pass in the present block, which ends."""
    s[c.NOW] += cycles * s[c.CYCLE]
    in_flash = c.FLASH_START <= s[c.BLOCK] < s[c.FLASH_END]
    s[c.SPENT + ((s[c.BLOCK] - c.FLASH_START) >> 1 if in_flash else c.BLOCK_COSTS - 1)] += cycles * s[c.CYCLE]
    s[c.BLOCK_SIZE] = 0


@integer
def _note_mask(s: Cells) -> None:
    """Begin or end a time with all interrupts off, as PRIMASK and FAULTMASK are now."""
    s[c.MASK_CHANGES] = 0
    if (read_register(s, PRIMASK) | read_register(s, FAULTMASK)) & 1:
        if s[c.MASKED_AT] == c.NEVER:
            s[c.MASKED_AT], s[c.MASKED_BY] = s[c.NOW], s[c.BLOCK]
    elif s[c.MASKED_AT] != c.NEVER:
        if s[c.NOW] - s[c.MASKED_AT] > s[c.LONGEST_MASKED]:
            s[c.LONGEST_MASKED], s[c.LONGEST_MASKED_BY] = s[c.NOW] - s[c.MASKED_AT], s[c.MASKED_BY]
        s[c.MASKED_AT] = c.NEVER


@integer
def on_block(s: Cells, address: int, size: int) -> None:
    """Begin a block, unless it is time for something else: unicorn calls this before the block's first instruction."""
    _close_block(s, address)
    if address == s[c.MAIN]:
        s[c.MAIN] = 0
    full = s[c.EDGE_COUNT] > c.EDGE_CAPACITY - _EDGES_LEFT
    if s[c.NOW] >= min(s[c.UNTIL], s[c.DUE]) or s[c.FAULT] or full or takes_exception(s, 1):
        stop(s)
        return
    cost = block_cycles(s, address, size)
    s[c.BLOCK], s[c.BLOCK_SIZE], s[c.BLOCK_CYCLES], s[c.MASK_CHANGES] = address, size, cost >> 1, cost & 1


@integer
def on_instruction(s: Cells, address: int) -> None:
    """Stop before an instruction for a debugger: at a breakpoint, or behind a step. Without one nobody calls this."""
    if s[c.STOPPED]:
        return
    if s[c.STEPS_LEFT]:
        s[c.STEPS_LEFT] -= 1
        return
    halts = s[c.STEPPING] != 0
    for number in range(s[c.BREAKPOINT_COUNT]):
        halts = halts or s[c.BREAKPOINT + number] == address
    if halts:
        if s[c.BLOCK_SIZE]:
            _spend(s, part_cycles(s, s[c.BLOCK], address))
        s[c.HALTED] = 1
        stop(s)


@integer
def on_exception(s: Cells, number: int) -> None:
    """Note an exception of unicorn's: the processor is no longer in a block."""
    s[c.EXCEPTION] = number
    stop(s)


@integer
def on_unmapped(s: Cells, kind: int, address: int, size: int, value: int) -> bool:
    """Note an access to an address where there is nothing; return True for a write that the flash takes."""
    if kind == _WRITE_PROTECTED and program_flash(s, address, size, value):
        return True
    s[c.FAULT], s[c.FAULT_AT], s[c.FAULT_PC] = c.FAULT_UNMAPPED, address, read_register(s, PC)
    return False


@integer
def run(s: Cells, until: int) -> None:
    """Let time pass until an instant in grains; end before it after a fault, for a debugger, for edges or frames.

    The last block may end after that instant.
    """
    s[c.UNTIL] = until
    chained = 0
    while True:
        while s[c.DUE] <= s[c.NOW]:
            act(s)
        s[c.AT] = s[c.NOW]
        full = s[c.EDGE_COUNT] > c.EDGE_CAPACITY - _EDGES_LEFT
        if s[c.FAULT] or s[c.HALTED] or s[c.NOW] >= s[c.UNTIL] or full:
            return
        if s[c.SLEEPING] and not _wakes(s):
            asleep = max(min(s[c.UNTIL], s[c.DUE]) - s[c.NOW], 0)
            s[c.NOW] += asleep
            s[c.SLEPT] += asleep
            if s[c.MASKED_AT] != c.NEVER:
                s[c.MASKED_AT] += asleep
            continue
        if takes_exception(s, 1):
            s[c.SLEEPING] = 0
            enter(s, s[c.BEST] & 0xFF, chained)
            chained = 0
            continue
        if chained:
            s[c.NOW] += EXIT_CYCLES * s[c.CYCLE]
            chained = 0
            continue
        s[c.STOPPED], s[c.EXCEPTION], s[c.BLOCK_SIZE] = 0, -1, 0
        error = start(s, s[c.PC])
        s[c.PC] = read_register(s, PC)
        chained = _resolve(s, error)


@integer
def _wakes(s: Cells) -> bool:
    """Return whether the processor's sleep ends, and end it."""
    if s[c.SLEEPING] == 2 and s[c.EVENT]:
        s[c.EVENT] = s[c.SLEEPING] = 0
        return True
    if takes_exception(s, 0 if s[c.SLEEPING] == 1 else 1):
        s[c.SLEEPING] = 0
        return True
    return False


@integer
def _resolve(s: Cells, error: int) -> int:
    """Do what ended unicorn's stretch of instructions; return 1 if a handler has just returned."""
    pc = s[c.PC]
    if s[c.FAULT]:
        if s[c.FAULT] != c.FAULT_UNMAPPED:
            s[c.FAULT_PC] = pc
        return 0
    if s[c.EXCEPTION] == _EXIT_EXCEPTION:
        _close_block(s, pc)
        leave(s, pc)
        return 1
    if s[c.EXCEPTION] == _SVC_EXCEPTION:
        _close_block(s, pc)
        s[c.PENDED_AT + SVCALL] = s[c.NOW]
        enter(s, SVCALL, 0)
        return 0
    if s[c.EXCEPTION] >= 0:
        undefined = s[c.EXCEPTION] != _BREAKPOINT_EXCEPTION
        s[c.FAULT], s[c.FAULT_PC] = (c.FAULT_UNDEFINED if undefined else c.FAULT_BREAKPOINT), pc
        s[c.FAULT_AT] = s[c.EXCEPTION]
        return 0
    if s[c.STOPPED]:
        return 0
    _close_block(s, pc)
    last = read_memory(s, pc - 2, 2)
    if last == _WFI and not error:
        s[c.SLEEPING] = 1
    elif last == _WFE:
        if s[c.EVENT]:
            s[c.EVENT] = 0
        else:
            s[c.SLEEPING] = 2
    elif last not in (_YIELD, _SEV):
        s[c.FAULT], s[c.FAULT_AT], s[c.FAULT_PC] = c.FAULT_UNICORN, error, pc
    next_due(s)
    return 0
