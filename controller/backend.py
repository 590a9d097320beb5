"""How the kernel runs: as plain Python on lists, or compiled by numba on int64 arrays, with the same bits."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from importlib.util import find_spec
from typing import Any, cast

from steptwin.controller import kernel
from steptwin.controller.kernel import Cells, Function, Rows


@dataclass(frozen=True, slots=True)
class Kernel:
    """The kernel's functions together with the storage that they run on.

    Attributes:
        name: "python" or "numba".
        cells: makes n zeroed integers.
        rows: makes a number of rows of n zeroed integers.
        singly: the same storage as made by `cells`, for reading and writing one integer at a time.
    """

    name: str
    cells: Callable[[int], Cells]
    rows: Callable[[int, int], Rows]
    singly: Callable[[Cells], Cells]
    push: Callable[[Cells, Cells, int, int, int, int], int]
    next_segment: Callable[[Cells, Cells, int], bool]
    advance: Callable[[Cells, Cells, Cells, Cells, Rows, Rows, int, int, int], tuple[int, int]]
    demand_rate: Callable[[Cells, int], int]


def python_kernel() -> Kernel:
    """The reference: unbounded integers on lists."""
    return Kernel(
        name="python",
        cells=lambda count: [0] * count,
        rows=lambda rows, count: [[0] * count for _ in range(rows)],
        singly=lambda cells: cells,
        push=kernel.push,
        next_segment=kernel.next_segment,
        advance=kernel.advance,
        demand_rate=kernel.demand_rate,
    )


@cache
def compiled_kernel() -> Kernel:
    """The same functions compiled for int64 arrays; raises ModuleNotFoundError without the extra `fast`."""
    import numba
    import numpy as np

    integer, cells, rows = numba.int64, numba.int64[::1], numba.int64[:, ::1]

    def compiled(function: Function, *arguments: Any) -> Function:
        """Compile now, or load what an earlier process has compiled: the first call takes no longer than the others."""
        # The numpy error model leaves out checks for division by zero: every divisor in the kernel is positive.
        dispatcher = numba.njit(arguments, cache=True, error_model="numpy")(function)
        return cast("Function", dispatcher.get_overload(arguments))

    return Kernel(
        name="numba",
        cells=lambda count: np.zeros(count, dtype=np.int64),
        rows=lambda rows, count: np.zeros((rows, count), dtype=np.int64),
        singly=memoryview,  # an element of an array is an object of numpy's first, which takes twice as long
        push=compiled(kernel.push, cells, cells, *4 * (integer,)),
        next_segment=compiled(kernel.next_segment, cells, cells, integer),
        advance=compiled(kernel.advance, *4 * (cells,), rows, rows, *3 * (integer,)),
        demand_rate=compiled(kernel.demand_rate, cells, integer),
    )


KERNELS: dict[str, Callable[[], Kernel]] = {"python": python_kernel, "numba": compiled_kernel}


def fastest_kernel() -> Kernel:
    """The compiled kernel where numba is installed, the plain one elsewhere."""
    return compiled_kernel() if find_spec("numba") else python_kernel()
