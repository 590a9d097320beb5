"""The kernel on the emulated core: the same bits as plain Python's and numba's, and as cheap as the documents say."""

import shutil
from dataclasses import replace

import numpy as np
import pytest

from steptwin.bench.pulses.cortex_m3 import CoreFigures, core_figures, ram_bytes
from steptwin.bench.pulses.kernel import place_once
from steptwin.bench.pulses.motions import PlannedMotion, all_motions
from steptwin.controller import kernel as k
from steptwin.controller.backend import Kernel
from steptwin.emulator.cortex_m3.cycles import Listing
from steptwin.emulator.cortex_m3.image import COMPILER, build, kernel_image
from steptwin.emulator.kernel_c.translation import translate
from tests.controller.kernel_rig import KernelRig
from tests.emulator.kernel_c.scenarios import play, scenario

SEEDS = range(120)
WHOLE = 1 << 20
"""More ticks than any scenario has: each phase is one call."""

pytest.importorskip("unicorn", reason="the extra `m3` (unicorn) is not installed")
if shutil.which(COMPILER) is None:
    pytest.skip(f"{COMPILER} is not installed", allow_module_level=True)

from steptwin.emulator.cortex_m3.kernel import cortex_m3_kernel, kernel_of  # noqa: E402 - needs unicorn


@pytest.fixture(scope="module")
def motions() -> dict[str, PlannedMotion]:
    """Return the motions of the benchmark by name."""
    return {motion.name: motion for motion in all_motions()}


def test_random_scenarios_whole_and_tick_by_tick(fast_kernel: Kernel) -> None:
    for seed in SEEDS:
        told = scenario(seed)
        expected = play(fast_kernel, told, WHOLE)
        assert play(cortex_m3_kernel(), told, WHOLE) == expected
        assert play(cortex_m3_kernel(), told, 1) == expected


@pytest.mark.parametrize("name", ["warehouse-scara drawer-pull", "teaching-scara carry"])
def test_motions_of_the_benchmark(name: str, motions: dict[str, PlannedMotion], fast_kernel: Kernel) -> None:
    on_core, expected = (place_once(kernel, motions[name]).axes for kernel in (cortex_m3_kernel(), fast_kernel))
    for own, other in zip(on_core, expected, strict=True):
        for field in ("rise_counts", "fall_counts", "dir_counts", "dir_levels"):
            assert np.array_equal(getattr(own, field), getattr(other, field)), field


@pytest.mark.parametrize(
    ("right", "wrong"),
    [
        pytest.param("(int64_t)c * s) + half) >> 30", "(int64_t)c * s) - half) >> 30", id="rounding"),
        pytest.param("s_remainder >= n", "s_remainder > n", id="remainder"),
        pytest.param(
            "(counter_q16 - q) >= ST_THRESHOLD_Q16", "(counter_q16 - q) >= ST_THRESHOLD_Q16 + 4096", id="threshold"
        ),
        pytest.param("rise = st_max_64(due, earliest)", "rise = due", id="waiting"),
        pytest.param("ST_DURATION_MAX_MS * ST_TICKS_PER_MS", "ST_DURATION_MAX_MS * ST_TICKS_PER_MS + 1", id="refusal"),
        pytest.param(
            "return -(int64_t)st_divide((uint64_t)-numerator + (divisor - 1U)",
            "return -(int64_t)st_divide((uint64_t)-numerator + (divisor - divisor)",
            id="floor",
        ),
    ],
)
def test_a_wrong_kernel_is_caught(right: str, wrong: str, fast_kernel: Kernel) -> None:
    """Each mutation of the C makes a difference in the scenarios above."""
    source = translate()
    assert source.body.count(right) == 1
    mutant = kernel_of(build(replace(source, body=source.body.replace(right, wrong))))
    assert any(play(mutant, scenario(seed), WHOLE) != play(fast_kernel, scenario(seed), WHOLE) for seed in SEEDS)


def test_a_cell_beyond_its_width_is_refused_and_not_cut() -> None:
    rig = KernelRig(cortex_m3_kernel())
    rig.set(k.COUNTER, 1 << 31)
    with pytest.raises(OverflowError, match="axis 0: counter is 2147483648"):
        rig.advance(1)


def test_a_call_longer_than_the_core_is_given_at_once(fast_kernel: Kernel) -> None:
    """15 s in one call, which is run in two parts."""
    found = []
    for kernel in (cortex_m3_kernel(), fast_kernel):
        rig = KernelRig(kernel)
        rig.tick = 1 << 33
        for i in range(60):
            rig.push((-1) ** i * 2000, 0, 255)
        rig.push(100, 0, 1)
        rig.start()
        rig.advance(160_000)
        found.append((rig.tick, rig.snapshot()))
    assert found[0] == found[1]


@pytest.fixture(scope="module")
def stress(motions: dict[str, PlannedMotion], fast_kernel: Kernel) -> list[CoreFigures]:
    """Return the figures of seven axes at 14 kHz, for one tick a call and four."""
    if fast_kernel.name != "numba":
        pytest.skip("the extra `fast` (numba) is not installed")
    return core_figures(motions["seven axes, 14 kHz"], fast_kernel)


def test_seven_axes_fit_the_core(stress: list[CoreFigures]) -> None:
    """In the busiest 100 ms; cycles follow from counted instructions, so every machine finds the same."""
    single, four = stress
    assert single.cycles_typical <= 920
    assert four.cycles_typical <= 530
    assert max(single.worst_percent, four.worst_percent) <= 40
    assert single.cycles_low < single.cycles_typical < single.cycles_high


def test_code_and_memory_fit(stress: list[CoreFigures]) -> None:
    assert kernel_image().text_bytes <= 5_000
    assert ram_bytes(7, 4, stress[1].stack_bytes) <= 18_500


def test_cycles_by_hand() -> None:
    """Two loads in a row, a division, a long product, a list of registers."""
    lines = [
        "ldr\tr0, [r1]",
        "ldr.w\tr2, [r1, #4]",
        "udiv\tr0, r0, r2",
        "smull\tr0, r1, r2, r3",
        "pop\t{r4-r7, pc}",
    ]
    text = "\n".join(f" {0x100 + 4 * i:x}:\t{'f000 0000'} \t{line}" for i, line in enumerate(lines))
    block = Listing(text).block(0x100, 20)
    assert (block.instructions, block.end) == (5, 0x114)
    assert block.cycles == (1 + 1 + 2 + 3 + 6, 2 + 1 + 7 + 4 + 6, 2 + 2 + 12 + 5 + 6)
