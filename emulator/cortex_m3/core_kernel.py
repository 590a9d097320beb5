"""The kernel on the emulated core, as a third form beside plain Python and numba.

The storage stays where the firmware's Python finds it, in arrays of int64. Each call copies it into the core's memory,
as the structures of the C interface, and back; so nothing but the call's arguments decides its result.
"""

from functools import cache
from itertools import pairwise
from typing import Final

import numpy as np
from numpy.typing import NDArray

from steptwin.controller.motion import kernel as k
from steptwin.controller.motion.backend import Kernel
from steptwin.emulator.cortex_m3.core import EDGES, RAM, ROW_BYTES, ROWS, Core, signed, words64
from steptwin.emulator.cortex_m3.image import Image, kernel_image
from steptwin.emulator.kernel_c.layout import Cells, Layout, kernel_on_arrays, whole_edges

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
