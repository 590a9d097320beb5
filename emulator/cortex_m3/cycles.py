"""How many cycles code takes on a Cortex-M3: a model with a low, a typical and a high end; no silicon was measured.

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
from dataclasses import dataclass
from typing import Final

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
