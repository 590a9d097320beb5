"""An emulated Cortex-M3 that calls functions of an image, by the procedure call standard of ARM (AAPCS32)."""

from collections.abc import Sequence
from typing import Final

from unicorn import UC_ARCH_ARM, UC_MODE_MCLASS, UC_MODE_THUMB, Uc
from unicorn.arm_const import (
    UC_ARM_REG_LR,
    UC_ARM_REG_R0,
    UC_ARM_REG_R1,
    UC_ARM_REG_R2,
    UC_ARM_REG_R3,
    UC_ARM_REG_SP,
    UC_CPU_ARM_CORTEX_M3,
)

from steptwin.emulator.cortex_m3.image import FLASH, Image

RAM: Final = 0x2000_0000
RAM_BYTES: Final = 0x8000
EDGES: Final = 0x6000_0000
"""Where rows of edges are: memory that no F103 has, since a call of the tests makes more edges than its RAM holds."""
ROW_BYTES: Final = 1 << 20
ROWS: Final = 16
_FLASH_BYTES: Final = 0x1_0000
_STOP: Final = FLASH + _FLASH_BYTES - 16
"""Where a call returns to; nothing is there."""
STACK_TOP: Final = RAM + RAM_BYTES
_WORDS: Final = (UC_ARM_REG_R0, UC_ARM_REG_R1, UC_ARM_REG_R2, UC_ARM_REG_R3)


class Core:
    """The core, its flash with an image, RAM, and memory for edges."""

    def __init__(self, image: Image) -> None:
        self.image = image
        self.engine: Uc = Uc(UC_ARCH_ARM, UC_MODE_THUMB | UC_MODE_MCLASS)
        self.engine.ctl_set_cpu_model(UC_CPU_ARM_CORTEX_M3)
        self.engine.mem_map(FLASH, _FLASH_BYTES)
        self.engine.mem_map(RAM, RAM_BYTES)
        self.engine.mem_map(EDGES, ROWS * ROW_BYTES)
        self.engine.mem_write(FLASH, image.code)

    def write(self, address: int, data: bytes) -> None:
        """Write into memory."""
        self.engine.mem_write(address, data)

    def read(self, address: int, size: int) -> bytes:
        """Read from memory."""
        return bytes(self.engine.mem_read(address, size))

    def call(self, function: str, words: Sequence[int]) -> int:
        """Call a function with its arguments as 32-bit words; return registers r0 and r1 as one unsigned number.

        The first four words go into registers, the others onto the stack; 64-bit arguments are two words and begin at
        an even one (AAPCS32). Raise UcError if the core faults.
        """
        stacked = b"".join((word & 0xFFFF_FFFF).to_bytes(4, "little") for word in words[4:])
        stack = (STACK_TOP - len(stacked)) & ~7
        self.engine.mem_write(stack, stacked)
        for register, word in zip(_WORDS, words, strict=False):
            self.engine.reg_write(register, word & 0xFFFF_FFFF)
        self.engine.reg_write(UC_ARM_REG_SP, stack)
        self.engine.reg_write(UC_ARM_REG_LR, _STOP | 1)
        self.engine.emu_start(self.image.symbols[f"st_{function}"] | 1, _STOP)
        return int(self.engine.reg_read(UC_ARM_REG_R0)) | int(self.engine.reg_read(UC_ARM_REG_R1)) << 32


def words64(value: int) -> tuple[int, int]:
    """Split a 64-bit argument into two words."""
    return value & 0xFFFF_FFFF, value >> 32 & 0xFFFF_FFFF


def signed(value: int, bits: int) -> int:
    """Read the low bits as a two's complement number."""
    value &= (1 << bits) - 1
    return value - (1 << bits) if value >> bits - 1 else value
