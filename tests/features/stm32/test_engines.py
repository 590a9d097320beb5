"""The compiled chip does what plain Python does, to the count."""

from pathlib import Path
from random import Random
from typing import Any, Final, NamedTuple

import pytest

from steptwin.features.stm32.chip import cells as c
from steptwin.features.stm32.chip import devices
from steptwin.features.stm32.chip.engine import Stm32Chip
from steptwin.features.stm32.chip.flash import KEY1, KEY2
from steptwin.features.stm32.chip.registers import PERIPHERALS
from steptwin.features.stm32.image import read_image
from tests.features.stm32.conftest import Bench
from tests.features.stm32.examples import EXAMPLES

_COUNTS: Final = 72_000 * 60
_PWR_CR, _KEYR = 0x40007000, 0x40022004


def _made(path: Path, *, compiled: bool) -> tuple[list[int], list[int], list[int]]:
    """Return the edges of an example, and the chip's state beside what belongs to its process."""
    image = read_image(path)
    chip = Stm32Chip(image.segments, image.vectors, main=image.address_of("main"), compiled=compiled)
    for pin in range(16):
        chip.watch(pin, released=False)
    counts, pins = list[int](), list[int]()
    while chip.now_counts < _COUNTS:
        chip.run(_COUNTS)
        at, which = chip.take_edges()
        counts += at.tolist()
        pins += which.tolist()
    state = [*chip.state[c.NOW : c.EDGES].tolist(), *chip.state[c.COUNTER : c.KNOWN_SIZE].tolist()]
    chip.close()
    return counts, pins, state


@pytest.mark.slow  # numba compiles for half a minute
@pytest.mark.parametrize("name", ["compare_stepper", "systick_stepper", "can_stepper", "dma_stepper"])
def test_plain_python_and_numba_make_the_same_edges_and_end_in_the_same_state(name: str) -> None:
    pytest.importorskip("numba")
    path = EXAMPLES / f"{name}.elf"
    reference = _made(path, compiled=False)
    assert len(reference[0]) > (1 if name == "can_stepper" else 70)  # without a bus nobody tells it where to go
    assert _made(path, compiled=True) == reference


class _Access(NamedTuple):
    """An access to a register, or for address 0 a level of a pin and a time that passes."""

    address: int
    writes: bool
    value: int


def _random_accesses(count: int) -> list[_Access]:
    """Return accesses to all registers but those that end a run, with values of few bits, many bits and all."""
    random = Random(48)
    places = [
        peripheral.base + register.offset
        for peripheral in PERIPHERALS
        if peripheral.name not in ("IWDG", "WWDG", "RCC")
        for register in peripheral.registers
    ]
    accesses = [_Access(_PWR_CR, True, 0x100), *(_Access(_KEYR, True, key) for key in (KEY1, KEY2))]
    for _ in range(count):
        if random.random() < 0.3:
            accesses.append(_Access(0, False, random.getrandbits(11)))
        value = random.getrandbits(32) & random.choice((-1, random.getrandbits(32), 0x1F, 1 << random.randrange(32)))
        accesses.append(_Access(random.choice(places), random.random() < 0.7, value & 0xFFFFFFFF))
    return accesses


def _passed(accesses: list[_Access], *, compiled: bool) -> tuple[list[int], list[int]]:
    """Return what the accesses have read, and the chip's state after them."""
    bench = Bench(compiled=compiled)
    chip = bench.chip
    cells: Any = chip.state if compiled else chip.cells
    read: Any = devices.read
    write: Any = devices.write
    if compiled:
        from numba import njit

        read, write = njit(devices.read), njit(devices.write)
    values = []
    for address, writes, value in accesses:
        chip.cells[c.FAULT] = 0
        if not address:
            chip.drive(value & 0x1F, level=bool(value & 0x20))
            chip.run(chip.now_counts + value)
            chip.take_edges()
        elif writes:
            write(cells, address, 4, value)
        else:
            values.append(int(read(cells, address, 4)))
    state = [*chip.state[c.NOW : c.EDGES].tolist(), *chip.state[c.COUNTER : c.KNOWN_SIZE].tolist()]
    chip.close()
    return values, state


@pytest.mark.slow  # numba compiles for half a minute
def test_plain_python_and_numba_do_the_same_at_any_access_to_any_register() -> None:
    pytest.importorskip("numba")
    accesses = _random_accesses(6000)
    reference = _passed(accesses, compiled=False)
    assert len(set(reference[0])) > 100
    assert _passed(accesses, compiled=True) == reference
