"""The table of docs/benchmarks.md agrees with a measurement, and the kernel is the most exact method in it."""

from itertools import groupby

import pytest

from docs.generate.pieces import DOCS
from steptwin.bench.pulses.evaluation import Figures
from steptwin.bench.pulses.motions import all_motions
from steptwin.bench.pulses.table import COLUMNS, measured, table_rows
from steptwin.controller.backend import Kernel

MOTIONS = [
    "warehouse-scara drawer-pull", "lab-scara spiral", "hybrid-arm helix", "teaching-scara carry", "seven axes, 14 kHz",
]  # fmt: skip
SPEED = COLUMNS.index("M steps/s")


@pytest.fixture(scope="module")
def figures(fast_kernel: Kernel) -> list[Figures]:
    return measured(all_motions(), fast_kernel)[0]


def test_the_page_agrees_with_a_measurement(figures: list[Figures]) -> None:
    """All columns agree but the speed of this machine."""
    page = (DOCS / "benchmarks.md").read_text(encoding="utf-8")
    rows = [line.strip("| ").split(" | ") for line in page.splitlines() if line.startswith("| ")]
    found = [row for row in rows if row[0] in MOTIONS]
    made = table_rows(figures)
    assert [row[:SPEED] + row[SPEED + 1 :] for row in found] == [row[:SPEED] + row[SPEED + 1 :] for row in made]


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
