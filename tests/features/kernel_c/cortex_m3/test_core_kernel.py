"""The kernel on the emulated core: the same bits as plain Python's and numba's."""

import shutil
from pathlib import Path

import pytest

from steptwin.controller.motion import kernel as k
from steptwin.controller.motion.backend import Kernel
from steptwin.features.kernel_c.image import COMPILER, build
from steptwin.features.kernel_c.layout import BODY, kernel_files
from steptwin.features.kernel_c.meter import Disassembly
from steptwin.host.cli.app import run
from tests.controller.motion.kernel_rig import KernelRig
from tests.end_to_end.fingerprints import INTEGERS, fingerprint
from tests.features.kernel_c.scenarios import play, scenario
from tests.features.kernel_c.test_kernel_files import SEEDS, WHOLE

pytest.importorskip("unicorn", reason="the extra `m3` (unicorn) is not installed")
if shutil.which(COMPILER) is None:
    pytest.skip(f"{COMPILER} is not installed", allow_module_level=True)

from steptwin.features.kernel_c.core_kernel import cortex_m3_kernel, kernel_of
from tests.messages import refusing


@pytest.mark.slow
def test_a_whole_run(carry_run: Path, tmp_path: Path) -> None:
    """Host, bus and firmware around the core: `run --kernel cortex-m3` leaves the same edges and frames."""
    assert run(["run", "teaching-scara", "carry", "--kernel", "cortex-m3", "--out", str(tmp_path / "run")]) == 0
    for name in INTEGERS:
        assert fingerprint(tmp_path / "run", name) == fingerprint(carry_run, name)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("right", "wrong"),
    [
        pytest.param("(int64_t)c * s + half) >> 30", "(int64_t)c * s - half) >> 30", id="rounding"),
        pytest.param("s_remainder >= n", "s_remainder > n", id="remainder"),
        pytest.param(
            "counter_q16 - q >= ST_THRESHOLD_Q16", "counter_q16 - q >= ST_THRESHOLD_Q16 + 4096", id="threshold"
        ),
        pytest.param("rise = max_64(due, earliest)", "rise = due", id="waiting"),
        pytest.param("duration_ticks > ST_DURATION_MAX_MS", "duration_ticks > 1 + ST_DURATION_MAX_MS", id="refusal"),
        pytest.param(
            "return -(int64_t)divide((uint64_t)-numerator + (divisor - 1U)",
            "return -(int64_t)divide((uint64_t)-numerator + (divisor - divisor)",
            id="floor",
        ),
        pytest.param("quotient -= 1;", "", id="negative time"),
    ],
)
def test_a_wrong_kernel_is_caught(right: str, wrong: str, fast_kernel: Kernel) -> None:
    """Each mutation of the C makes a difference in the scenarios that all forms of the kernel play."""
    files = kernel_files()
    assert files[BODY].count(right) == 1
    mutant = kernel_of(build(files | {BODY: files[BODY].replace(right, wrong)}))
    assert any(play(mutant, scenario(seed), WHOLE) != play(fast_kernel, scenario(seed), WHOLE) for seed in SEEDS)


def test_a_cell_beyond_its_width_is_refused_and_not_cut() -> None:
    rig = KernelRig(cortex_m3_kernel())
    rig.set(k.COUNTER, 1 << 31)
    with refusing(OverflowError):
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


def test_cycles_by_hand() -> None:
    """Two loads in a row, a division, a long product, a list of registers: 20 bytes, fetched in three lines of 8."""
    lines = [
        "ldr\tr0, [r1]",
        "ldr.w\tr2, [r1, #4]",
        "udiv\tr0, r0, r2",
        "smull\tr0, r1, r2, r3",
        "pop\t{r4-r7, pc}",
    ]
    text = "\n".join(f" {0x100 + 4 * i:x}:\t{'f000 0000'} \t{line}" for i, line in enumerate(lines))
    block = Disassembly(text).block(0x100, 20)
    assert (block.instructions, block.end) == (5, 0x114)
    assert block.cycles == (1 + 1 + 2 + 3 + 6, 2 + 1 + 7 + 4 + 6, 2 + 2 + 12 + 5 + 6)
    assert block.flash_waits == 0  # 3 lines take 9 cycles, less than the instructions
    loads = Disassembly(text).block(0x100, 8)
    assert (loads.cycles[1], loads.flash_waits) == (3, 0)
    adds = "\n".join(f" {4 * i:x}:\t{'f000 0000'} \tadd.w\tr0, r0, r1" for i in range(4))
    assert Disassembly(adds).block(0, 16).flash_waits == 2 * 3 - 4
