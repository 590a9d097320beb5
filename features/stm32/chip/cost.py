"""What instructions cost, in cycles: the tables of the Cortex-M3's manual, and the wait states of the flash.

Cortex-M3 Technical Reference Manual r1p1 (ARM DDI 0337), table 18-1: one cycle for most instructions, two for a single
load or store, 1 + N for N words, 2 to 12 for a division, 1 + P for a taken branch, whose pipeline refills in P = 1 to
3 cycles. The flash gives 8 bytes in 1 + wait states cycles (RM0008, 3.3.3); the prefetch buffer hides that in straight
code, unless its instructions take less time than their fetch, and not after a branch.
"""

from typing import Final

from steptwin.features.stm32.chip import cells as c
from steptwin.features.stm32.chip.cells import Cells, integer
from steptwin.features.stm32.chip.libunicorn import read_memory

REFILL_CYCLES: Final = 2
"""P of the table: cycles until the instruction at a branch's target is decoded."""
DIVIDE_CYCLES: Final = 7
"""The middle of 2 to 12, which depends on the operands."""


@integer
def is_wide(first: int) -> bool:
    """Return whether an instruction that begins with this halfword has 4 bytes."""
    return first >> 11 >= 0b11101


@integer
def _ones(word: int) -> int:
    count = 0
    while word:
        word &= word - 1
        count += 1
    return count


@integer
def instruction_cycles(first: int, second: int) -> int:
    """Return the cycles of an instruction without those of a branch that it takes."""
    if not is_wide(first):
        if first >> 12 in (0b0101, 0b0110, 0b0111, 0b1000, 0b1001) or first >> 11 == 0b01001:
            return 2  # one load or store
        if first >> 12 == 0b1100 or first >> 9 in (0b1011010, 0b1011110):
            return 1 + _ones(first & (0x1FF if first >> 12 == 0b1011 else 0xFF))  # LDM, STM, PUSH, POP
        return 1
    if first & 0xFE40 == 0xE800:
        return 1 + _ones(second)  # LDM, STM
    if first & 0xFE40 == 0xE840:
        return 3 if first & 0x0120 else 2  # LDRD and STRD; exclusives and TBB
    if first & 0xFE00 == 0xF800:
        return 2  # one load or store
    if first & 0xFFD0 == 0xFB90:
        return DIVIDE_CYCLES
    if first & 0xFF80 == 0xFB80:
        return 5  # long products: 3 to 7
    if first & 0xFF80 == 0xFB00:
        return 2 if second >> 12 != 0xF else 1  # MLA and MLS; MUL
    return 1


@integer
def straight_cycles(s: Cells, begin: int, end: int) -> int:
    """Return the cycles of the instructions from an address to another, without a branch at their end."""
    cycles, address = 0, begin
    while address < end:
        first, second = read_memory(s, address, 2), 0
        if is_wide(first):
            second = read_memory(s, address + 2, 2)
            address += 2
        address += 2
        cycles += instruction_cycles(first, second)
    if c.FLASH_START <= begin < s[c.FLASH_END]:
        fetch_cycles = ((end + 7) // 8 - begin // 8 - 1) * (1 + s[c.WAIT_STATES])
        return max(cycles, fetch_cycles)
    return cycles


@integer
def _changes_mask(s: Cells, end: int) -> bool:
    """Return whether a block ends by CPSID, CPSIE, or a write of PRIMASK or FAULTMASK."""
    last = read_memory(s, end - 2, 2)
    return last & 0xFFE8 == 0xB660 or (last & 0xFFFC == 0x8810 and read_memory(s, end - 4, 2) & 0xFFF0 == 0xF380)


@integer
def block_cycles(s: Cells, begin: int, size: int) -> int:
    """Return twice the cycles of a block, as `straight_cycles`, plus 1 if it may change the masks of all interrupts.

    Those of blocks in flash are worked out once.
    """
    if not c.FLASH_START <= begin < s[c.FLASH_END]:
        return 2 * straight_cycles(s, begin, begin + size) + (1 if _changes_mask(s, begin + size) else 0)
    place = (begin - c.FLASH_START) >> 1
    if s[c.KNOWN_SIZE + place] != size:
        s[c.KNOWN_SIZE + place] = size
        cycles = straight_cycles(s, begin, begin + size)
        s[c.KNOWN_CYCLES + place] = 2 * cycles + (1 if _changes_mask(s, begin + size) else 0)
    return s[c.KNOWN_CYCLES + place]


@integer
def part_cycles(s: Cells, begin: int, pc: int) -> int:
    """Return the cycles of a block up to an instruction, as `block_cycles`."""
    if not c.FLASH_START <= begin < s[c.FLASH_END]:
        return straight_cycles(s, begin, pc)
    place = (pc - c.FLASH_START) >> 1
    if s[c.PART_BEGIN + place] != begin:
        s[c.PART_BEGIN + place] = begin
        s[c.PART_CYCLES + place] = straight_cycles(s, begin, pc)
    return s[c.PART_CYCLES + place]


@integer
def forget_costs(s: Cells) -> None:
    """Work all costs out again, because the wait states have changed."""
    for place in range((s[c.FLASH_END] - c.FLASH_START) >> 1):
        s[c.KNOWN_SIZE + place] = s[c.PART_BEGIN + place] = 0
