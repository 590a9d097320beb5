"""Compile the other methods in the same way as the kernel: by numba where it is installed."""

from collections.abc import Callable
from importlib.util import find_spec
from typing import Any, TypeVar, cast

Function = TypeVar("Function", bound=Callable[..., Any])


def compiled(function: Function) -> Function:
    """Return the function compiled by numba, or unchanged without the extra `fast`: same results, 100 times slower."""
    if not find_spec("numba"):
        return function
    import numba

    return cast("Function", numba.njit(cache=True, error_model="numpy")(function))
