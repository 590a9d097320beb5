"""The hooks that numba compiles; only `engine` imports this, where numba is installed.

The functions are those of the other modules. A compiled hook gets the address of the chip's state from unicorn.
"""

from pathlib import Path
from typing import Any, Final
from zlib import crc32

from numba import carray, cfunc, njit, types
from numba.extending import register_jitable

from steptwin.features.stm32.chip import cells as c
from steptwin.features.stm32.chip import devices, numba_calls, processor

for _each in c.integer_functions:
    register_jitable(_nrt=False)(_each)

_SIZE: Final = c.CELLS
_pointer: Any = types.voidptr
_word: Any = types.uint32
_long: Any = types.uint64
_int: Any = types.int64
_ACCESS: Final = (_pointer, types.int32, _long, types.int32, _int, _pointer)


def _compiled(sources: int) -> tuple[tuple[int, ...], Any, Any]:
    """Return the addresses of the hooks, what runs a chip, and what must be kept.

    numba takes a function from its cache if its own file and what it encloses are the same, but it does not look at the
    functions that it calls. So each function encloses, and uses, a number made of all sources.
    """

    @njit(types.void(_int[::1], _int), cache=True, _nrt=False)
    def run(s: Any, until: int) -> None:
        s[c.SOURCES] = sources
        processor.run(s, until)

    @cfunc(types.void(_pointer, _long, _word, _pointer), cache=True)
    def block(_uc: int, address: int, size: int, state: Any) -> None:
        s = carray(state, _SIZE, _int)
        s[c.SOURCES] = sources
        processor.on_block(s, _int(address), _int(size))

    @cfunc(types.void(_pointer, _word, _pointer), cache=True)
    def exception(_uc: int, number: int, state: Any) -> None:
        s = carray(state, _SIZE, _int)
        s[c.SOURCES] = sources
        processor.on_exception(s, _int(number))

    @cfunc(types.boolean(*_ACCESS), cache=True)
    def unmapped(_uc: int, kind: int, address: int, size: int, value: int, state: Any) -> bool:
        s = carray(state, _SIZE, _int)
        s[c.SOURCES] = sources
        return processor.on_unmapped(s, _int(kind), _int(address), _int(size), value & 0xFFFFFFFF)

    @cfunc(types.void(*_ACCESS), cache=True)
    def access(_uc: int, _kind: int, address: int, _bytes: int, _value: int, state: Any) -> None:
        s = carray(state, _SIZE, _int)
        s[c.SOURCES] = sources
        s[c.ACCESS] = _int(address)

    @cfunc(types.uint64(_pointer, _long, _word, _pointer), cache=True)
    def read(_uc: int, _offset: int, size: int, state: Any) -> int:
        s = carray(state, _SIZE, _int)
        s[c.SOURCES] = sources
        return devices.read(s, s[c.ACCESS], _int(size))

    @cfunc(types.void(_pointer, _long, _word, _long, _pointer), cache=True)
    def write(_uc: int, _offset: int, size: int, value: int, state: Any) -> None:
        s = carray(state, _SIZE, _int)
        s[c.SOURCES] = sources
        devices.write(s, s[c.ACCESS], _int(size), _int(value) & 0xFFFFFFFF)

    hooks = block, exception, unmapped, access, read, write
    return tuple(each.address or 0 for each in hooks), run, (hooks, numba_calls)


_sources: Final = b"".join(path.read_bytes() for path in sorted(Path(__file__).parent.glob("*.py")))
HOOKS, RUN, KEPT = _compiled(crc32(_sources))
