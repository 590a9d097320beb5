"""What instructions cost: table 18-1 of the Cortex-M3's manual, and the fetch from flash."""

import pytest

from steptwin.features.stm32.chip import cells as c
from steptwin.features.stm32.chip.cost import instruction_cycles, straight_cycles
from tests.features.stm32.conftest import FLASH_ACR, PROGRAM, Bench


@pytest.mark.parametrize(
    ("code", "cycles"),
    [
        ((0x1840, 0), 1),  # adds r0, r0, r1
        ((0x4368, 0), 1),  # muls r0, r5
        ((0x6801, 0), 2),  # ldr r1, [r0]
        ((0x6001, 0), 2),  # str r1, [r0]
        ((0x4801, 0), 2),  # ldr r0, [pc, #4]
        ((0xB510, 0), 3),  # push {r4, lr}
        ((0xBD10, 0), 3),  # pop {r4, pc}, without its branch
        ((0xC80E, 0), 4),  # ldmia r0!, {r1-r3}
        ((0xE92D, 0x41F0), 7),  # push {r4-r8, lr}
        ((0xE9D0, 0x1200), 3),  # ldrd r1, r2, [r0]
        ((0xF8D0, 0x1004), 2),  # ldr.w r1, [r0, #4]
        ((0xFB90, 0xF1F2), 7),  # sdiv r1, r0, r2: 2 to 12
        ((0xFB00, 0xF101), 1),  # mul r1, r0, r1
        ((0xFB00, 0x1102), 2),  # mla r1, r0, r2, r1
        ((0xFBA0, 0x1202), 5),  # umull r1, r2, r0, r2: 3 to 5
        ((0xF04F, 0x0001), 1),  # mov.w r0, #1
    ],
)
def test_an_instruction_costs_what_the_manual_says(code: tuple[int, int], cycles: int) -> None:
    assert instruction_cycles(*code) == cycles


def test_straight_code_costs_its_instructions_or_its_fetch(bench: Bench) -> None:
    begin = PROGRAM  # cpsid, ldr, mov.w, str, ldr, movs, str, cpsie: 18 bytes, three lines of the flash
    assert straight_cycles(bench.chip.cells, begin, begin + 18) == 1 + 2 + 1 + 2 + 2 + 1 + 2 + 1
    bench.write(FLASH_ACR, 0x17)
    assert bench.chip.cells[c.WAIT_STATES] == 7
    assert straight_cycles(bench.chip.cells, begin, begin + 18) == 2 * 8
