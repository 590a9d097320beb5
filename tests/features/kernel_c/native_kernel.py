"""The kernel's C compiled for this machine, by gcc with its sanitizer and all bounds checked, and called by ctypes.

What is undefined or breaks a bound ends the process, with a message that names the line. `python -m
tests.features.kernel_c.native_kernel LIBRARY` plays eight scenarios on a library, one with values at the limits of i32.
"""

import ctypes
import shutil
import subprocess
import sys
from functools import cache
from pathlib import Path
from tempfile import mkdtemp
from typing import Any

import numpy as np
from numpy.typing import NDArray

from steptwin.controller.motion import kernel as k
from steptwin.controller.motion.backend import Kernel
from steptwin.features.kernel_c.image import WARNINGS, CompilerMissingError
from steptwin.features.kernel_c.layout import BODY, Cells, Layout, kernel_files, kernel_on_arrays, whole_edges
from tests.features.kernel_c.scenarios import play, scenario

CHECKED = ("-fsanitize=undefined", "-fno-sanitize-recover=all", "-include", "assert.h", "-DST_ASSERT=assert")


def library(source: Path, *options: str) -> Path:
    """Compile a source file beside the kernel's header to a library; raise CompilerMissingError without gcc."""
    if shutil.which("gcc") is None or sys.platform != "linux":
        raise CompilerMissingError("gcc for Linux is not installed")
    made = source.with_suffix(".so")
    command: list[str | Path] = ["gcc", *WARNINGS, "-O1", "-shared", "-fPIC", *options, source, "-o", made]
    subprocess.run(command, check=True)
    return made


@cache
def native_kernel() -> Kernel:
    """Return the kernel's C on this machine, checked, as the firmware uses it."""
    folder = Path(mkdtemp(prefix="steptwin-kernel-"))
    try:
        for name, text in kernel_files().items():
            (folder / name).write_text(text, encoding="utf-8")
        return kernel_of_library(library(folder / BODY, *CHECKED))
    finally:
        shutil.rmtree(folder)


def kernel_of_library(path: Path) -> Kernel:
    """Return the kernel of a library as the firmware uses it."""
    return kernel_on_arrays("c", NativeKernel(path))


class _Result(ctypes.Structure):
    _fields_ = (("reached", ctypes.c_int64), ("asking", ctypes.c_int32))


class NativeKernel:
    """The functions of a library; each call copies the storage there and back."""

    def __init__(self, path: Path) -> None:
        self._axis, self._segment, self._group = map(Layout, ("axis", "segment", "group"))
        self._c = ctypes.CDLL(str(path))
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


if __name__ == "__main__":
    for seed in range(8):
        play(kernel_of_library(Path(sys.argv[1])), scenario(seed), 1)
