"""An emulated Cortex-M3 that calls functions of an image (AAPCS32), and the kernel on it beside plain Python and numba.

The storage stays where the firmware's Python finds it, in arrays of int64. Each call copies it into the core's memory,
as the structures of the C interface, and back; so nothing but the call's arguments decides its result.
"""

from collections.abc import Sequence
from functools import cache
from itertools import pairwise
from typing import Final

import numpy as np
from numpy.typing import NDArray
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

from steptwin.controller.motion import kernel as k
from steptwin.controller.motion.backend import Kernel
from steptwin.features.kernel_c.image import FLASH, Image, kernel_image
from steptwin.features.kernel_c.layout import Cells, Layout, kernel_on_arrays, whole_edges

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
AXES_MAX: Final = ROWS // 2
TICKS_A_CALL: Final = 1 << 15
"""Longest time that a call covers: edges are 32 bits on the core, and must be told apart afterwards."""

_AXES: Final = RAM
_BEFORE: Final = RAM + 0x400
_GROUP: Final = RAM + 0x800
_RESULT: Final = RAM + 0x840
_CLK_ROWS: Final = RAM + 0x880
_DIRECTION_ROWS: Final = RAM + 0x8C0
QUEUE: Final = RAM + 0x1000


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


class CoreKernel:
    """The kernel's functions, executed by a core."""

    def __init__(self, image: Image) -> None:
        self.core: Core = Core(image)
        self._axis, self._segment, self._group = map(Layout, ("axis", "segment", "group"))
        for table, first in ((_CLK_ROWS, 0), (_DIRECTION_ROWS, AXES_MAX)):
            rows = [EDGES + (first + axis) * ROW_BYTES for axis in range(AXES_MAX)]
            self.core.write(table, np.array(rows, np.uint32).tobytes())

    def push(
        self, axes: Cells, queue: Cells, axis: int, displacement_units: int, end_velocity: int, duration_ticks: int
    ) -> int:
        """See the kernel."""
        self.core.write(_AXES, self._axis.packed(axes))
        base = axis * k.AXIS_FIELDS
        slot = int(axes[base + k.QUEUE_HEAD] + axes[base + k.QUEUE_COUNT]) % k.QUEUE_DEPTH
        arguments = (_AXES, QUEUE, axis, displacement_units, end_velocity, duration_ticks)
        answer = signed(self.core.call("push", arguments), 32)
        if answer == k.ACCEPTED:
            self._read(axes)
            entry = axis * k.QUEUE_DEPTH + slot
            cells = queue[entry * k.SEGMENT_FIELDS : (entry + 1) * k.SEGMENT_FIELDS]
            self._segment.unpack(self.core.read(QUEUE + entry * self._segment.size, self._segment.size), cells)
        return answer

    def next_segment(self, axes: Cells, queue: Cells, axis: int) -> bool:
        """See the kernel."""
        self._write(axes, queue)
        answer = self.core.call("next_segment", (_AXES, QUEUE, axis))
        self._read(axes)
        return bool(answer & 0xFF)

    def demand_rate(self, axes: Cells, axis: int) -> int:
        """See the kernel."""
        self.core.write(_AXES, self._axis.packed(axes))
        return signed(self.core.call("demand_rate", (_AXES, axis)), 64)

    def advance(
        self,
        axes: Cells,
        before: Cells,
        queue: Cells,
        group: Cells,
        clk: NDArray[np.int64],
        direction: NDArray[np.int64],
        axis_count: int,
        tick: int,
        until_tick: int,
    ) -> tuple[int, int]:
        """See the kernel. A long time is run in parts, which makes no difference to the result."""
        self._write(axes, queue)
        self.core.write(_GROUP, self._group.packed(group))
        stops = [*range(tick, until_tick, TICKS_A_CALL), until_tick]
        reached, asking = tick, 0
        for from_tick, to_tick in pairwise(stops if len(stops) > 1 else [tick, until_tick]):
            before[:] = axes
            reached, asking = self._part(axis_count, from_tick, to_tick)
            self._read(axes)
            self._read_edges(before, axes, clk, direction, from_tick)
            if reached < to_tick or asking:
                break
        return reached, asking

    def _part(self, axis_count: int, tick: int, until_tick: int) -> tuple[int, int]:
        arguments = (
            _RESULT, _AXES, _BEFORE, QUEUE, _GROUP, _CLK_ROWS, _DIRECTION_ROWS, axis_count,
            *words64(tick), *words64(until_tick),
        )  # fmt: skip
        self.core.call("advance", arguments)
        result = self.core.read(_RESULT, 12)
        return int.from_bytes(result[:8], "little", signed=True), int.from_bytes(result[8:], "little", signed=True)

    def _write(self, axes: Cells, queue: Cells) -> None:
        self.core.write(_AXES, self._axis.packed(axes))
        self.core.write(QUEUE, self._segment.packed(queue))

    def _read(self, axes: Cells) -> None:
        self._axis.unpack(self.core.read(_AXES, self._axis.size * (len(axes) // k.AXIS_FIELDS)), axes)

    def _read_edges(
        self, before: Cells, axes: Cells, clk: NDArray[np.int64], direction: NDArray[np.int64], tick: int
    ) -> None:
        """Fetch the new edges."""
        for axis in range(len(axes) // k.AXIS_FIELDS):
            for rows, first, field, scale in ((clk, 0, k.CLK_EDGES, 1), (direction, AXES_MAX, k.DIR_EDGES, 2)):
                cell = axis * k.AXIS_FIELDS + field
                old, new = int(before[cell]), int(axes[cell])
                if new > old:
                    row = EDGES + (first + axis) * ROW_BYTES
                    words = np.frombuffer(self.core.read(row + 4 * old, 4 * (new - old)), np.uint32)
                    rows[axis][old:new] = whole_edges(words, scale * tick * k.TICK_COUNTS)


def kernel_of(image: Image) -> Kernel:
    """Return the kernel of an image as the firmware uses it."""
    return kernel_on_arrays("cortex-m3", CoreKernel(image))


@cache
def cortex_m3_kernel() -> Kernel:
    """Build the image and return the kernel on a core; raise CompilerMissingError without the cross compiler."""
    return kernel_of(kernel_image())
