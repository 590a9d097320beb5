"""The kernel's storage as C has it: cells of int64 to structures and back, and the high bits that edges lose in C."""

from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from steptwin.controller.motion.backend import Kernel
from steptwin.emulator.kernel_c.source import Record

Cells: TypeAlias = NDArray[np.int64]


class Layout:
    """Converts the cells of one kind of storage to C structures and back."""

    def __init__(self, record: Record) -> None:
        members = record.members
        self._name = record.name
        self._columns = [(member.name, member.index) for member in members]
        self._fields = len(members)
        self._members = {member.index: member for member in members}
        self._low = np.array([self._members[i].range.low for i in range(self._fields)])
        self._high = np.array([self._members[i].range.high for i in range(self._fields)])
        self.type = np.dtype(
            {
                "names": [member.name for member in members],
                "formats": [member.storage.removesuffix("_t") for member in members],
                "offsets": [member.offset for member in members],
                "itemsize": record.size,
            }
        )

    def packed(self, cells: Cells) -> bytes:
        """Return the structures; raise OverflowError if a cell breaks its promise."""
        table = np.asarray(cells, dtype=np.int64).reshape(-1, self._fields)
        broken = (table < self._low) | (table > self._high)
        if broken.any():
            row, index = (int(place[0]) for place in np.nonzero(broken))
            member = self._members[index]
            raise OverflowError(f"{self._name} {row}: {member.name} is {table[row, index]}, beyond {member.range}")
        structures = np.zeros(len(table), self.type)
        for name, index in self._columns:
            structures[name] = table[:, index]
        return structures.tobytes()

    def unpack(self, data: bytes, cells: Cells) -> None:
        """Write the cells of structures."""
        table = np.asarray(cells).reshape(-1, self._fields)
        structures = np.frombuffer(data, self.type)
        for name, index in self._columns:
            table[:, index] = structures[name]

    @property
    def size(self) -> int:
        """Bytes of one structure."""
        return self.type.itemsize


def whole_edges(words: NDArray[np.uint32], since: int) -> Cells:
    """Return the edges of which C keeps the low 32 bits; none is before `since`, or 2^32 or more after it."""
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
