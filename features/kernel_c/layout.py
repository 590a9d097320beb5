"""The motion kernel once more, in C11: the files of `steptwin kernel-c`, and its structures for those who call it.

It is here and not on the host or in the bench, because the emulated core executes it, and both the command line
(through the twin) and the bench may import it. The kernel's storage as C has it: cells of int64 to structures and back,
and the high bits that edges lose in C.
"""

import re
from importlib.resources import files
from typing import Any, Final, TypeAlias

import numpy as np
from numpy.typing import NDArray

from steptwin.controller.motion import kernel as k
from steptwin.controller.motion.backend import Kernel

HEADER: Final = "steptwin_kernel.h"
BODY: Final = "steptwin_kernel.c"
MEMORY_COPY: Final = "memory.c"
"""memcpy, which gcc calls on its own."""
_FILES: Final = (HEADER, BODY, "README.md", "main.c", MEMORY_COPY)
Cells: TypeAlias = NDArray[np.int64]
_PREFIX: Final = {"axis": "", "segment": "SEGMENT_", "group": ""}
"""What the names of the cells begin with in the kernel, by the structure's name, and do not in C."""
_MEMBER: Final = re.compile(r"^ {4}(u?int\d+)_t (\w+);", re.MULTILINE)


def kernel_files() -> dict[str, str]:
    """Return the text of each file by its name: header, source, memcpy, an example, and a README with the limits."""
    folder = files(__package__)
    return {name: (folder / name).read_text(encoding="utf-8") for name in _FILES}


class Layout:
    """Converts the cells of one kind of storage, "axis", "segment" or "group", to C structures and back."""

    def __init__(self, name: str) -> None:
        declared = re.search(rf"typedef struct {{\n([^}}]*)}} st_{name};", kernel_files()[HEADER])
        assert declared
        members = [(member, kind) for kind, member in _MEMBER.findall(declared[1])]
        self._name = name
        self._columns = {member: int(getattr(k, _PREFIX[name] + member.upper())) for member, _ in members}
        in_order = sorted(members, key=lambda member: self._columns[member[0]])
        self._low = np.array([np.iinfo(kind).min for _, kind in in_order])
        self._high = np.array([np.iinfo(kind).max for _, kind in in_order])
        self.type: np.dtype[np.void] = np.dtype(members, align=True)
        """The structure."""

    def packed(self, cells: Cells) -> bytes:
        """Return the structures; raise OverflowError if a cell does not fit its member."""
        table = np.asarray(cells, dtype=np.int64).reshape(-1, len(self._columns))
        broken = (table < self._low) | (table > self._high)
        if broken.any():
            row, column = (int(place[0]) for place in np.nonzero(broken))
            member = next(name for name, index in self._columns.items() if index == column)
            raise OverflowError(f"{self._name} {row}: {member} is {table[row, column]}, beyond {self.type[member]}")
        structures = np.zeros(len(table), self.type)
        for member, column in self._columns.items():
            structures[member] = table[:, column]
        return structures.tobytes()

    def unpack(self, data: bytes, cells: Cells) -> None:
        """Write the cells of structures."""
        table = np.asarray(cells).reshape(-1, len(self._columns))
        structures = np.frombuffer(data, self.type)
        for member, column in self._columns.items():
            table[:, column] = structures[member]

    @property
    def size(self) -> int:
        """Bytes of one structure."""
        return self.type.itemsize


def whole_edges(words: NDArray[np.uint32], since: int) -> Cells:
    """Return the edges whose low 32 bits C keeps; none is before `since`, or 2^32 or more after it."""
    after: NDArray[np.uint32] = words - np.uint32(since & 0xFFFF_FFFF)
    return after.astype(np.int64) + since


def kernel_on_arrays(name: str, functions: Any) -> Kernel:
    """Return a kernel whose storage is arrays of int64, and whose functions are the methods of an object."""
    return Kernel(
        name=name,
        cells=lambda count: np.zeros(count, dtype=np.int64),
        rows=lambda rows, count: np.zeros((rows, count), dtype=np.int64),
        singly=memoryview,
        push=functions.push,
        next_segment=functions.next_segment,
        advance=functions.advance,
        demand_rate=functions.demand_rate,
    )
