"""A six-axis arm on one board and on two with crystals that part: how far the tool is from its place.

The figures are those of docs/machines.md.
"""

import pytest

from steptwin.controller.motion.backend import Kernel
from steptwin.host.common.findings import Findings
from steptwin.host.planning.planner import plan
from steptwin.host.planning.programs import compile_program, parse_program
from steptwin.host.robots import load_robot
from steptwin.host.twin.embedded.execution import execute
from tests.end_to_end.pages import read_page

AR4 = load_robot("ar4-mk3")
EXAMPLE = read_page("docs/programs/ar4-mk3.toml")


@pytest.mark.slow
@pytest.mark.parametrize(
    ("crystals_ppm", "off_mm"),
    [((0,), 0.061), ((200,), 1.335), ((100, -100), 0.664), ((1000, -1000), 6.204)],
)
def test_boards_with_other_crystals_take_the_tool_from_its_place(
    fast_kernel: Kernel, crystals_ppm: tuple[int, ...], off_mm: float
) -> None:
    motion = plan(AR4, compile_program(parse_program(EXAMPLE, Findings()), AR4).motion)
    boards = None if len(crystals_ppm) == 1 else [3, 3]
    outcome = execute(motion, "example", fast_kernel, axes_per_board=boards, crystal_ppm=crystals_ppm)
    assert outcome.passed is not any(crystals_ppm)
    assert outcome.report.tool.position_error_mm_max == pytest.approx(off_mm, abs=5e-4)
