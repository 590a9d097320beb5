"""The tables of docs/evidence.md agree with a measurement; the kernel is the most exact method and fits its core."""

from itertools import groupby

import pytest

from docs.generate.commands import DOCS
from steptwin.bench.step_methods.cortex_m3 import CoreFigures, core_rows, ram_bytes
from steptwin.bench.step_methods.evaluation import MethodErrors
from steptwin.bench.step_methods.motions import all_motions
from steptwin.bench.step_methods.table import COLUMNS, measured, table_rows
from steptwin.controller.motion.backend import Kernel
from steptwin.features.kernel_c.image import COMPILER, compiler_version

pytestmark = pytest.mark.slow  # the measurement takes seconds

MOTIONS = [
    "warehouse-scara pull-line", "lab-scara spiral", "hybrid-arm helix", "teaching-scara carry", "seven axes, 14 kHz",
]  # fmt: skip
SPEED, LOAD = COLUMNS.index("M steps/s"), COLUMNS.index("M3 %")


@pytest.fixture(scope="module")
def both(fast_kernel: Kernel) -> tuple[list[MethodErrors], list[CoreFigures]]:
    return measured(all_motions(), fast_kernel)


@pytest.fixture
def figures(both: tuple[list[MethodErrors], list[CoreFigures]]) -> list[MethodErrors]:
    return both[0]


@pytest.fixture
def on_core(both: tuple[list[MethodErrors], list[CoreFigures]]) -> list[CoreFigures]:
    if not both[1]:
        pytest.skip(f"numba, unicorn or {COMPILER} is not installed")
    return both[1]


@pytest.fixture
def on_the_pages_core(on_core: list[CoreFigures]) -> list[CoreFigures]:
    """Instructions are the same on every machine, but not those of another compiler."""
    if not compiler_version().startswith("12.2."):
        pytest.skip("the pages have the figures of gcc 12.2")
    return on_core


def page_rows(heading: str) -> list[list[str]]:
    """Return the rows of the table under a heading of the page."""
    page = (DOCS / "evidence.md").read_text(encoding="utf-8")
    section = page.partition(f"\n## {heading}\n")[2].partition("\n## ")[0]
    rows = [line.strip("| ").split(" | ") for line in section.splitlines() if line.startswith("| ")]
    return [row for row in rows if row[0].removesuffix(", halting") in MOTIONS]


def test_the_page_agrees_with_a_measurement(figures: list[MethodErrors]) -> None:
    """All columns agree but the speed of this machine and, tested below, the load of an emulated core."""
    found, made = page_rows("Pulse timing beside other methods"), table_rows(figures)
    assert [row[:SPEED] for row in found] == [row[:SPEED] for row in made]


def test_the_page_says_what_the_kernel_costs_a_cortex_m3(
    figures: list[MethodErrors], on_the_pages_core: list[CoreFigures]
) -> None:
    assert [row[LOAD] for row in page_rows("Pulse timing beside other methods")] == [
        row[LOAD] for row in table_rows(figures)
    ]
    assert page_rows("The kernel on a Cortex-M3") == core_rows(on_the_pages_core)


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


def test_the_budget_of_the_firmware_page(on_the_pages_core: list[CoreFigures]) -> None:
    """RAM for 1 to 8 axes, also with half the queue; the loads of seven axes are those above."""
    single, _, halting = [row for row in on_the_pages_core if row.motion == MOTIONS[-1]]
    page = (DOCS / "firmware.md").read_text(encoding="utf-8")
    for axes in range(1, 9):
        ram = ram_bytes(axes, 1, single.stack_bytes)
        assert f"\n| {axes} | {ram} | {ram - axes * 32 * 32} | " in page
    loads = (single.mean_percent, single.worst_percent, halting.worst_percent)
    assert f" | {' | '.join(f'{load:.1f} %' for load in loads)} |\n| 8 | " in page


def test_no_method_comes_nearer_than_the_kernel(figures: list[MethodErrors]) -> None:
    """On every motion the kernel has the smallest median, p99 and maximum timing error, and maximum position error."""
    by_motion = {motion: list(rows) for motion, rows in groupby(figures, key=lambda row: row.motion)}
    assert list(by_motion) == MOTIONS
    for kernel, *others in by_motion.values():
        assert kernel.method == "kernel"
        assert len(others) == 5
        for other in others:
            nearer = [mine < theirs for mine, theirs in zip(_errors(kernel), _errors(other), strict=True)]
            assert nearer == [True] * 4, other


def _errors(row: MethodErrors) -> list[float]:
    found = (row.timing_us_p50, row.timing_us_p99, row.timing_us_max, row.error_steps_max)
    return [value for value in found if value is not None]
