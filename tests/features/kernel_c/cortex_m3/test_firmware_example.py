"""The example firmware for an STM32F103 builds and boots; its edges are numba's, and its pins play them."""

import shutil
import subprocess
from dataclasses import dataclass
from pathlib import Path

import pytest

from steptwin.controller.motion import kernel as k
from steptwin.controller.motion.backend import Kernel
from steptwin.features.kernel_c.image import COMPILER
from steptwin.host.cli.app import run
from steptwin.protocol.od import UNITS_PER_FULL_STEP
from tests.controller.motion.kernel_rig import KernelRig

pytest.importorskip("unicorn", reason="the extra `m3` (unicorn) is not installed")
if shutil.which(COMPILER) is None:
    pytest.skip(f"{COMPILER} is not installed", allow_module_level=True)

from tests.features.kernel_c.cortex_m3.f103 import F103

pytestmark = pytest.mark.slow
EXAMPLE = Path(__file__).parents[4] / "examples" / "stm32f103"
AXES, SEGMENTS, SEGMENT_TICKS = 7, 20, 200
TICKS = 3 * SEGMENT_TICKS + 20
"""Ticks that are run: three reversals."""
DELAY_COUNTS = 2 * k.TICK_COUNTS
"""An edge is played two ticks after its time: one in which it is computed, one in which it is handed to the timers."""


@dataclass(frozen=True)
class Edges:
    """The edges of motion.h in TICKS: of each axis, and all words in the firmware's order."""

    clk: list[list[int]]
    direction: list[list[int]]
    words: list[int]


@pytest.fixture(scope="module")
def edges(fast_kernel: Kernel) -> Edges:
    rig = KernelRig(fast_kernel, AXES)
    rig.group[k.RATE_FROM_Q16] = k.FULL_RATE_Q16
    for axis in range(AXES):
        for segment in range(SEGMENTS):
            way = (axis + 1) * 2 * UNITS_PER_FULL_STEP + 77 * segment
            assert rig.push_ticks(way if segment % 2 == 0 else -way, 0, SEGMENT_TICKS, axis) == k.ACCEPTED
        rig.start(axis)
    found = Edges([[] for _ in range(AXES)], [[] for _ in range(AXES)], [])
    for _ in range(TICKS):
        rig.advance(1)
        for axis in range(AXES):
            for rows, row, field in ((found.clk, rig.clk, k.CLK_EDGES), (found.direction, rig.direction, k.DIR_EDGES)):
                new = [int(word) for word in row[axis][: rig.get(field, axis)]]
                rows[axis] += new
                found.words.extend(new)
                rig.set(field, 0, axis)
    return found


@pytest.fixture(scope="module")
def board(tmp_path_factory: pytest.TempPathFactory) -> F103:
    """Return the example, built as its Makefile builds it, after TICKS."""
    folder = tmp_path_factory.mktemp("firmware") / "stm32f103"
    shutil.copytree(EXAMPLE, folder)
    assert run(["kernel-c", str(folder / "kernel")]) == 0
    made = subprocess.run(["make", "--silent"], cwd=folder, capture_output=True, text=True, check=False)
    assert (made.returncode, made.stderr) == (0, "")
    board = F103(folder)
    board.run_ticks(TICKS)
    return board


def test_its_edges_are_numbas(board: F103, edges: Edges) -> None:
    expected = 2_166_136_261  # FNV-1a
    for word in edges.words:
        expected = (expected ^ word & 0xFFFF_FFFF) * 16_777_619 & 0xFFFF_FFFF
    clk_edges = sum(map(len, edges.clk))
    assert clk_edges > 4_800
    assert (board.word("fault"), board.word("edge_count"), board.word("edge_hash")) == (0, clk_edges, expected)


def test_each_clk_pin_changes_in_the_count_of_its_edge(board: F103, edges: Edges) -> None:
    """Whatever is in flight at a tick's end: about one pulse in eight is."""
    end = board.now_counts
    assert board.clk == [[edge + DELAY_COUNTS for edge in row if edge + DELAY_COUNTS <= end] for row in edges.clk]
    pulses = zip(edges.clk[6][::2], edges.clk[6][1::2], strict=False)
    assert any(fall // k.TICK_COUNTS > rise // k.TICK_COUNTS for rise, fall in pulses)


def test_each_dir_pin_changes_within_a_microsecond(board: F103, edges: Edges) -> None:
    for played, words in zip(board.direction, edges.direction, strict=True):
        assert len(words) == 4
        assert [level for _, level in played] == [word & 1 for word in words]
        for (at, _), word in zip(played, words, strict=True):
            assert -72 <= at - ((word >> 1) + DELAY_COUNTS) <= 72


def test_its_memory_fits(board: F103) -> None:
    """The linker asserts 768 bytes for the stack; an interrupt pushes 32 more than a call, and CAN will want some."""
    assert board.stack_left() >= 2_000
