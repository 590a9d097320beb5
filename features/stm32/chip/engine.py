"""unicorn and the functions around it: memory, hooks, and the stretch of time that is run."""

import ctypes
from collections.abc import Callable, Mapping, Sequence
from functools import cache
from importlib.util import find_spec
from typing import Any, Final, NamedTuple

import numpy as np

from steptwin.features.stm32.chip import bus, devices, gpio, outside, processor, timers, usarts
from steptwin.features.stm32.chip import cells as c
from steptwin.features.stm32.chip.cells import Cells
from steptwin.features.stm32.chip.clocks import HSI_HZ
from steptwin.features.stm32.chip.libunicorn import FUNCTIONS, address_of, library
from steptwin.features.stm32.chip.nvic import SP
from steptwin.features.stm32.chip.registers import RESET_PRIORITIES, place_registers
from steptwin.host.common.arrays import Int64Array

RAM_START: Final = 0x20000000
_SYSTEM_MEMORY: Final = 0x1FFFF000
_PERIPHERAL_BYTES: Final = 0x26000
_ACCESSES: Final = (
    (c.PERIPHERALS, _PERIPHERAL_BYTES),
    (bus.PERIPHERAL_BITS, 32 * _PERIPHERAL_BYTES),
    (bus.RAM_BITS, 32 * 0x10000),
    (0xE0000000, 0x100000),
)
"""Addresses and sizes of what the hooks read and write."""
_VDDA, _V25, _SLOPE_PER_DEGC, _VREFINT = 3.3, 1.43, 0.0043, 1.2
_UNIQUE_ID: Final = b"StepTwin\x01\x02\x03\x04"
_UNTOUCHED: Final = b"\xa5\x5a\xc3\x3c"
"""What the RAM is filled with at power-up; a chip's has any content."""


class Hooks(NamedTuple):
    """What unicorn calls, and what runs a chip.

    Attributes:
        addresses: of the functions that unicorn calls: before a block, at an exception of its own, at an access to
            nothing, before an access to a peripheral, to read it, to write it, and before an instruction, which is
            for a debugger. The fourth one notes the address; while there is such a function, unicorn keeps PC exact
            at accesses, too.
        run: runs a chip until an instant in grains.
        called: addresses of functions that the hooks call, by their cells.
        kept: what must live as long as the addresses.
    """

    addresses: tuple[int, ...]
    run: Callable[[Any, int], None]
    called: Mapping[int, int]
    kept: Any


def python_hooks(s: Any) -> Hooks:
    """Return the reference: hooks in plain Python for one chip's state."""

    def unmapped(_uc: int, kind: int, address: int, size: int, value: int, _state: int) -> bool:
        return processor.on_unmapped(s, kind, address, size, value & 0xFFFFFFFF)

    def access(_uc: int, _kind: int, address: int, _size: int, _value: int, _state: int) -> None:
        s[c.ACCESS] = address

    def read(_uc: int, _offset: int, size: int, _state: int) -> int:
        return devices.read(s, s[c.ACCESS], size)

    def write(_uc: int, _offset: int, size: int, value: int, _state: int) -> None:
        devices.write(s, s[c.ACCESS], size, value & 0xFFFFFFFF)

    pointer, word, long = ctypes.c_void_p, ctypes.c_uint32, ctypes.c_uint64
    accessed = pointer, ctypes.c_int, long, ctypes.c_int, ctypes.c_int64, pointer
    kept = (
        ctypes.CFUNCTYPE(None, pointer, long, word, pointer)(
            lambda _uc, address, size, _: processor.on_block(s, address, size)
        ),
        ctypes.CFUNCTYPE(None, pointer, word, pointer)(lambda _uc, number, _: processor.on_exception(s, number)),
        ctypes.CFUNCTYPE(ctypes.c_bool, *accessed)(unmapped),
        ctypes.CFUNCTYPE(None, *accessed)(access),
        ctypes.CFUNCTYPE(long, pointer, long, word, pointer)(read),
        ctypes.CFUNCTYPE(None, pointer, long, word, long, pointer)(write),
        ctypes.CFUNCTYPE(None, pointer, long, word, pointer)(
            lambda _uc, address, _size, _: processor.on_instruction(s, address)
        ),
    )
    return Hooks(tuple(ctypes.cast(each, pointer).value or 0 for each in kept), processor.run, {}, kept)


@cache
def compiled_hooks() -> Hooks:
    """Return hooks that numba has compiled, for any chip; raises ModuleNotFoundError without the extra `fast`."""
    from steptwin.features.stm32.chip import compiled

    return Hooks(compiled.HOOKS, compiled.RUN, compiled.CALLED, compiled.KEPT)


class ChipSnapshot(NamedTuple):
    """A chip between two instructions: its cells, RAM and flash, and unicorn's registers."""

    cells: Int64Array
    memory: tuple[bytes, bytes]
    registers: Any


class Stm32Chip:
    """An STM32F103 with an image in its flash, from a reset on."""

    def __init__(
        self,
        segments: Sequence[tuple[int, bytes]],
        vectors: int,
        *,
        flash_kb: int = 128,
        ram_kb: int = 20,
        crystal_hz: int = 8_000_000,
        main: int = 0,
        data_end: int = RAM_START,
        compiled: bool | None = None,
    ) -> None:
        """Load an image and reset the processor.

        Args:
            segments: addresses in flash, and what stands there.
            vectors: address of its vector table.
            flash_kb: size of the flash.
            ram_kb: size of the RAM.
            crystal_hz: frequency of the crystal (HSE).
            main: address of `main`; 0 if it is not known.
            data_end: end of the variables, which the main stack must not reach.
            compiled: True for numba, False for plain Python, None for numba if it is installed.
        """
        self.state: Int64Array = np.zeros(c.CELLS, np.int64)
        self.cells: Cells = memoryview(self.state)  # type: ignore[arg-type]
        self.powered_counts = 0
        self._sizes = 1024 * ram_kb, 1024 * flash_kb
        self._data_end = data_end
        self._uc = self._open(flash_kb, ram_kb)
        self._reset(vectors, flash_kb, crystal_hz, main)
        self.cells[c.RAM_END] = RAM_START + 1024 * ram_kb
        fast = find_spec("numba") is not None if compiled is None else compiled
        self._hooks: Hooks = compiled_hooks() if fast else python_hooks(self.cells)
        self._given = self.state if fast else self.cells
        for cell, address in self._hooks.called.items():
            self.cells[cell] = address
        self._hook()
        erased = b"\xff" * (1024 * flash_kb)
        for address, content in ((c.FLASH_START, erased), *segments):
            self._uc.mem_write(address, content)
            self._uc.mem_write(address - c.FLASH_START, content)
        self.cells[c.PC] = self.word(vectors + 4) & ~1
        self._stack_top = self.word(vectors)
        self._uc.reg_write(SP, self._stack_top)

    def _open(self, flash_kb: int, ram_kb: int) -> Any:
        from unicorn import UC_ARCH_ARM, UC_MODE_MCLASS, UC_MODE_THUMB, UC_PROT_EXEC, UC_PROT_READ, Uc
        from unicorn.arm_const import UC_CPU_ARM_CORTEX_M3

        uc = Uc(UC_ARCH_ARM, UC_MODE_THUMB | UC_MODE_MCLASS)
        uc.ctl_set_cpu_model(UC_CPU_ARM_CORTEX_M3)
        uc.mem_map(c.FLASH_START, flash_kb * 1024, UC_PROT_READ | UC_PROT_EXEC)
        uc.mem_map(0, flash_kb * 1024, UC_PROT_READ | UC_PROT_EXEC)  # the flash once more (RM0008, 3.4)
        uc.mem_map(RAM_START, ram_kb * 1024)
        uc.mem_write(RAM_START, _UNTOUCHED * (ram_kb * 1024 // len(_UNTOUCHED)))
        uc.mem_map(_SYSTEM_MEMORY, 0x1000, UC_PROT_READ)
        uc.mem_write(_SYSTEM_MEMORY + 0x7E0, flash_kb.to_bytes(2, "little"))
        uc.mem_write(_SYSTEM_MEMORY + 0x7E8, _UNIQUE_ID)
        return uc

    def _reset(self, vectors: int, flash_kb: int, crystal_hz: int, main: int) -> None:
        s = self.cells
        place_registers(self.state)
        s[c.UC] = self._uc._uch.value  # noqa: SLF001  (the handle, which the library's functions take)
        s[c.SELF] = self.state.ctypes.data
        for cell, name in FUNCTIONS.items():
            s[cell] = address_of(name)
        s[c.CRYSTAL_HZ], s[c.FLASH_END] = crystal_hz, c.FLASH_START + 1024 * flash_kb
        s[c.VECTORS], s[c.MAIN], s[c.EXCEPTION], s[c.BEST] = vectors, main, -1, c.NEVER
        s[c.GROUP_MASK] = 0xFE
        s[c.STACK_LIMIT], s[c.MASKED_AT] = self._data_end, c.NEVER
        s[c.CYCLE] = 72_000_000 * c.GRAINS // HSI_HZ
        self.state[c.DUES : c.DUES + c.DEVICES] = s[c.DUE] = c.NEVER
        self.state[c.PRIORITY : c.PRIORITY + RESET_PRIORITIES.size] = RESET_PRIORITIES
        for timer in range(c.TIMERS):
            timers.load(s, timer)
        self.state[c.SHIFTING : c.SHIFTING + c.USARTS] = self.state[c.WAITING : c.WAITING + c.USARTS] = -1
        s[c.CAN_SENDING] = s[c.ADC_AWAITED] = -1
        for first in (c.SPI_SHIFTING, c.SPI_WAITING, c.I2C_WAITING):
            self.state[first : first + c.SERIALS] = -1
        s[c.ANSWERS] = outside.address_of(outside.NOBODY)
        self.set_temperature(25.0)
        gpio.route_channels(s)
        for port in range(c.PORTS):
            gpio.set_modes(s, port)

    def _hook(self) -> None:
        from unicorn import UC_HOOK_BLOCK, UC_HOOK_INTR, UC_HOOK_MEM_INVALID, UC_HOOK_MEM_READ, UC_HOOK_MEM_WRITE

        handle, number = self._uc._uch, ctypes.c_size_t()  # noqa: SLF001
        user = ctypes.c_void_p(self.state.ctypes.data)
        block, exception, unmapped, access, read, write, _ = map(ctypes.c_void_p, self._hooks.addresses)
        for kind, function, begin, end in (
            (UC_HOOK_BLOCK, block, 1, 0),
            (UC_HOOK_INTR, exception, 1, 0),
            (UC_HOOK_MEM_INVALID, unmapped, 1, 0),
            (UC_HOOK_MEM_READ | UC_HOOK_MEM_WRITE, access, bus.RAM_BITS, 0xFFFFFFFF),
        ):
            ends = ctypes.c_uint64(begin), ctypes.c_uint64(end)
            _check(library().uc_hook_add(handle, ctypes.byref(number), ctypes.c_int(kind), function, user, *ends))
        for base, size in _ACCESSES:
            place = ctypes.c_uint64(base), ctypes.c_size_t(size)
            _check(library().uc_mmio_map(handle, *place, read, user, write, user))

    def run(self, until_counts: int) -> None:
        """Let time pass until an instant; it ends before if the edges must be taken, or with a fault."""
        self._hooks.run(self._given, until_counts * c.GRAINS)

    def begin(self, now_counts: int) -> None:
        """Let the first instruction be executed at an instant: call this before any other time passes."""
        self.powered_counts = now_counts
        for cell in (c.NOW, c.AT, c.CYCLES_BASE_AT):
            self.cells[cell] = now_counts * c.GRAINS
        for timer in range(c.TIMERS):
            self.cells[c.COUNTER_AT + timer] = now_counts * c.GRAINS

    def watch(self, pin: int, *, released: bool) -> None:
        """Keep the edges of a pin, 16 * port + number; its wire has a level while the pin is no output."""
        port, bit = pin // 16, 1 << pin % 16
        self.cells[c.WATCHED + port] |= bit
        if released:
            self.cells[c.RELEASED + port] |= bit
            self.cells[c.LEVELS + port] |= bit

    def drive(self, pin: int, *, level: bool) -> None:
        """Let the machine set the level of a pin that is an input."""
        port, bit = pin // 16, 1 << pin % 16
        self.cells[c.DRIVEN + port] |= bit
        before = self.cells[c.OUTSIDE + port]
        self.cells[c.OUTSIDE + port] = before | bit if level else before & ~bit
        self.act(gpio.refresh, port)

    def level(self, pin: int) -> int:
        """Return the level of a pin."""
        return self.cells[c.LEVELS + pin // 16] >> pin % 16 & 1

    def was_output(self, pin: int) -> bool:
        """Return whether a pin has been an output."""
        return bool(self.cells[c.WAS_OUTPUT + pin // 16] >> pin % 16 & 1)

    def left_output(self, pin: int) -> bool:
        """Return whether a pin has been an output and then an input again."""
        return bool(self.cells[c.LEFT_OUTPUT + pin // 16] >> pin % 16 & 1)

    @property
    def flash(self) -> bytes:
        """Content of the flash."""
        return bytes(self._uc.mem_read(c.FLASH_START, self.cells[c.FLASH_END] - c.FLASH_START))

    def set_voltage(self, channel: int, volts: float) -> None:
        """Set the voltage at a channel of the ADC, whose full scale is VDDA = 3.3 V."""
        self.cells[c.ADC_INPUT + channel] = min(max(round(volts / _VDDA * 4095), 0), 4095)

    def set_temperature(self, temperature_degc: float) -> None:
        """Set what the chip's own sensors measure: its temperature, and its reference of 1.2 V (RM0008, 11.10)."""
        self.set_voltage(16, _V25 - _SLOPE_PER_DEGC * (temperature_degc - 25.0))
        self.set_voltage(17, _VREFINT)

    @property
    def now_counts(self) -> int:
        """The instant that has been reached; it may be some instructions beyond the one that was asked for."""
        return self.cells[c.NOW] // c.GRAINS

    @property
    def stack_limit(self) -> int:
        """Lowest address that the main stack may use."""
        return self._data_end

    @property
    def pc(self) -> int:
        """Where the processor stands."""
        return self.cells[c.PC]

    @property
    def main_ahead(self) -> bool:
        """True if the image has a `main` that has not been reached."""
        return bool(self.cells[c.MAIN])

    @property
    def interrupts(self) -> dict[int, tuple[int, float, int]]:
        """By number of an exception: how often taken, longest time in us until its handler, events that it missed."""
        return {
            number: (
                self.cells[c.TAKEN + number],
                self.cells[c.LATEST + number] / c.GRAINS / 72,
                self.cells[c.OVERRUNS + number],
            )
            for number in range(c.EXCEPTIONS)
            if self.cells[c.TAKEN + number] or self.cells[c.OVERRUNS + number]
        }

    def sent_count(self, usart: int) -> int:
        """Return the number of bytes that a USART, numbered from 0, has sent."""
        return self.cells[c.SENT_COUNT + usart]

    def word(self, address: int) -> int:
        """Return a word of the memory."""
        return int.from_bytes(self._uc.mem_read(address, 4), "little")

    def register(self, name: str) -> int:
        """Return a register of the processor, such as `r0` or `lr`."""
        from unicorn import arm_const

        return int(self._uc.reg_read(getattr(arm_const, f"UC_ARM_REG_{name.upper()}")))

    def set_register(self, name: str, value: int) -> None:
        """Set a register of the processor."""
        from unicorn import arm_const

        self._uc.reg_write(getattr(arm_const, f"UC_ARM_REG_{name.upper()}"), value)

    def take_edges(self) -> tuple[Int64Array, Int64Array]:
        """Return the edges of the watched pins since the last call: instants in counts; 2 * pin + level."""
        count = self.cells[c.EDGE_COUNT]
        edges = self.state[c.EDGES : c.EDGES + 2 * count].reshape(-1, 2).copy()
        self.cells[c.EDGE_COUNT] = 0
        return edges[:, 0], edges[:, 1]

    def sent(self, usart: int) -> bytes:
        """Return what a USART, numbered from 0, has sent; at most its last 64 KiB."""
        count = self.cells[c.SENT_COUNT + usart]
        place = c.SENT + usart * c.TEXT_CAPACITY
        ring = self.state[place : place + c.TEXT_CAPACITY].astype(np.uint8).tobytes()
        if count <= c.TEXT_CAPACITY:
            return ring[:count]
        return ring[count % c.TEXT_CAPACITY :] + ring[: count % c.TEXT_CAPACITY]

    def give(self, usart: int, data: bytes) -> None:
        """Let bytes arrive at a USART, numbered from 0, one after the other."""
        for byte in data:
            place = self.cells[c.GIVEN_COUNT + usart] % c.TEXT_CAPACITY
            self.cells[c.GIVEN + usart * c.TEXT_CAPACITY + place] = byte
            self.cells[c.GIVEN_COUNT + usart] += 1
        self.act(usarts.listen, usart)

    def act(self, function: Callable[..., object], *arguments: int) -> None:
        """Let the world outside act on a peripheral at the instant that has been reached, by one of its functions."""
        self.cells[c.AT] = self.cells[c.NOW]
        function(self.cells, *arguments)
        devices.serve_events(self.cells)

    def memory(self, address: int, size: int) -> bytes | None:
        """Return what stands at an address of RAM or flash; None if there is neither."""
        if not self._has_memory(address, size):
            return None
        return bytes(self._uc.mem_read(address, size))

    def set_memory(self, address: int, content: bytes) -> bool:
        """Change RAM or flash, as a debugger does; return False if there is neither."""
        if not self._has_memory(address, len(content)):
            return False
        self._uc.mem_write(address, content)
        for begin, twin in ((c.FLASH_START, 0), (0, c.FLASH_START)):
            if begin <= address < begin + self._sizes[1]:
                self._uc.mem_write(address - begin + twin, content)
                self._uc.ctl_flush_tb()
        return True

    def _has_memory(self, address: int, size: int) -> bool:
        places = zip((RAM_START, c.FLASH_START, 0), (*self._sizes, self._sizes[1]), strict=True)
        return any(begin <= address <= address + size <= begin + length for begin, length in places)

    def snapshot(self) -> ChipSnapshot:
        """Return the present state; the edges must have been taken."""
        ram, flash = self.memory(RAM_START, self._sizes[0]), self.memory(c.FLASH_START, self._sizes[1])
        assert ram is not None
        assert flash is not None
        return ChipSnapshot(self.state[c.NOW : c.KNOWN_SIZE].copy(), (ram, flash), self._uc.context_save())

    def restore(self, snapshot: ChipSnapshot) -> None:
        """Return to a state of this chip, whose instants become the present ones."""
        ram, flash = snapshot.memory
        now = self.cells[c.NOW]
        self.state[c.NOW : c.KNOWN_SIZE] = snapshot.cells
        self._uc.context_restore(snapshot.registers)
        self._uc.mem_write(RAM_START, ram)
        if flash != self.memory(c.FLASH_START, len(flash)):
            self.set_memory(c.FLASH_START, flash)
        later = -((self.cells[c.NOW] - now) // c.GRAINS) * c.GRAINS
        for first, count in c.INSTANTS:
            instants = self.state[first : first + count]
            instants[instants != c.NEVER] += later

    def stack_used(self) -> tuple[int, int]:
        """Return the most bytes of the main stack that have been used, and those that it could have.

        The RAM is filled with a pattern at power-up. The longest stretch that is still there is what lies between the
        stack and what grows towards it.
        """
        top, bottom = self._stack_top, self._data_end
        content = np.frombuffer(self.memory(bottom, max(top - bottom, 0) & ~3) or b"", np.uint32)
        touched = np.flatnonzero(np.concatenate(([True], content != np.frombuffer(_UNTOUCHED, np.uint32), [True])))
        longest = int(np.argmax(np.diff(touched))) if touched.size > 1 else 0
        return 4 * (content.size - int(touched[longest + 1]) + 1), top - bottom

    def attend_instructions(self) -> None:
        """Let a debugger stop the processor before any instruction; it runs more slowly from now on."""
        from unicorn import UC_HOOK_CODE

        number, user = ctypes.c_size_t(), ctypes.c_void_p(self.state.ctypes.data)
        hook = ctypes.c_void_p(self._hooks.addresses[-1])
        ends = ctypes.c_uint64(1), ctypes.c_uint64(0)
        handle = self._uc._uch  # noqa: SLF001
        _check(library().uc_hook_add(handle, ctypes.byref(number), ctypes.c_int(UC_HOOK_CODE), hook, user, *ends))
        self._uc.ctl_flush_tb()

    def close(self) -> None:
        """Free the memory of unicorn; nothing else may be called afterwards."""
        self._uc = None


def _check(error: int) -> None:
    if error:
        raise RuntimeError(f"unicorn: error {error}")
