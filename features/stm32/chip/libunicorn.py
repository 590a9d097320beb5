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


def read_frame(s: Cells, address: int) -> None:
    """Copy 32 bytes of the memory to the frame."""
    place = s[c.SELF] + 8 * c.FRAME
    _function(s[c.READ_MEMORY], _POINTER, _LONG, _POINTER, _LONG)(s[c.UC], address, place, 32)


def write_frame(s: Cells, address: int) -> None:
    """Copy the 32 bytes of the frame to the memory."""
    place = s[c.SELF] + 8 * c.FRAME
    _function(s[c.WRITE_MEMORY], _POINTER, _LONG, _POINTER, _LONG)(s[c.UC], address, place, 32)


def start(s: Cells, pc: int) -> int:
    """Let unicorn execute instructions until a hook stops it; return its error, 0 for none."""
    error: int = _function(s[c.START], _POINTER, _LONG, _LONG, _LONG, _LONG)(s[c.UC], pc | 1, 0xFFFFFFFE, 0, 0)
    return error


def stop(s: Cells) -> None:
    """Stop unicorn before the block whose hook calls this."""
    s[c.STOPPED] = 1
    _function(s[c.STOP], _POINTER)(s[c.UC])
