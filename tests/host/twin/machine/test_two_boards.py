"""A six-axis arm on one board and on two with crystals that part: how far the tool is beside its path.

The figures are those of docs/machines.md.
"""

from functools import cache

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
HEAD, _, STEPS = EXAMPLE.partition("[[step]]\n")
ROUNDING_MM = 0.055


@cache
def planned(times: int = 1) -> Plan:
    """The example, so many times one after the other."""
    text = HEAD + times * f"[[step]]\n{STEPS}\n"
    return plan(AR4, compile_program(parse_program(text, Findings()), AR4).trajectory)


def beside_mm(kernel: Kernel, motion: Plan, *crystals_ppm: int) -> tuple[float, float]:
    """How far the tool is beside its path at most, and from its place at the instant."""
    boards = None if len(crystals_ppm) == 1 else [3, 3]
    outcome = execute(motion, "example", kernel, axes_per_board=boards, crystal_ppm=crystals_ppm)
    document, beside = outcome.to_dict(), beside_path(outcome.comparison)
    assert beside is not None
    told = {"mm_max": beside.mm, "at_s": beside.at_s}
    assert document.get("beside_path") == (told if any(crystals_ppm) else None)
    return beside.mm, outcome.report.tool.position_error_mm_max


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
    assert beside_mm(fast_kernel, planned(), *crystals_ppm) == pytest.approx((beside, behind), abs=5e-4)


def test_twice_the_time_is_twice_as_far(fast_kernel: Kernel) -> None:
    """The place where it is farthest comes again in the second round, 27.94 s later."""
    once_mm, at_s = 0.526, 22.77
    twice_mm, _ = beside_mm(fast_kernel, planned(2), 1000, -1000)
    assert twice_mm - ROUNDING_MM == pytest.approx((once_mm - ROUNDING_MM) * (at_s + 27.94) / at_s, rel=0.1)
