"""The flash's controller: keys, page erase, half-word programming and their refusals (RM0008, 3.3.3; ST's PM0075)."""

from typing import Final

from steptwin.features.stm32.chip import cells as c
from steptwin.features.stm32.chip.cells import Cells, integer
from steptwin.features.stm32.chip.cost import forget_costs
from steptwin.features.stm32.chip.libunicorn import read_memory, write_memory
from steptwin.features.stm32.chip.nvic import set_line

BASE: Final = c.VALUE + (0x40022000 - c.PERIPHERALS) // 4
ACR, KEYR, OPTKEYR, SR, CR, AR = range(6)
PGERR, EOP = 4, 32
PG, PER, MER, STRT, LOCK, ERRIE, EOPIE = 1, 2, 4, 64, 128, 1 << 10, 1 << 12
KEY1, KEY2 = 0x45670123, 0xCDEF89AB
_OPEN, _SHUT = 2, -1
"""Values of `FLASH_KEYS`: it counts right keys; a wrong one shuts CR until the next reset."""
PROGRAM_GRAINS: Final = 3780 * c.GRAINS
"""52.5 us, the typical time of the datasheet's table 29; the processor stands still meanwhile."""
ERASE_GRAINS: Final = 72 * 30_000 * c.GRAINS
"""30 ms, between the datasheet's 20 and 40."""
_IRQ: Final = 4
_HALFWORD: Final = 2
_WORD_OF_ONES: Final = 0xFFFFFFFF


@integer
def _page_bytes(s: Cells) -> int:
    return 1024 if s[c.FLASH_END] - c.FLASH_START <= 0x20000 else 2048


@integer
def _store(s: Cells, address: int, size: int, value: int) -> None:
    """Change the flash in both places where the processor sees it, and forget what its code costs."""
    write_memory(s, address, size, value)
    write_memory(s, address - c.FLASH_START, size, value)
    place = (address - c.FLASH_START) >> 1
    for i in range(size // 2):
        s[c.KNOWN_SIZE + place + i] = s[c.PART_BEGIN + place + i] = 0


@integer
def _erase(s: Cells, begin: int, end: int) -> None:
    for address in range(begin, end, 4):
        _store(s, address, 4, _WORD_OF_ONES)
    s[c.NOW] += ERASE_GRAINS
    s[BASE + SR] |= EOP


@integer
def program_flash(s: Cells, address: int, size: int, value: int) -> bool:
    """Program a half-word, if PG is set; return False for what the bus refuses: another size, or without PG.

    A place that is not erased takes only 0, else PGERR is set and it stays as it is (PM0075, 2.3.3).
    """
    if address < c.FLASH_START:
        address += c.FLASH_START
    if size != _HALFWORD or s[BASE + CR] & (PG | LOCK) != PG or not c.FLASH_START <= address < s[c.FLASH_END]:
        return False
    if read_memory(s, address, 2) != 0xFFFF and value & 0xFFFF:
        s[BASE + SR] |= PGERR
    else:
        _store(s, address, _HALFWORD, value & 0xFFFF)
        s[c.NOW] += PROGRAM_GRAINS
        s[BASE + SR] |= EOP
        s[c.FLASH_WRITES] += 1
    _set_line(s)
    return True


@integer
def _set_line(s: Cells) -> None:
    status, enabled = s[BASE + SR], s[BASE + CR]
    set_line(s, _IRQ, 1 if (status & EOP and enabled & EOPIE) or (status & PGERR and enabled & ERRIE) else 0)


@integer
def write_flash(s: Cells, word: int, value: int, before: int) -> None:
    """Write a register, whose value is stored already, at the instant `AT`."""
    if word == ACR:
        if s[c.WAIT_STATES] != value & 7:
            s[c.WAIT_STATES] = value & 7
            forget_costs(s)
    elif word == KEYR:
        right = (s[c.FLASH_KEYS] == 0 and value == KEY1) or (s[c.FLASH_KEYS] == 1 and value == KEY2)
        s[c.FLASH_KEYS] = s[c.FLASH_KEYS] + 1 if right else _SHUT
        if s[c.FLASH_KEYS] == _OPEN:
            s[BASE + CR] &= ~LOCK
    elif word == SR:
        s[BASE + SR] = before & ~value
    elif word == CR:
        if before & LOCK:
            s[BASE + CR] = before
        elif value & LOCK:
            s[c.FLASH_KEYS] = 0
        elif value & STRT:
            s[BASE + CR] &= ~STRT
            if value & MER:
                _erase(s, c.FLASH_START, s[c.FLASH_END])
            elif value & PER and c.FLASH_START <= s[BASE + AR] < s[c.FLASH_END]:
                begin = s[BASE + AR] & ~(_page_bytes(s) - 1)
                _erase(s, begin, begin + _page_bytes(s))
                s[c.FLASH_ERASES] += 1
    _set_line(s)
