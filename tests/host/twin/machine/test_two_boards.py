"""A six-axis arm on one board and on two with crystals that part: how far the tool is beside its path.

The figures are those of docs/machines.md.
"""

import pytest

from steptwin.controller.motion.backend import Kernel
from steptwin.host.common.findings import Findings
from steptwin.host.planning.plan import Plan
from steptwin.host.planning.planner import plan
from steptwin.host.planning.programs import compile_program, parse_program
from steptwin.host.record.path_error import beside_path
from steptwin.host.robots import load_robot
from steptwin.host.twin.embedded.execution import execute
from tests.end_to_end.pages import read_page

AR4 = load_robot("ar4-mk3")
EXAMPLE = read_page("docs/programs/ar4-mk3.toml")
ROUND = "[[step]]\ngo = { J1 = 30.0, J5 = 45.0 }\n[[step]]\ngo = { J1 = 0.0, J5 = 80.0 }\n"
"""Moves the joints of both boards."""
ROUNDING_MM = 0.055


def planned(program: str) -> Plan:
    return plan(AR4, compile_program(parse_program(program, Findings()), AR4).trajectory)


def beside_mm(kernel: Kernel, motion: Plan, *crystals_ppm: int) -> tuple[float, float, float]:
    """How far the tool is beside its path at most and when, and how far from its place at the instant."""
    boards = None if len(crystals_ppm) == 1 else [3, 3]
    outcome = execute(motion, "example", kernel, axes_per_board=boards, crystal_ppm=crystals_ppm)
    document, beside = outcome.to_dict(), beside_path(outcome.comparison)
    assert beside is not None
    told = {"mm_max": beside.mm, "at_s": beside.at_s}
    assert document.get("beside_path") == (told if any(crystals_ppm) else None)
    return beside.mm, beside.at_s, outcome.report.tool.position_error_mm_max


@pytest.mark.slow
@pytest.mark.parametrize(
    ("crystals_ppm", "beside", "behind"),
    [
        ((0,), ROUNDING_MM, 0.061),
        ((200,), ROUNDING_MM, 1.335),
        ((100, -100), 0.085, 0.664),
        ((1000, -1000), 0.526, 6.204),
    ],
)
def test_one_board_lags_and_two_leave_the_path(
    fast_kernel: Kernel, crystals_ppm: tuple[int, ...], beside: float, behind: float
) -> None:
    beside_path_mm, _, from_place_mm = beside_mm(fast_kernel, planned(EXAMPLE), *crystals_ppm)
    assert (beside_path_mm, from_place_mm) == pytest.approx((beside, behind), abs=5e-4)


@pytest.mark.slow
def test_it_is_farther_beside_its_path_the_longer_it_goes_on(fast_kernel: Kernel) -> None:
    """Three rounds instead of one: 10.04 s more, at some 0.039 mm a second."""
    (once_mm, once_s, _), (thrice_mm, thrice_s, _) = (
        beside_mm(fast_kernel, planned(f'robot = "ar4-mk3"\n{rounds * ROUND}'), 1000, -1000) for rounds in (1, 3)
    )
    assert thrice_s - once_s == pytest.approx(10.04, abs=0.01)
    assert thrice_mm / once_mm == pytest.approx(thrice_s / once_s, rel=0.1)
