"""Run the kernel as plain Python on lists, or compiled by numba on int64 arrays. Both give identical results."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from importlib.util import find_spec
from typing import Any, cast

from steptwin.controller.motion import kernel
from steptwin.controller.motion.kernel import Cells, Function, Rows


@dataclass(frozen=True, slots=True)
class Kernel:
    """The kernel's functions, and constructors of their storage.

    Attributes:
        name: "python" or "numba".
        cells: returns n integers, all 0.
        rows: returns rows of n integers, all 0.
        singly: returns a view of `cells` that is fast for access to single integers.
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
    """Return the reference kernel, which uses lists of unbounded integers."""
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


def inline_kernel_functions() -> None:
    """Register all marked functions with numba; raise ModuleNotFoundError without the extra `fast`.

    They are inlined and compiled without numba's runtime, because they allocate nothing. Reference counting of the
    arrays at every call would take as long as the evaluation of a tick.
    """
    from numba.extending import register_jitable

    inlined = register_jitable(forceinline=True, _nrt=False)
    while kernel.kernel_functions:
        inlined(kernel.kernel_functions.pop())


@cache
def compiled_kernel() -> Kernel:
    """Return the kernel compiled for int64 arrays; raise ModuleNotFoundError without the extra `fast`."""
    import numba
    import numpy as np

    inline_kernel_functions()
    integer, cells, rows = numba.int64, numba.int64[::1], numba.int64[:, ::1]

    def compiled(function: Function, *arguments: Any) -> Function:
        """Compile a function now, or load it from numba's cache, so the first call is not slower."""
        # The numpy error model omits checks for division by zero: every divisor in the kernel is positive.
        dispatcher = numba.njit(arguments, cache=True, error_model="numpy")(function)
        return cast("Function", dispatcher.get_overload(arguments))

    return Kernel(
        name="numba",
        cells=lambda count: np.zeros(count, dtype=np.int64),
        rows=lambda rows, count: np.zeros((rows, count), dtype=np.int64),
        singly=memoryview,  # numpy creates an object for every element read, which takes twice as long
        push=compiled(kernel.push, cells, cells, *4 * (integer,)),
        next_segment=compiled(kernel.next_segment, cells, cells, integer),
        advance=compiled(kernel.advance, *4 * (cells,), rows, rows, *3 * (integer,)),
        demand_rate=compiled(kernel.demand_rate, cells, integer),
    )


KERNELS: dict[str, Callable[[], Kernel]] = {"python": python_kernel, "numba": compiled_kernel}


def fastest_kernel() -> Kernel:
    """Return the compiled kernel if numba is installed, else the reference kernel."""
    return compiled_kernel() if find_spec("numba") else python_kernel()
