"""Jobs that are paused and resumed on the way: the same counts, the same path, outputs within their pauses."""

from collections.abc import Callable
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from numpy.typing import NDArray

from steptwin.controller.motion.backend import Kernel
from steptwin.host.verify import AS_PLANNED, AxisEvidence, verify
from tests.end_to_end.halted_runs import Break, HaltedRun, run_with

TH1 = 3
ARM = range(3, 6)


PAUSED = [Break(0.8, 1.0)]


def pulled(kernel: Kernel, duration_s: float, breaks: list[Break]) -> HaltedRun:
    return run_with(kernel, "pull-line", breaks, {"duration_s": str(duration_s), "ramp_s": str(duration_s / 5)})


@pytest.fixture(scope="module")
def planned(fast_kernel: Kernel) -> Callable[[float], HaltedRun]:
    """Return what gives the run of a duration without a pause."""
    return cache(lambda duration_s: pulled(fast_kernel, duration_s, []))


@pytest.fixture(scope="module")
def paused(fast_kernel: Kernel) -> HaltedRun:
    """Return a run that rests for 1 s in the middle."""
    return pulled(fast_kernel, 2.0, PAUSED)


def places(run: HaltedRun) -> list[list[int]]:
    """Return all values of each axis' counter, in their order."""
    return [[int(place) for place in axis.start_steps + np.cumsum(axis.step_signs)] for axis in run.evidence.axes]


def steps_off_the_path(
    before: AxisEvidence, after: AxisEvidence, th1_before: AxisEvidence, th1_after: AxisEvidence
) -> NDArray[np.float64]:
    """Return how far each step lies outside the piece of the path between two steps of th1, in steps of its axis.

    th1 moves one way only. A step made between two of its steps belongs between the same two in the planned motion.
    """
    pieces = np.concatenate(([-np.inf], th1_before.step_counts, [np.inf]))
    at = np.searchsorted(th1_after.step_counts, after.step_counts)
    planned_counts = before.step_counts.astype(np.float64)
    outside_counts = np.maximum(pieces[at] - planned_counts, planned_counts - pieces[at + 1])
    off: NDArray[np.float64] = np.maximum(outside_counts, 0) / np.gradient(planned_counts)
    return off


def late_s(run: HaltedRun, planned: HaltedRun) -> float:
    """Return by how many seconds th1 makes its last step later than planned."""
    ends = [each.evidence.axes[TH1].step_counts[-1] - each.evidence.start_counts for each in (run, planned)]
    return float(ends[0] - ends[1]) / 72e6


@pytest.mark.slow
@pytest.mark.parametrize(
    ("duration_s", "breaks"),
    [
        pytest.param(2.0, PAUSED, id="a short one"),
        pytest.param(10.0, [Break(0.0, 1.0)], id="at the start"),
        pytest.param(10.0, [Break(3.0, 0.0)], id="only just"),
        pytest.param(10.0, [Break(2.0, 1.0), Break(5.0, 1.3)], id="twice"),
        pytest.param(10.0, [Break(4.0, 1.0), Break(4.0, 1.0)], id="twice in one place"),
        pytest.param(10.0, [Break(9.9, 30.0)], id="long before the end"),
    ],
)
def test_the_drawer_pull_keeps_its_path(
    fast_kernel: Kernel, planned: Callable[[float], HaltedRun], duration_s: float, breaks: list[Break]
) -> None:
    run, as_planned = pulled(fast_kernel, duration_s, breaks), planned(duration_s)
    assert run.outcome.fault is None
    assert run.halted == (True,) * len(breaks)
    assert places(run) == places(as_planned)
    report = run.verify()
    assert report.passed, report.reasons
    _judged_alike(run)
    before, after = as_planned.evidence.axes, run.evidence.axes
    for axis in ARM:
        assert steps_off_the_path(before[axis], after[axis], before[TH1], after[TH1]).max() < 0.1
    rested_s = sum(lasts_s for _, lasts_s in breaks)
    assert rested_s < late_s(run, as_planned) < rested_s + 0.05 * len(breaks)


def _judged_alike(run: HaltedRun) -> None:
    """The run's own verdict says what that by the firmware's ramps says, to the tick that those are made of."""
    own, by_ramps = run.outcome.report, run.verify()
    assert own.passed, own.reasons
    for mine, theirs in zip(own.axes, by_ramps.axes, strict=True):
        assert mine.position_error_steps_max == pytest.approx(theirs.position_error_steps_max, abs=0.002)
    assert [speed.percent for speed in own.speeds] == [percent for _ in run.halted for percent in (0, 100)]
    blind = replace(run.evidence, axes=tuple(replace(axis, rates=AS_PLANNED) for axis in run.evidence.axes))
    assert not verify(run.outcome.comparison.expected, blind, own.run).passed, "by the board's clock it is another"


def test_the_machine_stands_still_in_a_pause(paused: HaltedRun) -> None:
    for axis in ARM:
        assert np.diff(paused.evidence.axes[axis].step_counts).max() > 1.0 * 72e6


@pytest.mark.slow
def test_a_paused_run_is_the_same_every_time(fast_kernel: Kernel, paused: HaltedRun) -> None:
    again = pulled(fast_kernel, 2.0, PAUSED)
    assert again.outcome.bus_log == paused.outcome.bus_log
    for one, other in zip(again.evidence.axes, paused.evidence.axes, strict=True):
        assert np.array_equal(one.clk_rise_counts, other.clk_rise_counts)


@pytest.mark.slow
@pytest.mark.parametrize(
    "breaks",
    [
        [Break(1.0, 1.0)],
        [Break(1.2, 1.0)],
        [Break(1.3, 1.0)],
        [Break(0.5, 3.0), Break(8.5, 1.0), Break(8.6, 0.0), Break(10.8, 1.0), Break(12.0, 1.0), Break(13.3, 1.0)],
    ],
    ids=["on the way to the first", "just before it", "within it", "before and within all"],
)
def test_outputs_go_by_the_trajectory(fast_kernel: Kernel, breaks: list[Break]) -> None:
    """`store` stands still four times for a magnet or a lock: from 1.238, 8.589, 10.889 and 13.189 s for 0.3 s.

    Points every 40 ms are enough for these slow motions, and make the runs cheaper.
    """
    run = run_with(fast_kernel, "store", breaks, {"pull_s": "2"}, point_ms=40)
    assert all(run.halted)
    report = run.verify()
    assert report.passed, report.reasons
    assert [round(output.from_s, 3) for output in report.outputs] == [1.238, 8.589, 10.889, 13.189]
    for output in report.outputs:
        assert output.changed_s == pytest.approx(output.from_s + 0.01, abs=0.012)
    _judged_alike(run)
