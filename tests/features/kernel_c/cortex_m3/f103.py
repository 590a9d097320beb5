"""A model of the parts of an STM32F103 that the example firmware uses, around an emulated core: timers, DMA1, pins.

The registers are plain memory. Timers 2 to 4 count in step at 72 MHz. A match toggles a channel's pin if its mode says
so, and asks the DMA for the next compare value. Source: ST, reference manual RM0008 (DMA1's requests: table 78). It
models what the firmware relies on and no more: instructions take no time, but each reading of a counter does.
"""

import subprocess
from pathlib import Path
from typing import Any, NamedTuple

import unicorn
from unicorn import arm_const

FLASH, FLASH_BYTES = 0x0800_0000, 64 << 10
RAM, RAM_BYTES = 0x2000_0000, 20 << 10
PERIPHERALS = ((0x4000_0000, 0x3_0000), (0xE000_E000, 0x1000))
TIM1, TIM2, TIM3, TIM4 = 0x4001_2C00, 0x4000_0000, 0x4000_0400, 0x4000_0800
DIER, EGR, CCMR, CNT, ARR, CCR = 0x0C, 0x14, 0x18, 0x24, 0x2C, 0x34
DMA1_CHANNELS, DMA_CHANNEL_BYTES = 0x4002_0008, 20
GPIO_A, GPIO_B, BSRR = 0x4001_0800, 0x4001_0C00, 0x10
SERVO_VECTOR, DIR_VECTOR = 16 + 25, 16 + 28
RETURN_ADDRESS = FLASH + FLASH_BYTES - 16
UNUSED = b"\xa5"
TOGGLE, FORCE_LOW = 3, 4
READING_COUNTS = 36
LATENCY_COUNTS = 40
"""From the servo timer's overflow to the first instruction that counts: 12 cycles of the core, and what it saves."""


class Output(NamedTuple):
    """Where an axis' signals are: CLK on a channel (from 0) of a timer, fed by a channel (from 0) of DMA1; DIR."""

    timer: int
    channel: int
    dma: int
    port: int
    pin: int


OUTPUTS = (
    Output(TIM2, 2, 0, GPIO_A, 3),
    Output(TIM3, 2, 1, GPIO_A, 4),
    Output(TIM3, 3, 2, GPIO_A, 5),
    Output(TIM4, 1, 3, GPIO_B, 10),
    Output(TIM4, 2, 4, GPIO_B, 11),
    Output(TIM3, 0, 5, GPIO_B, 12),
    Output(TIM2, 1, 6, GPIO_B, 13),
)


class F103:
    """The chip with a firmware, booted up to its main loop."""

    def __init__(self, folder: Path) -> None:
        self._image = (folder / "firmware.bin").read_bytes()
        listed = subprocess.check_output(["arm-none-eabi-nm", folder / "firmware.elf"], text=True)
        self.symbols = {name: int(at, 16) for at, _, name in map(str.split, listed.splitlines())}
        self.now_counts = 0
        self.clk: list[list[int]] = [[] for _ in OUTPUTS]
        """Times at which each CLK pin changed; it is low at first."""
        self.direction: list[list[tuple[int, int]]] = [[] for _ in OUTPUTS]
        """Times at which each DIR pin was written, with its level."""
        self._dir_pending = False
        self._core = unicorn.Uc(unicorn.UC_ARCH_ARM, unicorn.UC_MODE_THUMB | unicorn.UC_MODE_MCLASS)
        self._core.ctl_set_cpu_model(arm_const.UC_CPU_ARM_CORTEX_M3)
        for address, size in ((FLASH, FLASH_BYTES), (RAM, RAM_BYTES), *PERIPHERALS):
            self._core.mem_map(address, size)
        self._core.mem_write(FLASH, self._image)
        self._core.mem_write(RAM, UNUSED * RAM_BYTES)
        self._core.reg_write(arm_const.UC_ARM_REG_SP, self._vector(0))
        self._core.emu_start(self._vector(1), RETURN_ADDRESS)  # up to main's WFI, which ends it
        self._period_counts = self._read(TIM1 + ARR) + 1
        self._servo_counts = self._period_counts - self._read(TIM1 + CNT)
        for timer in (TIM2, TIM3, TIM4):
            self._hook(unicorn.UC_HOOK_MEM_READ, self._counter_read, timer + CNT)
        for port in (GPIO_A, GPIO_B):
            self._hook(unicorn.UC_HOOK_MEM_WRITE, self._pins_written, port + BSRR)
        self._hook(unicorn.UC_HOOK_MEM_WRITE, self._event_generated, TIM2 + EGR)

    def run_ticks(self, ticks: int) -> None:
        """Run to the end of the servo interrupt after this number of ticks."""
        for _ in range(ticks):
            self._play(self._servo_counts + LATENCY_COUNTS, interruptible=True)
            self._servo_counts += self._period_counts
            self._interrupt(SERVO_VECTOR)

    def word(self, name: str) -> int:
        """Read a variable."""
        return self._read(self.symbols[name])

    def stack_left(self) -> int:
        """Return the bytes between the variables and the deepest use of the stack."""
        end = self.symbols["bss_end"]
        above = bytes(self._core.mem_read(end, RAM + RAM_BYTES - end))
        return len(above) - len(above.lstrip(UNUSED))

    def _vector(self, number: int) -> int:
        return int.from_bytes(self._image[4 * number : 4 * number + 4], "little")

    def _read(self, address: int, size: int = 4) -> int:
        return int.from_bytes(self._core.mem_read(address, size), "little")

    def _write(self, address: int, value: int) -> None:
        self._core.mem_write(address, (value & 0xFFFF_FFFF).to_bytes(4, "little"))

    def _hook(self, kind: int, called: Any, address: int) -> None:
        self._core.hook_add(kind, called, begin=address, end=address)

    def _interrupt(self, vector: int) -> None:
        self._core.reg_write(arm_const.UC_ARM_REG_LR, RETURN_ADDRESS | 1)
        self._core.emu_start(self._vector(vector), RETURN_ADDRESS)
        if self._dir_pending:
            self._dir_pending = False
            self._interrupt(DIR_VECTOR)

    def _counter_read(self, _core: Any, _kind: int, address: int, *_: int) -> None:
        self._play(self.now_counts + READING_COUNTS, interruptible=False)
        self._write(address, self.now_counts & 0xFFFF)

    def _pins_written(self, _core: Any, _kind: int, address: int, _size: int, value: int, _data: Any) -> None:
        for axis, output in enumerate(OUTPUTS):
            if address == output.port + BSRR and value & (0x1_0001 << output.pin):
                self.direction[axis].append((self.now_counts, value >> output.pin & 1))

    def _event_generated(self, *_: Any) -> None:
        self._dir_pending = True

    def _play(self, until_counts: int, *, interruptible: bool) -> None:
        """Let the timers count; a match of TIM2's first channel asks for the DIR interrupt."""
        while True:
            matches = [(self._next_match(output.timer, output.channel), i) for i, output in enumerate(OUTPUTS)]
            matches.append((self._next_match(TIM2, 0), -1))
            at, first = min(matches)
            if at > until_counts:
                self.now_counts = until_counts
                return
            self.now_counts = at
            for axis in (i for when, i in matches if when == at and i >= 0):
                self._match(axis)
            if first < 0 and self._read(TIM2 + DIER) & 2:
                self._dir_pending = not interruptible
                if interruptible:
                    self._interrupt(DIR_VECTOR)

    def _next_match(self, timer: int, channel: int) -> int:
        compare = self._read(timer + CCR + 4 * channel, 2)
        return self.now_counts + 1 + (compare - self.now_counts - 1) % (1 << 16)

    def _match(self, axis: int) -> None:
        output = OUTPUTS[axis]
        mode = self._read(output.timer + CCMR + 4 * (output.channel >> 1)) >> (8 * (output.channel & 1) + 4) & 7
        if mode == TOGGLE:
            self.clk[axis].append(self.now_counts)
        control = DMA1_CHANNELS + DMA_CHANNEL_BYTES * output.dma
        count, memory = self._read(control + 4), self._read(control + 12)
        if self._read(output.timer + DIER) >> (9 + output.channel) & 1 and self._read(control) & 1 and count:
            self._write(output.timer + CCR + 4 * output.channel, self._read(memory, 2))
            self._write(control + 4, count - 1)
            self._write(control + 12, memory + 2)
