"""The flash's controller: keys, erasing and programming, what it refuses, and the time that passes."""

import pytest

from steptwin.features.stm32.chip import cells as c
from steptwin.features.stm32.chip.flash import EOP, KEY1, KEY2, LOCK, PER, PG, PGERR, STRT
from tests.features.stm32.conftest import Bench

_FLASH, _PENDING = 0x40022000, 0xE000E200
_KEYR, _SR, _CR, _AR = (_FLASH + at for at in (4, 0xC, 0x10, 0x14))
_PAGE = 0x08001000
_STORE = {1: "0170", 2: "0180", 4: "0160"}
"""STRB, STRH and STR of r1 at r0."""


def _unlock(bench: Bench) -> None:
    bench.write(_KEYR, KEY1)
    bench.write(_KEYR, KEY2)


def _store(bench: Bench, address: int, value: int, size: int = 2) -> int:
    """Let an instruction in the RAM store a value; return the counts that this took."""
    bench.set_memory(0x20000200, bytes.fromhex(_STORE[size] + "fee7"))
    bench.chip.set_register("r0", address)
    bench.chip.set_register("r1", value)
    bench.chip.cells[c.PC], bench.chip.cells[c.SLEEPING] = 0x20000200, 0
    begin = bench.chip.now_counts
    bench.chip.run(begin + 4)
    return bench.chip.now_counts - begin


def _erase(bench: Bench, address: int) -> None:
    bench.write(_CR, PER)
    bench.write(_AR, address)
    bench.write(_CR, PER | STRT)
    bench.write(_CR, 0)


def test_two_keys_in_order_open_the_control_register(bench: Bench) -> None:
    bench.write(_CR, PG)
    assert bench.read(_CR) == LOCK
    _unlock(bench)
    bench.write(_CR, PG)
    assert bench.read(_CR) == PG
    bench.write(_CR, LOCK)
    assert bench.read(_CR) == LOCK


def test_a_wrong_key_shuts_it_until_the_next_reset(bench: Bench) -> None:
    bench.write(_KEYR, KEY2)
    _unlock(bench)
    assert bench.read(_CR) == LOCK


def test_a_page_of_1024_bytes_becomes_ones_in_30_ms(bench: Bench) -> None:
    _unlock(bench)
    for address in range(_PAGE - 4, _PAGE + 1028, 4):
        bench.set_memory(address, bytes(4))
    begin = bench.chip.now_counts
    _erase(bench, _PAGE + 100)
    assert bench.chip.now_counts - begin == 72 * 30_000
    assert bench.memory(_PAGE, 1024) == b"\xff" * 1024
    assert bench.memory(_PAGE - 4, 4) == bench.memory(_PAGE + 1024, 4) == bytes(4)
    assert bench.read(_SR) == EOP
    bench.write(_SR, EOP)
    assert bench.read(_SR) == 0


def test_a_halfword_is_programmed_in_52_and_a_half_us_and_seen_at_both_addresses(bench: Bench) -> None:
    _unlock(bench)
    _erase(bench, _PAGE)
    bench.write(_CR, PG)
    assert _store(bench, _PAGE + 2, 0x1234) >= 3780
    assert bench.memory(_PAGE, 4) == bench.memory(_PAGE - 0x08000000, 4) == bytes.fromhex("ffff3412")
    assert bench.read(_SR) == EOP
    assert (bench.chip.cells[c.FAULT], bench.chip.cells[c.FLASH_WRITES]) == (0, 1)


@pytest.mark.parametrize(("value", "stays"), [(0x5678, True), (0, False)])
def test_what_is_not_erased_takes_only_0(bench: Bench, value: int, stays: bool) -> None:
    _unlock(bench)
    _erase(bench, _PAGE)
    bench.write(_CR, PG | 1 << 10)
    _store(bench, _PAGE, 0x1234)
    bench.write(_SR, EOP)
    _store(bench, _PAGE, value)
    assert int.from_bytes(bench.memory(_PAGE, 2), "little") == (0x1234 if stays else value)
    assert bench.read(_SR) == (PGERR if stays else EOP)
    assert bench.read(_PENDING) >> 4 & 1 == stays


@pytest.mark.parametrize(("size", "control"), [(1, PG), (4, PG), (2, 0)])
def test_other_sizes_and_a_write_without_pg_are_faults(bench: Bench, size: int, control: int) -> None:
    _unlock(bench)
    _erase(bench, _PAGE)
    bench.write(_CR, control)
    _store(bench, _PAGE, 0x1234, size)
    assert (bench.chip.cells[c.FAULT], bench.chip.cells[c.FAULT_AT]) == (c.FAULT_UNMAPPED, _PAGE)
    assert bench.memory(_PAGE, 4) == b"\xff" * 4


def test_code_that_is_programmed_costs_what_it_is(bench: Bench) -> None:
    _unlock(bench)
    _erase(bench, _PAGE)
    bench.write(_CR, PG)
    for at, code in enumerate((0x3001, 0x3001, 0xE7FC)):  # adds r0, #1 twice, and back
        _store(bench, _PAGE + 2 * at, code)
    bench.chip.set_register("r0", 0)
    bench.chip.cells[c.PC] = _PAGE
    bench.run(600)
    assert bench.chip.register("r0") > 100
