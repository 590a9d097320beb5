"""Where an image's time goes, its stack, and its pins' waveform."""

from pathlib import Path

import pytest

from steptwin.features.stm32.chip import cells as c
from steptwin.features.stm32.chip.engine import Stm32Chip
from steptwin.features.stm32.image import read_image
from steptwin.features.stm32.outcome import fault_sentence
from steptwin.features.stm32.running import RunPlan, run_image
from steptwin.features.stm32.section import ChipPin
from tests.features.stm32.conftest import FIRST_HANDLER, GPIOA, MAIN, PROGRAM, Bench
from tests.features.stm32.examples import EXAMPLES, example_robot

_IMAGE = read_image(EXAMPLES / "compare_stepper.elf")
_NVIC_ENABLE = 0xE000E100


def test_the_time_of_functions_sleep_and_exceptions_is_all_the_time() -> None:
    run = run_image(EXAMPLES / "compare_stepper.elf", example_robot(), RunPlan(for_s=0.003, compiled=False))
    profile = run.profile
    functions = {each.name: each for each in profile.functions}
    assert functions.keys() == {"uart_say", "edge", "tim2", "main", "reset", "move_to"}
    assert functions["uart_say"].time_s == pytest.approx(0.52e-3, rel=0.05)  # six bytes at 115 200 baud
    parts = sum(each.percent for each in profile.functions)
    assert parts + profile.asleep_percent + profile.exceptions_percent == pytest.approx(100.0)
    assert [each.time_s for each in profile.functions] == sorted((e.time_s for e in profile.functions), reverse=True)
    assert profile.masked_by == ""


def test_the_longest_time_with_interrupts_off_is_that_of_main(bench: Bench) -> None:
    bench.chip.close()
    bench = Bench(MAIN, {16 + 28: FIRST_HANDLER})
    bench.run(300)
    # from CPSID to CPSIE of handlers.S: ldr, mov.w, str, ldr, movs, str, cpsie, at 72 MHz without wait states
    cycles = bench.chip.cells[c.LONGEST_MASKED] / bench.chip.cells[c.CYCLE]
    assert cycles == 2 + 1 + 2 + 2 + 1 + 2 + 1
    assert bench.chip.cells[c.LONGEST_MASKED_BY] == PROGRAM + MAIN
    assert bench.chip.cells[c.MASKED_AT] == c.NEVER


def test_the_stack_is_what_lies_behind_the_longest_untouched_stretch() -> None:
    table = b"".join(each.to_bytes(4, "little") for each in (0x20005000, PROGRAM + 1))
    chip = Stm32Chip([(0x08000000, table)], 0x08000000, compiled=False)
    used, size = chip.stack_used()
    assert (used, size) == (0, 0x5000)
    chip.set_memory(0x20004F00, b"\1")  # the deepest word
    chip.set_memory(0x20000000, bytes(0x400))  # variables, or a heap that grows towards it
    assert chip.stack_used() == (0x100, 0x5000)
    chip.set_memory(0x20000000, bytes(0x5000))
    assert chip.stack_used() == (0x5000, 0x5000)
    chip.close()


def _overflowing(data_end: int) -> Stm32Chip:
    """Return a chip whose stack has 31 or 32 bytes left when an interrupt comes."""
    vectors = [0x20000100, PROGRAM + 1, *[PROGRAM + 1] * 74]
    table = b"".join(each.to_bytes(4, "little") for each in vectors)
    code = bytes.fromhex("fee7")  # b .
    chip = Stm32Chip([(0x08000000, table), (PROGRAM, code)], 0x08000000, data_end=data_end, compiled=False)
    chip.cells[c.SYSTICK_CONTROL] = 0
    return chip


@pytest.mark.parametrize(("data_end", "fault"), [(0x200000E0, 0), (0x200000E4, c.FAULT_STACK)])
def test_an_interrupt_whose_frame_reaches_the_variables_is_a_stack_overflow(data_end: int, fault: int) -> None:
    chip = _overflowing(data_end)
    chip.run(10)
    chip.cells[c.PENDING_SYSTEM], chip.cells[c.BEST] = 1 << 15, 15
    chip.run(60)
    assert chip.cells[c.FAULT] == fault
    if fault:
        told = fault_sentence(chip, _IMAGE)
        assert "stack overflow: the stack is at 0x200000E0, but what it may use begins at 0x200000E4; r0=" in told
    chip.close()


def test_a_stack_that_leaves_the_ram_is_told_as_such() -> None:
    vectors = [0x20000004, PROGRAM + 1, *[PROGRAM + 1] * 74]
    table = b"".join(each.to_bytes(4, "little") for each in vectors)
    code = bytes.fromhex("00b5fde7")  # push {lr}; b .-2
    chip = Stm32Chip([(0x08000000, table), (PROGRAM, code)], 0x08000000, compiled=False)
    chip.run(100)
    told = fault_sentence(chip, _IMAGE)
    assert "stack overflow: the stack has left the RAM, which begins at 0x20000000, by 0x1FFFFFFC; r0=" in told
    chip.close()


def test_a_pin_that_becomes_an_input_again_is_known(bench: Bench) -> None:
    bench.write(GPIOA, 0x44444433)
    assert [bench.chip.was_output(pin) for pin in (0, 1, 2)] == [True, True, False]
    bench.write(GPIOA, 0x44444443)
    assert [bench.chip.left_output(pin) for pin in (0, 1, 2)] == [False, True, False]


def test_the_waveform_has_the_chosen_pins(tmp_path: Path) -> None:
    path = tmp_path / "pins.vcd"
    pins = [ChipPin.of("PA1"), ChipPin.of("PB3")]
    plan = RunPlan(for_s=0.002, vcd=path, pins=pins, compiled=False)
    run_image(EXAMPLES / "compare_stepper.elf", example_robot(), plan)
    lines = path.read_text(encoding="utf-8").splitlines()
    assert [line.split()[4] for line in lines if line.startswith("$var")] == ["chip_PA1", "chip_PB3"]
    assert lines[lines.index("$dumpvars") + 1 :][:3] == ["0!", '0"', "$end"]
    changes = [line for line in lines[lines.index("$end") :] if not line.startswith("#")]
    assert changes == ["$end", "1!"]
