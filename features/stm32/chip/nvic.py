"""Exceptions: pending, priorities, preemption, entry and return (ARM DDI 0403, B1.5; PM0056, 2.3)."""

from typing import Final

from steptwin.features.stm32.chip import cells as c
from steptwin.features.stm32.chip.cells import Cells, integer
from steptwin.features.stm32.chip.libunicorn import (
    read_frame,
    read_memory,
    read_register,
    write_frame,
    write_register,
)

# unicorn's numbers of registers (arm_const)
SP, LR, PC, XPSR = 12, 10, 11, 120
MSP, PSP, CONTROL = 115, 116, 117
PRIMASK, BASEPRI, FAULTMASK = 123, 124, 126
R0, R1, R2, R3, R12 = 66, 67, 68, 69, 78
STACKED: Final = (R0, R1, R2, R3, R12, LR)

SVCALL, PENDSV, SYSTICK, FIRST_IRQ = 11, 14, 15, 16
ENTRY_CYCLES: Final = 12
CHAIN_CYCLES: Final = 6
"""From one handler to the next, without taking registers off the stack and back."""
EXIT_CYCLES: Final = 10
THREAD_PRIORITY: Final = 256
_THUMB: Final = 1 << 24
_WORD: Final = 0xFFFFFFFF


@integer
def look_for_pending(s: Cells) -> None:
    """Find the pending exception that comes first, after any change of what is pending or of priorities."""
    best, number, left = c.NEVER, 0, s[c.PENDING_SYSTEM]
    while left:
        if left & 1:
            best = min(best, s[c.PRIORITY + number] * 256 + number)
        left >>= 1
        number += 1
    number, left = FIRST_IRQ, s[c.PENDING] & s[c.ENABLED]
    while left:
        if left & 1:
            best = min(best, s[c.PRIORITY + number] * 256 + number)
        left >>= 1
        number += 1
    s[c.BEST] = best


@integer
def pend_system(s: Cells, number: int) -> None:
    """Make an exception below 16 pending."""
    if not s[c.PENDING_SYSTEM] >> number & 1:
        s[c.PENDED_AT + number] = s[c.AT]
    s[c.PENDING_SYSTEM] |= 1 << number
    look_for_pending(s)


@integer
def pend(s: Cells, irq: int) -> None:
    """Make an interrupt pending."""
    if not s[c.PENDING] >> irq & 1:
        s[c.PENDED_AT + FIRST_IRQ + irq] = s[c.AT]
    s[c.PENDING] |= 1 << irq
    look_for_pending(s)


@integer
def set_line(s: Cells, irq: int, level: int) -> None:
    """Set the level by which a device asks for its interrupt."""
    if level and not s[c.LINES] >> irq & 1:
        s[c.LINES] |= 1 << irq
        pend(s, irq)
    elif not level:
        s[c.LINES] &= ~(1 << irq)


@integer
def _active_priority(s: Cells) -> int:
    return s[c.ACTIVE_PRIORITY + s[c.DEPTH] - 1] if s[c.DEPTH] else THREAD_PRIORITY


@integer
def takes_exception(s: Cells, masked: int) -> bool:
    """Return whether the first pending exception may preempt; without `masked` as if PRIMASK were 0, as WFI asks."""
    if s[c.BEST] == c.NEVER:
        return False
    priority = s[c.BEST] >> 8
    wanted = priority & s[c.GROUP_MASK] if priority >= 0 else priority
    if wanted >= _active_priority(s):
        return False
    if masked and read_register(s, PRIMASK) & 1:
        return False
    if read_register(s, FAULTMASK) & 1:
        return False
    basepri = read_register(s, BASEPRI) & 0xFF & s[c.GROUP_MASK]
    return basepri == 0 or wanted < basepri


@integer
def _signed(word: int) -> int:
    """Return a word as a signed number, which a cell of 64 bits can hold in its upper half."""
    return (word ^ 0x80000000) - 0x80000000


@integer
def enter(s: Cells, number: int, chained: int) -> None:
    """Enter the handler of an exception: stack eight words and load its vector."""
    vector = read_memory(s, s[c.VECTORS] + 4 * number, 4)
    if not vector & 1:
        s[c.FAULT], s[c.FAULT_AT], s[c.FAULT_PC] = c.FAULT_VECTOR, number, s[c.PC]
        return
    status = read_register(s, XPSR) | _THUMB
    sp = read_register(s, SP)
    if s[c.SYSTEM + 0xD14 // 4] & 0x200 and sp & 4:  # CCR.STKALIGN
        sp -= 4
        status |= 0x200
    sp -= 32
    by_process = s[c.DEPTH] == 0 and read_register(s, CONTROL) & 2 != 0
    if sp < s[c.STACK_LIMIT] and not by_process:
        s[c.FAULT], s[c.FAULT_AT], s[c.FAULT_PC] = c.FAULT_STACK, sp, s[c.PC]
        return
    for pair in range(3):
        low, high = read_register(s, STACKED[2 * pair]), read_register(s, STACKED[2 * pair + 1])
        s[c.FRAME + pair] = low | _signed(high) << 32
    s[c.FRAME + 3] = s[c.PC] | _signed(status) << 32
    write_frame(s, sp)
    write_register(s, SP, sp)
    write_register(s, LR, 0xFFFFFFF1 if s[c.DEPTH] else 0xFFFFFFFD if by_process else 0xFFFFFFF9)
    write_register(s, XPSR, _THUMB | number)
    priority = s[c.PRIORITY + number]
    s[c.ACTIVE + s[c.DEPTH]] = number
    s[c.ACTIVE_PRIORITY + s[c.DEPTH]] = priority & s[c.GROUP_MASK] if priority >= 0 else priority
    s[c.DEPTH] += 1
    if number >= FIRST_IRQ:
        s[c.PENDING] &= ~(1 << (number - FIRST_IRQ))
        s[c.ACTIVE_IRQ] |= 1 << (number - FIRST_IRQ)
    else:
        s[c.PENDING_SYSTEM] &= ~(1 << number)
    look_for_pending(s)
    s[c.PC] = vector & ~1
    s[c.EVENT] = 1
    s[c.NOW] += (CHAIN_CYCLES if chained else ENTRY_CYCLES) * s[c.CYCLE]
    s[c.TAKEN + number] += 1
    s[c.LATEST + number] = max(s[c.LATEST + number], s[c.NOW] - s[c.PENDED_AT + number])


@integer
def leave(s: Cells, code: int) -> None:
    """Return from a handler, as the code that was branched to says: take eight words off the stack.

    The time for that does not pass here, because another handler may follow at once.
    """
    if s[c.DEPTH] == 0:
        s[c.FAULT], s[c.FAULT_AT], s[c.FAULT_PC] = c.FAULT_RETURN, code, s[c.PC]
        return
    by_process = code & 0xF == 0xD or code & 0xF == 0xC
    sp = read_register(s, PSP if by_process else MSP)
    read_frame(s, sp)
    pc, status = s[c.FRAME + 3] & _WORD, s[c.FRAME + 3] >> 32 & _WORD
    s[c.DEPTH] -= 1
    number = s[c.ACTIVE + s[c.DEPTH]]
    if number >= FIRST_IRQ:
        s[c.ACTIVE_IRQ] &= ~(1 << (number - FIRST_IRQ))
        if s[c.LINES] >> (number - FIRST_IRQ) & 1:
            pend(s, number - FIRST_IRQ)
    thread = s[c.DEPTH] == 0
    write_register(s, XPSR, _THUMB | (0 if thread else s[c.ACTIVE + s[c.DEPTH] - 1]))
    if thread:
        control = read_register(s, CONTROL) & 1
        write_register(s, CONTROL, control | (2 if by_process else 0))
    write_register(s, SP, sp + 32 + (4 if status & 0x200 else 0))
    for pair in range(3):
        write_register(s, STACKED[2 * pair], s[c.FRAME + pair] & _WORD)
        write_register(s, STACKED[2 * pair + 1], s[c.FRAME + pair] >> 32 & _WORD)
    number_now = 0 if thread else s[c.ACTIVE + s[c.DEPTH] - 1]
    write_register(s, XPSR, (status & ~0x3FF) | number_now | _THUMB)
    s[c.PC] = pc & ~1
    s[c.EVENT] = 1
