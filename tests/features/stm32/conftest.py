"""A chip with a small program of handlers, whose registers a test writes as a debugger would."""

from collections.abc import Iterator
from typing import Final

import pytest

from steptwin.features.stm32.chip import cells as c
from steptwin.features.stm32.chip import devices
from steptwin.features.stm32.chip.engine import Stm32Chip
from steptwin.features.stm32.chip.libunicorn import write_memory
from steptwin.features.stm32.serial_devices import SerialDevices

PROGRAM: Final = 0x08000200
"""Where the program of handlers.S begins, behind the vector table."""
MAIN, SLEEP, FIRST_HANDLER, LOW_HANDLER, HIGH_HANDLER, CALL, WILD = 0x00, 0x12, 0x20, 0x40, 0x50, 0x60, 0x70
_CODE: Final = bytes.fromhex(
    "72b61d484ff0405101601c4c0122226062b630bffde700000000000000000000"
    "0222226014484ff08041016000bfffe712042260704700000000000000000000"
    "0422226012042260704700000000000008222260120422607047000000000000"
    "07df0125d5e7000000000000000000004ff0c0400168cce700e200e010080140"
)
RCC_CR, RCC_CFGR, RCC_APB2ENR, RCC_APB1ENR = 0x40021000, 0x40021004, 0x40021018, 0x4002101C
FLASH_ACR, GPIOA, TIM2, USART1 = 0x40022000, 0x40010800, 0x40000000, 0x40013800


class Bench:
    """A chip at 72 MHz whose clocks are on, and its registers."""

    def __init__(self, begin: int = SLEEP, handlers: dict[int, int] | None = None, *, compiled: bool = False) -> None:
        vectors = [0x20005000, PROGRAM + begin + 1, *[PROGRAM + SLEEP + 1] * 74]
        for number, place in (handlers or {}).items():
            vectors[number] = PROGRAM + place + 1
        table = b"".join(each.to_bytes(4, "little") for each in vectors)
        self.chip = Stm32Chip([(0x08000000, table), (PROGRAM, _CODE)], 0x08000000, compiled=compiled)
        self.devices = SerialDevices()
        self.chip.set_memory(0x20000000, bytes(0x5000))
        self.chip.set_register("r4", GPIOA + 0x10)  # where the handlers set their pins
        for port in range(c.PORTS):
            for pin in range(16):
                self.chip.watch(16 * port + pin, released=False)
        self.write(RCC_CR, 0x01010001)
        self.write(RCC_CFGR, 7 << 18 | 1 << 16 | 4 << 8 | 2)
        self.write(RCC_APB2ENR, 0x38FFFD)
        self.write(RCC_APB1ENR, 0x3AFEC9FF)

    def write(self, address: int, value: int, size: int = 4) -> None:
        """Write a register now."""
        devices.write(self.chip.cells, address, size, value)

    def read(self, address: int, size: int = 4) -> int:
        """Read a register now."""
        return devices.read(self.chip.cells, address, size)

    def memory(self, address: int, size: int) -> bytes:
        """Return bytes of the memory."""
        return b"".join(self.chip.word(address + at).to_bytes(4, "little") for at in range(0, size, 4))[:size]

    def set_memory(self, address: int, content: bytes) -> None:
        """Set bytes of the memory."""
        for at, byte in enumerate(content):
            write_memory(self.chip.cells, address + at, 1, byte)

    def run(self, counts: int) -> None:
        """Let time pass from now on."""
        self.chip.run(self.chip.now_counts + counts)

    def edges(self) -> list[tuple[int, str]]:
        """Return the edges since the last call: instant, and a pin such as A0+ or A0-."""
        counts, pins = self.chip.take_edges()
        return [
            (at, f"{'ABCDE'[pin >> 5]}{pin >> 1 & 15}{'-+'[pin & 1]}")
            for at, pin in zip(counts.tolist(), pins.tolist(), strict=True)
        ]

    def order(self) -> str:
        """Return the edges' pins in order, without their instants."""
        return " ".join(pin for _, pin in self.edges())


@pytest.fixture
def bench() -> Iterator[Bench]:
    """Return a chip that sleeps."""
    made = Bench()
    yield made
    made.chip.close()
