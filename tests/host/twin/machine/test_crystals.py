"""A robot's board with a crystal that is off: what the bus and the drivers show, what the verdict says."""

import numpy as np
import pytest

from steptwin.controller.motion.backend import Kernel
from steptwin.controller.motion.kernel import TICK_COUNTS
from steptwin.host.common.errors import InputError
from steptwin.host.planning.jobs import make_job
from steptwin.host.planning.planner import plan
from steptwin.host.robots import load_robot
from steptwin.host.twin.board_under_test import BoardUnderTest
from steptwin.host.twin.embedded.embedded_board import EmbeddedBoard
from steptwin.host.twin.embedded.execution import execute
from steptwin.host.twin.embedded.outcome import Outcome
from steptwin.host.twin.machine.boards import check_crystals
from steptwin.host.twin.machine.machine_options import read_crystals
from steptwin.host.verify import Report, verify
from tests.messages import refusing

ROBOT = load_robot("teaching-scara")


def carried(kernel: Kernel, *ppm: int) -> tuple[Outcome, Report]:
    """Return the outcome on one board or two, and the verdict by the boards' own time."""
    boards: list[EmbeddedBoard] = []
    motion = plan(ROBOT, make_job(ROBOT, "carry"))
    per_board = None if len(ppm) == 1 else [2, 2]
    outcome = execute(motion, "carry", kernel, axes_per_board=per_board, crystal_ppm=ppm, on_board=boards.append)
    own = boards[0].evidence_by_own_clocks()
    return outcome, verify(outcome.comparison.expected, own, outcome.report.run)


@pytest.fixture(scope="module")
def exact(fast_kernel: Kernel) -> Outcome:
    outcome, own_time = carried(fast_kernel, 0)
    assert outcome.passed
    assert own_time == outcome.report
    assert not {"crystal_ppm", "boards"} & outcome.to_dict().keys()
    return outcome


@pytest.mark.slow
@pytest.mark.parametrize("crystals", [(100,), (-100,), (100, -100)])
def test_a_motion_goes_on_and_the_verdict_tells_its_timing(
    crystals: tuple[int, ...], exact: Outcome, fast_kernel: Kernel
) -> None:
    """By the boards' own time every step is as planned."""
    off, own_time = carried(fast_kernel, *crystals)
    assert off.fault is None
    assert off.report.reasons
    assert own_time.reasons == ()
    assert off.to_dict()["crystal_ppm"] == [*crystals]
    assert off.to_dict().get("boards", []) == [2] * (len(crystals) - 1) * 2
    evidence, other = exact.comparison.evidence, off.comparison.evidence
    for number, (axis, drifted) in enumerate(zip(evidence.axes, other.axes, strict=True)):
        ppm = crystals[number * len(crystals) // len(evidence.axes)]
        assert drifted.step_signs.tolist() == axis.step_signs.tolist()
        for name in ("clk_rise_counts", "clk_fall_counts", "dir_edge_counts", "step_counts"):
            since = getattr(axis, name) - evidence.start_counts
            late = getattr(drifted, name) - other.start_counts - np.rint(since / (1 + ppm / 1e6)).astype(np.int64)
            assert np.ptp(late) <= 1 if late.size else True, name
            assert np.all(np.abs(late) <= TICK_COUNTS)
    timing_us = max(float(axis["timing_error_us_max"]) for axis in off.to_dict()["axes"])
    assert timing_us == pytest.approx(exact.report.run.duration_s * 100, rel=0.2)


@pytest.mark.parametrize(("crystals", "boards"), [([1001], 1), ([5, -1001], 2), ([100], 2), ([0, 0], 1)])
def test_what_is_no_crystal_is_refused(crystals: list[int], boards: int) -> None:
    with refusing(InputError):
        check_crystals(crystals, boards)


def test_what_is_a_crystal_is_taken(fast_kernel: Kernel) -> None:
    for crystals in ([], [0, 0], [1000, -1000]):
        check_crystals(crystals, 2)
    assert read_crystals("100,-100") == [100, -100]
    with refusing(InputError):
        read_crystals("1e2")
    with refusing(InputError):
        BoardUnderTest(ROBOT, kernel=fast_kernel, crystal_ppm=-2000)
