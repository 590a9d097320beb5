"""Calls of libunicorn's functions: by ctypes in plain Python, by their addresses in the state in numba.

numba does not cache functions that hold ctypes' pointers; it does cache those that call an address out of an array.
"""

import ctypes
from functools import cache
from typing import Any

from steptwin.features.stm32.chip import cells as c
from steptwin.features.stm32.chip.cells import Cells


@cache
def library() -> Any:
    """Return libunicorn as the package `unicorn` has loaded it; raises ModuleNotFoundError without the extra `m3`."""
    from unicorn.unicorn_py3 import unicorn

    return unicorn.uclib


FUNCTIONS = {
    c.READ_REGISTER: "uc_reg_read",
    c.WRITE_REGISTER: "uc_reg_write",
    c.READ_MEMORY: "uc_mem_read",
    c.WRITE_MEMORY: "uc_mem_write",
    c.START: "uc_emu_start",
    c.STOP: "uc_emu_stop",
}
"""The cells of the functions' addresses, and the functions."""


def address_of(name: str) -> int:
    """Return the address of one of the library's functions."""
    return ctypes.cast(getattr(library(), name), ctypes.c_void_p).value or 0


@cache
def _function(address: int, *arguments: Any) -> Any:
    return ctypes.CFUNCTYPE(ctypes.c_int, *arguments)(address)


_POINTER, _INT, _LONG = ctypes.c_void_p, ctypes.c_int, ctypes.c_uint64


def read_register(s: Cells, register: int) -> int:
    """Return a register of the processor."""
    value = ctypes.c_uint32()
    _function(s[c.READ_REGISTER], _POINTER, _INT, _POINTER)(s[c.UC], register, ctypes.byref(value))
    return value.value


def write_register(s: Cells, register: int, value: int) -> None:
    """Set a register of the processor."""
    word = ctypes.c_uint32(value)
    _function(s[c.WRITE_REGISTER], _POINTER, _INT, _POINTER)(s[c.UC], register, ctypes.byref(word))


def read_memory(s: Cells, address: int, size: int) -> int:
    """Return 1 to 4 bytes of the memory as an integer."""
    value = ctypes.c_uint32()
    _function(s[c.READ_MEMORY], _POINTER, _LONG, _POINTER, _LONG)(s[c.UC], address, ctypes.byref(value), size)
    return value.value


def write_memory(s: Cells, address: int, size: int, value: int) -> None:
    """Set 1 to 4 bytes of the memory."""
    word = ctypes.c_uint32(value)
    _function(s[c.WRITE_MEMORY], _POINTER, _LONG, _POINTER, _LONG)(s[c.UC], address, ctypes.byref(word), size)


def start(s: Cells, pc: int) -> int:
    """Let unicorn execute instructions until a hook stops it; return its error, 0 for none."""
    error: int = _function(s[c.START], _POINTER, _LONG, _LONG, _LONG, _LONG)(s[c.UC], pc | 1, 0xFFFFFFFE, 0, 0)
    return error


def stop(s: Cells) -> None:
    """Stop unicorn before the block whose hook calls this."""
    s[c.STOPPED] = 1
    _function(s[c.STOP], _POINTER)(s[c.UC])


def overload_for_numba() -> None:
    """Tell numba how to make these calls; raises ModuleNotFoundError without the extra `fast`."""
    from llvmlite import ir
    from numba import types
    from numba.core import cgutils
    from numba.extending import intrinsic, overload

    long, word, byte = ir.IntType(64), ir.IntType(32), ir.IntType(8)

    def call(builder: Any, address: Any, kinds: list[Any], values: list[Any]) -> Any:
        pointer = builder.inttoptr(address, ir.FunctionType(word, kinds).as_pointer())
        return builder.call(pointer, values)

    def pointer_to(builder: Any, value: Any) -> Any:
        place = cgutils.alloca_once(builder, long)
        builder.store(value, place)
        return place, builder.bitcast(place, byte.as_pointer())

    @intrinsic
    def transfer_register(_: Any, function: Any, uc: Any, register: Any, value: Any) -> Any:
        def make(_: Any, builder: Any, __: Any, given: Any) -> Any:
            place, pointer = pointer_to(builder, given[3])
            values = [given[1], builder.trunc(given[2], word), pointer]
            call(builder, given[0], [long, word, byte.as_pointer()], values)
            return builder.load(place)

        return types.int64(types.int64, types.int64, types.int64, types.int64), make

    @intrinsic
    def transfer_memory(_: Any, function: Any, uc: Any, address: Any, size: Any, value: Any) -> Any:
        def make(_: Any, builder: Any, __: Any, given: Any) -> Any:
            place, pointer = pointer_to(builder, given[4])
            values = [given[1], given[2], pointer, given[3]]
            call(builder, given[0], [long, long, byte.as_pointer(), long], values)
            return builder.load(place)

        return types.int64(types.int64, types.int64, types.int64, types.int64, types.int64), make

    @intrinsic
    def call_start(_: Any, function: Any, uc: Any, begin: Any, end: Any) -> Any:
        def make(_: Any, builder: Any, __: Any, given: Any) -> Any:
            zero = long(0)
            error = call(builder, given[0], [long] * 5, [*given[1:4], zero, zero])
            return builder.sext(error, long)

        return types.int64(types.int64, types.int64, types.int64, types.int64), make

    @intrinsic
    def call_stop(_: Any, function: Any, uc: Any) -> Any:
        def make(_: Any, builder: Any, __: Any, given: Any) -> Any:
            return builder.sext(call(builder, given[0], [long], [given[1]]), long)

        return types.int64(types.int64, types.int64), make

    overload(read_register)(
        lambda s, register: lambda s, register: (
            transfer_register(s[c.READ_REGISTER], s[c.UC], register, 0) & 0xFFFFFFFF
        )
    )

    @overload(write_register)
    def _(s: Any, register: Any, value: Any) -> Any:
        def write(s: Any, register: Any, value: Any) -> None:
            transfer_register(s[c.WRITE_REGISTER], s[c.UC], register, value)

        return write

    overload(read_memory)(
        lambda s, address, size: lambda s, address, size: (
            transfer_memory(s[c.READ_MEMORY], s[c.UC], address, size, 0) & 0xFFFFFFFF
        )
    )

    @overload(write_memory)
    def _(s: Any, address: Any, size: Any, value: Any) -> Any:
        def write(s: Any, address: Any, size: Any, value: Any) -> None:
            transfer_memory(s[c.WRITE_MEMORY], s[c.UC], address, size, value)

        return write

    overload(start)(lambda s, pc: lambda s, pc: call_start(s[c.START], s[c.UC], pc | 1, 0xFFFFFFFE))

    @overload(stop)
    def _(s: Any) -> Any:
        def halt(s: Any) -> None:
            s[c.STOPPED] = 1
            call_stop(s[c.STOP], s[c.UC])

        return halt
