"""The kernel's C compiled for this machine and called through ctypes.

`python -m tests.emulator.kernel_c.native_kernel LIBRARY FIRST LAST` plays scenarios on it and prints their digest: in
a process of its own, which gcc's sanitizer may end.
"""

import ctypes
import sys
from hashlib import sha256
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from steptwin.controller.motion import kernel as k
from steptwin.controller.motion.backend import Kernel
from steptwin.emulator.cortex_m3.layout import Cells, Layout, kernel_on_arrays, whole_edges
from steptwin.emulator.kernel_c.source import kernel_source
from tests.emulator.kernel_c.scenarios import play, scenario


class _Result(ctypes.Structure):
    _fields_ = (("reached", ctypes.c_int64), ("asking", ctypes.c_int32))


class NativeKernel:
    """The functions of a shared library; each call copies the storage there and back."""

    def __init__(self, library: Path) -> None:
        records = kernel_source().records
        self._axis, self._segment, self._group = (Layout(records[name]) for name in ("axis", "segment", "group"))
        self._c = ctypes.CDLL(str(library))
        self._c.st_next_segment.restype = ctypes.c_bool
        self._c.st_demand_rate.restype = ctypes.c_int64
        self._c.st_advance.restype = _Result

    def push(self, axes: Cells, queue: Cells, *segment: int) -> int:
        """See the kernel."""
        there, queued = _buffer(self._axis, axes), _buffer(self._segment, queue)
        answer = self._c.st_push(there, queued, *(ctypes.c_int32(value) for value in segment))
        self._axis.unpack(there.raw, axes)
        self._segment.unpack(queued.raw, queue)
        return int(answer)

    def next_segment(self, axes: Cells, queue: Cells, axis: int) -> bool:
        """See the kernel."""
        there = _buffer(self._axis, axes)
        taken = self._c.st_next_segment(there, _buffer(self._segment, queue), axis)
        self._axis.unpack(there.raw, axes)
        return bool(taken)

    def demand_rate(self, axes: Cells, axis: int) -> int:
        """See the kernel."""
        return int(self._c.st_demand_rate(_buffer(self._axis, axes), axis))

    def advance(
        self, axes: Cells, before: Cells, queue: Cells, group: Cells, clk: Any, direction: Any, *times: int
    ) -> tuple[int, int]:
        """See the kernel."""
        axis_count, tick, until_tick = times
        before[:] = axes
        there, copy = _buffer(self._axis, axes), ctypes.create_string_buffer(axis_count * self._axis.size)
        rows = [np.empty(row.shape, np.uint32) for row in (clk, direction)]
        result = self._c.st_advance(
            there,
            copy,
            _buffer(self._segment, queue),
            _buffer(self._group, group),
            *(_row_pointers(row) for row in rows),
            axis_count,
            ctypes.c_int64(tick),
            ctypes.c_int64(until_tick),
        )
        self._axis.unpack(there.raw, axes)
        for own, words, field, scale in ((clk, rows[0], k.CLK_EDGES, 1), (direction, rows[1], k.DIR_EDGES, 2)):
            for axis in range(axis_count):
                new = slice(*(int(cells[axis * k.AXIS_FIELDS + field]) for cells in (before, axes)))
                own[axis][new] = whole_edges(words[axis][new], scale * tick * k.TICK_COUNTS)
        return int(result.reached), int(result.asking)


def _buffer(layout: Layout, cells: Cells) -> "ctypes.Array[ctypes.c_char]":
    structures = layout.packed(cells)
    return ctypes.create_string_buffer(structures, len(structures))


def _row_pointers(rows: NDArray[np.uint32]) -> "ctypes.Array[ctypes.c_void_p]":
    return (ctypes.c_void_p * len(rows))(*(row.ctypes.data for row in rows))


def native_kernel(library: Path) -> Kernel:
    """Return the kernel of a shared library as the firmware uses it."""
    return kernel_on_arrays("native", NativeKernel(library))


def digest(kernel: Kernel, seeds: range) -> str:
    """Return the SHA-256 of what a kernel answers and places in some scenarios, each whole and tick by tick."""
    found = sha256()
    for seed in seeds:
        told = scenario(seed)
        found.update(repr([play(kernel, told, ticks) for ticks in (1 << 20, 1)]).encode())
    return found.hexdigest()


if __name__ == "__main__":
    sys.stdout.write(digest(native_kernel(Path(sys.argv[1])), range(int(sys.argv[2]), int(sys.argv[3]))))
