"""The core's own registers: SysTick, NVIC, SCB and DWT (PM0056, section 4; ARM DDI 0403, C1.8)."""

from typing import Final

from steptwin.features.stm32.chip import cells as c
from steptwin.features.stm32.chip.bookkeeping import note_strange
from steptwin.features.stm32.chip.cells import Cells, integer
from steptwin.features.stm32.chip.clocks import cycles_now, set_cycles
from steptwin.features.stm32.chip.nvic import FIRST_IRQ, PENDSV, SYSTICK, look_for_pending, pend, pend_system

SPACE: Final = 0xE0000000
_CPUID: Final = 0x411FC231
"""Cortex-M3 r1p1 (RM0008, 31.6.3)."""
_WORD: Final = 0xFFFFFFFF
_ENABLE, _INTERRUPT, _BY_CORE, _REACHED_0 = 1, 2, 4, 1 << 16


@integer
def _systick_grains(s: Cells) -> int:
    return s[c.CYCLE] if s[c.SYSTICK_CONTROL] & _BY_CORE else 8 * s[c.CYCLE]


@integer
def _start_systick(s: Cells) -> None:
    """Let SysTick reach 0 when its ticks are over; a counter at 0 takes its reload first."""
    if s[c.SYSTICK_LEFT] == 0:
        s[c.SYSTICK_LEFT] = s[c.SYSTICK_LOAD] + 1
    runs = s[c.SYSTICK_CONTROL] & _ENABLE != 0 and s[c.SYSTICK_LOAD] != 0
    s[c.DUES + c.SYSTICK_DUE] = s[c.AT] + s[c.SYSTICK_LEFT] * _systick_grains(s) if runs else c.NEVER


@integer
def systick_event(s: Cells) -> None:
    """Let SysTick pass 0 at the instant `AT`."""
    s[c.SYSTICK_CONTROL] |= _REACHED_0
    if s[c.SYSTICK_CONTROL] & _INTERRUPT:
        s[c.OVERRUNS + SYSTICK] += s[c.PENDING_SYSTEM] >> SYSTICK & 1
        pend_system(s, SYSTICK)
    s[c.SYSTICK_LEFT] = 0
    _start_systick(s)


@integer
def _count_systick(s: Cells) -> None:
    """Find the ticks that are left at the instant `AT`."""
    due = s[c.DUES + c.SYSTICK_DUE]
    if due != c.NEVER:
        s[c.SYSTICK_LEFT] = -((s[c.AT] - due) // _systick_grains(s))


@integer
def read_system(s: Cells, address: int) -> int:
    """Return a word of the system space at the instant `AT`."""
    if address == 0xE0001004:
        return cycles_now(s) & _WORD
    if address == 0xE0001000:
        return s[c.CYCLES_ON]
    if address == 0xE0042000:
        return 0x20036410  # DBGMCU_IDCODE of a medium-density chip (RM0008, 31.6.1)
    if not 0xE000E000 <= address < 0xE000F000:
        note_strange(s, address, c.STRANGE_READ)
        return 0
    at = address - 0xE000E000
    if at == 0x010:
        value = s[c.SYSTICK_CONTROL]
        s[c.SYSTICK_CONTROL] &= ~_REACHED_0
        return value
    if at == 0x014:
        return s[c.SYSTICK_LOAD]
    if at == 0x018:
        _count_systick(s)
        return s[c.SYSTICK_LEFT] % (s[c.SYSTICK_LOAD] + 1)
    if at in (0x100, 0x104, 0x180, 0x184):
        return s[c.ENABLED] >> 8 * (at & 4) & _WORD
    if at in (0x200, 0x204, 0x280, 0x284):
        return s[c.PENDING] >> 8 * (at & 4) & _WORD
    if at in (0x300, 0x304):
        return s[c.ACTIVE_IRQ] >> 8 * (at & 4) & _WORD
    if 0x400 <= at < 0x43C:
        return _priorities(s, FIRST_IRQ + at - 0x400)
    if 0xD18 <= at < 0xD24:
        return _priorities(s, 4 + at - 0xD18)
    if at == 0xD00:
        return _CPUID
    if at == 0xD04:
        active = s[c.ACTIVE + s[c.DEPTH] - 1] if s[c.DEPTH] else 0
        first = s[c.BEST] & 0xFF if s[c.BEST] != c.NEVER else 0
        waits = 1 << 22 if s[c.PENDING] & s[c.ENABLED] else 0
        pending = s[c.PENDING_SYSTEM]
        return active | first << 12 | waits | (pending >> PENDSV & 1) << 28 | (pending >> SYSTICK & 1) << 26
    if at == 0xD08:
        return s[c.VECTORS]
    if at == 0xD0C:
        return 0xFA050000 | s[c.SYSTEM + at // 4]
    if at in (0xD10, 0xD14, 0xD24, 0xD28, 0xD2C, 0xD30, 0xD34, 0xD38, 0xDFC, 0x01C, 0xD90):
        return s[c.SYSTEM + at // 4]
    note_strange(s, address, c.STRANGE_READ)
    return 0


@integer
def _priorities(s: Cells, first: int) -> int:
    value = 0
    for i in range(4):
        value |= (s[c.PRIORITY + first + i] & 0xFF) << 8 * i
    return value


@integer
def _set_priorities(s: Cells, first: int, size: int, value: int) -> None:
    """Set priorities, of which this chip keeps the upper four bits."""
    for i in range(size):
        if first + i > 3:
            s[c.PRIORITY + first + i] = value >> 8 * i & 0xF0
    look_for_pending(s)


@integer
def write_system(s: Cells, address: int, size: int, value: int) -> None:
    """Write to the system space at the instant `AT`."""
    if address == 0xE0001004:
        set_cycles(s, value)
    elif address == 0xE0001000:
        set_cycles(s, cycles_now(s))
        s[c.CYCLES_ON] = value & 1
    elif address in (0xE0001FB0, 0xE0042004):
        return  # the lock of DWT, which later cores have; what a debugger lets run on
    elif 0xE000E400 <= address < 0xE000E43C:
        _set_priorities(s, FIRST_IRQ + address - 0xE000E400, size, value)
    elif 0xE000ED18 <= address < 0xE000ED24:
        _set_priorities(s, 4 + address - 0xE000ED18, size, value)
    elif 0xE000E000 <= address < 0xE000F000:
        _write_control(s, address - 0xE000E000, value)
    else:
        note_strange(s, address, c.STRANGE_WRITE)


@integer
def _write_control(s: Cells, at: int, value: int) -> None:
    bits = value << 8 * (at & 4)
    if at == 0x010:
        _count_systick(s)
        s[c.SYSTICK_CONTROL] = s[c.SYSTICK_CONTROL] & _REACHED_0 | value & 7
        _start_systick(s)
    elif at == 0x014:
        s[c.SYSTICK_LOAD] = value & 0xFFFFFF
    elif at == 0x018:
        s[c.SYSTICK_CONTROL] &= ~_REACHED_0
        s[c.SYSTICK_LEFT] = 0
        _start_systick(s)
    elif at in (0x100, 0x104):
        s[c.ENABLED] |= bits & (1 << 60) - 1
    elif at in (0x180, 0x184):
        s[c.ENABLED] &= ~bits
    elif at in (0x200, 0x204):
        for irq in range(60):
            if bits >> irq & 1:
                pend(s, irq)
    elif at in (0x280, 0x284):
        s[c.PENDING] &= ~bits
    elif at == 0xD04:
        for number, on, off in ((PENDSV, 28, 27), (SYSTICK, 26, 25)):
            if value >> on & 1:
                pend_system(s, number)
            if value >> off & 1:
                s[c.PENDING_SYSTEM] &= ~(1 << number)
    elif at == 0xD08:
        s[c.VECTORS] = value & 0x3FFFFF80
    elif at == 0xD0C:
        if value >> 16 != 0x05FA:
            return
        s[c.SYSTEM + at // 4] = value & 0x700
        s[c.GROUP_MASK] = ~((2 << (value >> 8 & 7)) - 1) & 0xFF
        if value & 4:
            s[c.FAULT] = c.FAULT_RESET
    elif at == 0xF00:
        pend(s, value & 0x1FF)
    elif at in (0xD10, 0xD14, 0xD24, 0xDFC):
        s[c.SYSTEM + at // 4] = value
    elif at in (0xD28, 0xD2C):
        s[c.SYSTEM + at // 4] &= ~value
    else:
        note_strange(s, 0xE000E000 + at, c.STRANGE_WRITE)
    look_for_pending(s)
