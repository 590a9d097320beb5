"""The hooks that numba compiles; only `engine` imports this, where numba is installed.

The functions are those of the other modules. A compiled hook gets the address of the chip's state from unicorn.
"""

from pathlib import Path
from types import FunctionType
from typing import Any, Final
from zlib import crc32

from numba import carray, cfunc, njit, types
from numba.extending import register_jitable

from steptwin.features.stm32.chip import bus, devices, gpio, numba_calls, nvic, processor
from steptwin.features.stm32.chip import cells as c


def _body(function: Any) -> Any:
    """Return a copy of a function, which is compiled in its place; `numba_calls` calls the function by its address."""
    return FunctionType(function.__code__, function.__globals__, f"{function.__name__}_body")


_CALLED: Final = (devices.act, devices.serve_events, bus.read, bus.write, nvic.pend, gpio.refresh)
_act, _serve_events, _bus_read, _bus_write, _pend, _refresh = _bodies = tuple(map(_body, _CALLED))
for _each in (*c.integer_functions, *_bodies):
    if _each not in _CALLED:
        register_jitable(_nrt=False)(_each)

_SIZE: Final = c.CELLS
_pointer: Any = types.voidptr
_word: Any = types.uint32
_long: Any = types.uint64
_int: Any = types.int64
_FUNCTION: Final = _int(_pointer, _int, _int, _int)
_ACCESS: Final = (_pointer, types.int32, _long, types.int32, _int, _pointer)


def _compiled(sources: int) -> tuple[tuple[int, ...], Any, dict[int, int], Any]:  # noqa: PLR0915  (each is simple)
    """Return the addresses of the hooks, what runs a chip, addresses for its state, and what must be kept.

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

    @cfunc(types.void(_pointer, _long, _word, _pointer), cache=True)
    def instruction(_uc: int, address: int, _size: int, state: Any) -> None:
        s = carray(state, _SIZE, _int)
        s[c.SOURCES] = sources
        processor.on_instruction(s, _int(address))

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

    @cfunc(_FUNCTION, cache=True)
    def act(state: Any, _first: int, _second: int, _third: int) -> int:
        s = carray(state, _SIZE, _int)
        s[c.SOURCES] = sources
        _act(s)
        return 0

    @cfunc(_FUNCTION, cache=True)
    def serve_events(state: Any, _first: int, _second: int, _third: int) -> int:
        s = carray(state, _SIZE, _int)
        s[c.SOURCES] = sources
        _serve_events(s)
        return 0

    @cfunc(_FUNCTION, cache=True)
    def bus_read(state: Any, address: int, size: int, _third: int) -> int:
        s = carray(state, _SIZE, _int)
        s[c.SOURCES] = sources
        return _bus_read(s, address, size)

    @cfunc(_FUNCTION, cache=True)
    def bus_write(state: Any, address: int, size: int, value: int) -> int:
        s = carray(state, _SIZE, _int)
        s[c.SOURCES] = sources
        _bus_write(s, address, size, value)
        return 0

    @cfunc(_FUNCTION, cache=True)
    def pend(state: Any, irq: int, _second: int, _third: int) -> int:
        s = carray(state, _SIZE, _int)
        s[c.SOURCES] = sources
        _pend(s, irq)
        return 0

    @cfunc(_FUNCTION, cache=True)
    def refresh(state: Any, port: int, _second: int, _third: int) -> int:
        s = carray(state, _SIZE, _int)
        s[c.SOURCES] = sources
        _refresh(s, port)
        return 0

    hooks = block, exception, unmapped, access, read, write, instruction
    called = {
        c.ACT: act,
        c.SERVE_EVENTS: serve_events,
        c.BUS_READ: bus_read,
        c.BUS_WRITE: bus_write,
        c.PEND: pend,
        c.REFRESH: refresh,
    }
    addresses = {cell: each.address or 0 for cell, each in called.items()}
    return tuple(each.address or 0 for each in hooks), run, addresses, (hooks, called, numba_calls)


_sources: Final = b"".join(path.read_bytes() for path in sorted(Path(__file__).parent.glob("*.py")))
HOOKS, RUN, CALLED, KEPT = _compiled(crc32(_sources))
