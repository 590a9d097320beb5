"""The hooks that numba compiles; only `engine` imports this, where numba is installed.

The functions are those of the other modules. A compiled hook gets the address of the chip's state from unicorn.
"""

from typing import Any, Final

from numba import carray, cfunc, njit, types
from numba.extending import register_jitable

from steptwin.features.stm32.chip import bus, processor
from steptwin.features.stm32.chip import cells as c
from steptwin.features.stm32.chip.libunicorn import overload_for_numba

overload_for_numba()
for _each in c.integer_functions:
    register_jitable(_nrt=False)(_each)

_SIZE: Final = c.CELLS
_SPACE: Final = 0xE0000000
_STATE: Final = types.int64[::1]
_pointer, _word, _long, _int = types.voidptr, types.uint32, types.uint64, types.int64


@njit(_int(_STATE, _int, _int, _int), cache=True, _nrt=False)
def _read_region(s: Any, region: int, offset: int, size: int) -> int:
    if region == 3:
        return bus.read_memory_bit(s, offset)
    bus.arrive(s)
    if region == 2:
        return bus.read_bit(s, offset)
    return bus.read(s, offset + (_SPACE if region == 1 else c.PERIPHERALS), size)


@njit(types.void(_STATE, _int, _int, _int, _int), cache=True, _nrt=False)
def _write_region(s: Any, region: int, offset: int, size: int, value: int) -> None:
    if region == 3:
        bus.write_memory_bit(s, offset, value)
        return
    bus.arrive(s)
    if region == 2:
        bus.write_bit(s, offset, value)
    else:
        bus.write(s, offset + (_SPACE if region == 1 else c.PERIPHERALS), size, value & 0xFFFFFFFF)


@njit(types.void(_STATE, _int), cache=True, _nrt=False)
def run(s: Any, until: int) -> None:
    """Run as `processor.run`."""
    processor.run(s, until)


@cfunc(types.void(_pointer, _long, _word, _pointer), cache=True)
def _block(_uc: int, address: int, size: int, state: int) -> None:
    processor.on_block(carray(state, _SIZE, types.int64), types.int64(address), types.int64(size))


@cfunc(types.void(_pointer, _word, _pointer), cache=True)
def _exception(_uc: int, number: int, state: int) -> None:
    processor.on_exception(carray(state, _SIZE, types.int64), types.int64(number))


_ACCESS: Final = (_pointer, types.int32, _long, types.int32, types.int64, _pointer)


@cfunc(types.boolean(*_ACCESS), cache=True)
def _unmapped(_uc: int, _kind: int, address: int, _bytes: int, _value: int, state: int) -> bool:
    processor.on_unmapped(carray(state, _SIZE, types.int64), types.int64(address))
    return False


@cfunc(types.void(*_ACCESS), cache=True)
def _touched(_uc: int, _kind: int, _address: int, _bytes: int, _value: int, _state: int) -> None:
    return


_READ: Final = types.uint64(_pointer, _long, _word, _pointer)
_WRITE: Final = types.void(_pointer, _long, _word, _long, _pointer)


@cfunc(_READ, cache=True)
def _read_peripheral(_uc: int, offset: int, size: int, state: int) -> int:
    return _read_region(carray(state, _SIZE, types.int64), 0, types.int64(offset), types.int64(size))


@cfunc(_READ, cache=True)
def _read_space(_uc: int, offset: int, size: int, state: int) -> int:
    return _read_region(carray(state, _SIZE, types.int64), 1, types.int64(offset), types.int64(size))


@cfunc(_READ, cache=True)
def _read_alias(_uc: int, offset: int, size: int, state: int) -> int:
    return _read_region(carray(state, _SIZE, types.int64), 2, types.int64(offset), types.int64(size))


@cfunc(_READ, cache=True)
def _read_memory_alias(_uc: int, offset: int, size: int, state: int) -> int:
    return _read_region(carray(state, _SIZE, types.int64), 3, types.int64(offset), types.int64(size))


@cfunc(_WRITE, cache=True)
def _write_peripheral(_uc: int, offset: int, size: int, value: int, state: int) -> None:
    s = carray(state, _SIZE, types.int64)
    _write_region(s, 0, types.int64(offset), types.int64(size), types.int64(value))


@cfunc(_WRITE, cache=True)
def _write_space(_uc: int, offset: int, size: int, value: int, state: int) -> None:
    s = carray(state, _SIZE, types.int64)
    _write_region(s, 1, types.int64(offset), types.int64(size), types.int64(value))


@cfunc(_WRITE, cache=True)
def _write_alias(_uc: int, offset: int, size: int, value: int, state: int) -> None:
    s = carray(state, _SIZE, types.int64)
    _write_region(s, 2, types.int64(offset), types.int64(size), types.int64(value))


@cfunc(_WRITE, cache=True)
def _write_memory_alias(_uc: int, offset: int, size: int, value: int, state: int) -> None:
    s = carray(state, _SIZE, types.int64)
    _write_region(s, 3, types.int64(offset), types.int64(size), types.int64(value))


BLOCK, EXCEPTION, UNMAPPED, TOUCHED = _block.address, _exception.address, _unmapped.address, _touched.address
READS: Final = tuple(each.address for each in (_read_peripheral, _read_space, _read_alias, _read_memory_alias))
WRITES: Final = tuple(each.address for each in (_write_peripheral, _write_space, _write_alias, _write_memory_alias))
