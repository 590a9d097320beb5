"""Exceptions: priorities, nesting, chaining and masks, by handlers that set pins (handlers.S)."""

import pytest

from steptwin.features.stm32.chip import cells as c
from steptwin.features.stm32.chip.nvic import takes_exception
from tests.features.stm32.conftest import (
    CALL,
    FIRST_HANDLER,
    GPIOA,
    HIGH_HANDLER,
    LOW_HANDLER,
    MAIN,
    SLEEP,
    WILD,
    Bench,
)

_NVIC_ENABLE, _NVIC_PRIORITY, _AIRCR = 0xE000E100, 0xE000E400, 0xE000ED0C
_HANDLERS = {16 + 28: FIRST_HANDLER, 16 + 29: LOW_HANDLER, 16 + 30: HIGH_HANDLER}


def _three_interrupts(first: int, low: int, high: int) -> Bench:
    bench = Bench(MAIN, _HANDLERS)
    bench.write(GPIOA, 0x33333333)
    for irq, priority in ((28, first), (29, low), (30, high)):
        bench.write(_NVIC_PRIORITY + irq, priority, 1)
    bench.write(_NVIC_ENABLE, 7 << 28)
    bench.edges()
    return bench


def test_pending_interrupts_wait_for_primask_and_run_by_priority_a_higher_one_inside_a_lower_one() -> None:
    bench = _three_interrupts(0x40, 0x80, 0x20)
    bench.run(300)
    assert bench.order() == "A0+ A1+ A3+ A3- A1- A2+ A2-"


def test_an_equal_priority_does_not_preempt_and_the_lower_number_comes_first() -> None:
    bench = _three_interrupts(0x40, 0x40, 0x40)
    bench.run(300)
    assert bench.order() == "A0+ A1+ A1- A2+ A2- A3+ A3-"


def test_the_priority_group_decides_on_preemption_and_the_subpriority_on_the_order_alone() -> None:
    bench = _three_interrupts(0x50, 0x60, 0x40)
    bench.write(_AIRCR, 0x05FA0000 | 6 << 8)  # groups of 0x80
    bench.run(300)
    assert bench.order() == "A0+ A1+ A1- A3+ A3- A2+ A2-"


@pytest.mark.parametrize(("basepri", "pins"), [(0x80, "A0+ A1+ A3+ A3- A1-"), (0x40, "A0+"), (0x90, None)])
def test_basepri_keeps_its_own_priority_and_lower_ones_out(basepri: int, pins: str | None) -> None:
    bench = _three_interrupts(0x40, 0x80, 0x20)
    bench.chip.set_register("basepri", basepri)
    bench.run(300)
    assert bench.order() == (pins or "A0+ A1+ A3+ A3- A1- A2+ A2-")


def test_wfi_ends_by_a_pending_interrupt_that_primask_keeps_out() -> None:
    bench = _three_interrupts(0x40, 0x80, 0x20)
    bench.run(300)
    bench.edges()
    bench.chip.set_register("primask", 1)
    assert not takes_exception(bench.chip.cells, 0)
    bench.write(0xE000E200, 1 << 29)
    assert takes_exception(bench.chip.cells, 0)
    assert not takes_exception(bench.chip.cells, 1)
    bench.run(100)
    assert bench.order() == ""
    bench.chip.set_register("primask", 0)
    bench.run(100)
    assert bench.order() == "A2+ A2-"


def test_the_next_handler_follows_after_6_cycles_and_the_first_after_12() -> None:
    bench = _three_interrupts(0x40, 0x40, 0x40)
    bench.run(300)
    at = {pin: counts for counts, pin in bench.edges()}
    assert bench.chip.interrupts[16 + 29][0] == 1
    # h28 ends by BX: 1 cycle and a refilled pipeline; 6 cycles of chaining; MOVS before the store
    assert at["A2+"] - at["A1-"] in range(9, 13)


def test_svc_is_taken_at_once_and_returns_behind_itself() -> None:
    bench = Bench(CALL, {11: LOW_HANDLER})
    bench.run(200)
    assert bench.chip.interrupts[11][0] == 1
    assert bench.chip.register("r5") == 1
    assert bench.chip.pc == bench.chip.word(4) - 1 - CALL + SLEEP + 2


def test_an_access_to_nothing_is_a_fault_with_its_address() -> None:
    bench = Bench(WILD)
    bench.run(200)
    assert bench.chip.cells[c.FAULT] == c.FAULT_UNMAPPED
    assert bench.chip.cells[c.FAULT_AT] == 0x60000000
    assert bench.chip.cells[c.FAULT_PC] == bench.chip.word(4) - 1 + 4


def test_a_vector_without_the_thumb_bit_is_a_fault() -> None:
    bench = Bench(MAIN, {16 + 28: FIRST_HANDLER - 1, 16 + 29: LOW_HANDLER})
    bench.write(_NVIC_ENABLE, 1 << 28)
    bench.run(200)
    assert (bench.chip.cells[c.FAULT], bench.chip.cells[c.FAULT_AT]) == (c.FAULT_VECTOR, 16 + 28)


def test_a_thread_with_a_stack_of_its_own_gets_its_registers_back_from_there() -> None:
    bench = Bench(handlers={15: LOW_HANDLER})
    bench.write(GPIOA, 0x33333333)
    bench.chip.set_register("psp", 0x20003000)
    bench.chip.set_register("control", 2)
    bench.chip.set_register("r12", 0x12345678)
    bench.write(0xE000E014, 199)
    bench.write(0xE000E010, 7)
    bench.run(300)
    assert bench.order() == "A2+ A2-"
    assert (bench.chip.register("psp"), bench.chip.register("control")) == (0x20003000, 2)
    assert bench.chip.register("msp") == 0x20005000
    assert bench.chip.register("r12") == bench.chip.word(0x20003000 - 16) == 0x12345678
    assert bench.chip.word(0x20003000 - 8) == bench.chip.word(4) - 1 + 2  # behind WFI
