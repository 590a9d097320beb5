"""How numba makes the calls of `libunicorn` and `outside`: by the functions' addresses in the state.

So are called, too, the functions of our own that are most of the chip: each is compiled once, not in each caller. Only
`compiled` imports this.
"""

from typing import Any

from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.extending import intrinsic, overload

from steptwin.features.stm32.chip import bus, devices, gpio, nvic
from steptwin.features.stm32.chip import cells as c
from steptwin.features.stm32.chip.libunicorn import (
    read_frame,
    read_memory,
    read_register,
    start,
    stop,
    write_frame,
    write_memory,
    write_register,
)
from steptwin.features.stm32.chip.outside import ask

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
def transfer_frame(_: Any, function: Any, uc: Any, address: Any, place: Any) -> Any:
    def make(_: Any, builder: Any, __: Any, given: Any) -> Any:
        values = [given[1], given[2], given[3], long(32)]
        return builder.sext(call(builder, given[0], [long, long, long, long], values), long)

    return types.int64(types.int64, types.int64, types.int64, types.int64), make


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
    lambda s, register: lambda s, register: transfer_register(s[c.READ_REGISTER], s[c.UC], register, 0) & 0xFFFFFFFF
)


@overload(write_register)
def _(s: Any, register: Any, value: Any) -> Any:
    def write(s: Any, register: Any, value: Any) -> None:
        transfer_register(s[c.WRITE_REGISTER], s[c.UC], register, value)

    return write


overload(read_memory)(
    lambda s, address, size: (
        lambda s, address, size: transfer_memory(s[c.READ_MEMORY], s[c.UC], address, size, 0) & 0xFFFFFFFF
    )
)


@overload(write_memory)
def _(s: Any, address: Any, size: Any, value: Any) -> Any:
    def write(s: Any, address: Any, size: Any, value: Any) -> None:
        transfer_memory(s[c.WRITE_MEMORY], s[c.UC], address, size, value)

    return write


@overload(read_frame)
def _(s: Any, address: Any) -> Any:
    def read(s: Any, address: Any) -> None:
        transfer_frame(s[c.READ_MEMORY], s[c.UC], address, s[c.SELF] + 8 * c.FRAME)

    return read


@overload(write_frame)
def _(s: Any, address: Any) -> Any:
    def write(s: Any, address: Any) -> None:
        transfer_frame(s[c.WRITE_MEMORY], s[c.UC], address, s[c.SELF] + 8 * c.FRAME)

    return write


overload(start)(lambda s, pc: lambda s, pc: call_start(s[c.START], s[c.UC], pc | 1, 0xFFFFFFFE))


@overload(stop)
def _(s: Any) -> Any:
    def halt(s: Any) -> None:
        s[c.STOPPED] = 1
        call_stop(s[c.STOP], s[c.UC])

    return halt


@intrinsic
def call_outside(_: Any, function: Any, question: Any, number: Any, value: Any) -> Any:
    def make(_: Any, builder: Any, __: Any, given: Any) -> Any:
        pointer = builder.inttoptr(given[0], ir.FunctionType(long, [long] * 3).as_pointer())
        return builder.call(pointer, list(given[1:]))

    return types.int64(types.int64, types.int64, types.int64, types.int64), make


overload(ask)(
    lambda s, question, number, value: (
        lambda s, question, number, value: call_outside(s[c.ANSWERS], question, number, value)
    )
)


@intrinsic
def call_function(_: Any, function: Any, state: Any, first: Any, second: Any, third: Any) -> Any:
    def make(_: Any, builder: Any, __: Any, given: Any) -> Any:
        pointer = builder.inttoptr(given[0], ir.FunctionType(long, [long] * 4).as_pointer())
        return builder.call(pointer, list(given[1:]))

    return types.int64(types.int64, types.int64, types.int64, types.int64, types.int64), make


overload(devices.act)(lambda s: lambda s: call_function(s[c.ACT], s[c.SELF], 0, 0, 0))
overload(devices.serve_events)(lambda s: lambda s: call_function(s[c.SERVE_EVENTS], s[c.SELF], 0, 0, 0))
overload(bus.read)(
    lambda s, address, size: (
        lambda s, address, size: call_function(s[c.BUS_READ], s[c.SELF], address, size, 0) & 0xFFFFFFFF
    )
)
overload(bus.write)(
    lambda s, address, size, value: (
        lambda s, address, size, value: call_function(s[c.BUS_WRITE], s[c.SELF], address, size, value)
    )
)
overload(nvic.pend)(lambda s, irq: lambda s, irq: call_function(s[c.PEND], s[c.SELF], irq, 0, 0))
overload(gpio.refresh)(lambda s, port: lambda s, port: call_function(s[c.REFRESH], s[c.SELF], port, 0, 0))
