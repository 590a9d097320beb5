"""The tables of docs/benchmarks.md agree with a measurement; the kernel is the most exact method and fits its core."""

from itertools import groupby

import pytest

from docs.generate.pieces import DOCS
from steptwin.bench.pulses.cortex_m3 import CoreFigures, core_rows
from steptwin.bench.pulses.evaluation import Figures
from steptwin.bench.pulses.motions import all_motions
from steptwin.bench.pulses.table import COLUMNS, measured, table_rows
from steptwin.controller.backend import Kernel
from steptwin.emulator.cortex_m3.image import COMPILER, compiler_version

MOTIONS = [
    "warehouse-scara drawer-pull", "lab-scara spiral", "hybrid-arm helix", "teaching-scara carry", "seven axes, 14 kHz",
]  # fmt: skip
SPEED, LOAD = COLUMNS.index("M steps/s"), COLUMNS.index("M3 %")


@pytest.fixture(scope="module")
def both(fast_kernel: Kernel) -> tuple[list[Figures], list[CoreFigures]]:
    return measured(all_motions(), fast_kernel)


@pytest.fixture
def figures(both: tuple[list[Figures], list[CoreFigures]]) -> list[Figures]:
    return both[0]


@pytest.fixture
def on_core(both: tuple[list[Figures], list[CoreFigures]]) -> list[CoreFigures]:
    if not both[1]:
        pytest.skip(f"numba, unicorn or {COMPILER} is not installed")
    return both[1]


def page_rows(heading: str) -> list[list[str]]:
    """Return the rows of the table under a heading of the page."""
    page = (DOCS / "benchmarks.md").read_text(encoding="utf-8")
    section = page.partition(f"\n## {heading}\n")[2].partition("\n## ")[0]
    rows = [line.strip("| ").split(" | ") for line in section.splitlines() if line.startswith("| ")]
    return [row for row in rows if row[0].removesuffix(", halting") in MOTIONS]


def test_the_page_agrees_with_a_measurement(figures: list[Figures]) -> None:
    """All columns agree but the speed of this machine and, tested below, the load of an emulated core."""
    found, made = page_rows("Pulse timing beside other methods"), table_rows(figures)
    assert [row[:SPEED] for row in found] == [row[:SPEED] for row in made]


def test_the_page_says_what_the_kernel_costs_a_cortex_m3(figures: list[Figures], on_core: list[CoreFigures]) -> None:
    """Cycles follow from counted instructions. They are the same on every machine with the compiler of the page."""
    if "12.2" not in compiler_version():
        pytest.skip("the page's figures are of gcc 12.2")
    assert [row[LOAD] for row in page_rows("Pulse timing beside other methods")] == [
        row[LOAD] for row in table_rows(figures)
    ]
    assert page_rows("The kernel on a Cortex-M3") == core_rows(on_core)


def test_seven_axes_at_14_khz_fit_a_cortex_m3(on_core: list[CoreFigures]) -> None:
    """In the busiest 100 ms of the stress test: one tick a call, four, and one during a halt."""
    single, four, halting = [row for row in on_core if row.motion == MOTIONS[-1]]
    assert (single.halting, four.ticks_a_call, halting.halting) == (False, 4, True)
    assert single.cycles_low < single.cycles_typical <= 850
    assert single.worst_percent <= 40
    assert four.cycles_typical <= 520
    assert halting.mean_percent < halting.busiest_percent < halting.worst_percent <= 50
    assert single.text_bytes <= 5_000
    assert four.ram_bytes <= 18_500


def test_no_method_comes_nearer_than_the_kernel(figures: list[Figures]) -> None:
    """On every motion the kernel has the smallest median, p99 and maximum timing error, and maximum position error."""
    by_motion = {motion: list(rows) for motion, rows in groupby(figures, key=lambda row: row.motion)}
    assert list(by_motion) == MOTIONS
    for kernel, *others in by_motion.values():
        assert kernel.method == "kernel"
        assert len(others) == 5
        for other in others:
            nearer = [mine < theirs for mine, theirs in zip(_errors(kernel), _errors(other), strict=True)]
            assert nearer == [True] * 4, other


def _errors(row: Figures) -> list[float]:
    found = (row.timing_us_p50, row.timing_us_p99, row.timing_us_max, row.error_steps_max)
    return [value for value in found if value is not None]
