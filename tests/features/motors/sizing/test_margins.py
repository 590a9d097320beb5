"""The borders between keeping step and slipping: their search by bisection, and those of a short run."""

from typing import Any

import numpy as np
import pytest

from steptwin.features.motors.sizing.margins import RESOLUTION, Search, margins_of_run, searches_of, stretch_of_drivers
from steptwin.features.motors.turning import MotorRun, motors_of_run
from steptwin.features.motors.turning.after_run import MotionSlip, first_slip, rotors_after_run
from steptwin.features.motors.turning.driving import stretched_counts
from steptwin.host.verify import Comparison
from tests.features.motors.turning.short_runs import shoulder_turn


def search(run: float, safe: float, risky: float) -> Search:
    """Return a search whose driving is the value itself."""

    def unchanged(value: float) -> Any:
        return value

    return Search("payload_kg", run, safe, risky, unchanged)


class Beyond:
    """A trial in which values beyond a limit slip; it counts."""

    def __init__(self, limit: float, *, upwards: bool) -> None:
        self.limit, self.upwards, self.made = limit, upwards, 0

    def __call__(self, value: Any) -> MotionSlip | None:
        self.made += 1
        return MotionSlip("th1", float(value)) if (value > self.limit) == self.upwards else None


@pytest.mark.parametrize(
    ("run", "safe", "risky", "limit"),
    [
        (0.3, 0.0, 100.0, 7.0), (20.0, 0.0, 100.0, 7.0), (0.0, 0.0, 100.0, 0.5),
        (1.5, 3.0, 0.05, 0.4), (0.2, 3.0, 0.01, 0.4),
    ],
)  # fmt: skip
def test_a_border_is_found_between_its_two_sides(run: float, safe: float, risky: float, limit: float) -> None:
    """From a run that keeps step towards the risk, from one that slips towards safety, upwards and downwards."""
    searched, trial = search(run, safe, risky), Beyond(limit, upwards=risky > safe)
    border = searched.border(trial(run), trial)
    assert border.keeps is not None
    assert border.slips is not None
    low, high = sorted((border.keeps, border.slips))
    assert low <= limit <= high
    assert high / low <= 1.0 + RESOLUTION
    assert (border.joint, border.slips_at_s) == ("th1", border.slips)
    assert trial.made - 1 <= searched.trials_max


def test_a_range_without_a_border_is_told_by_its_end() -> None:
    kept = search(1.0, 0.0, 100.0).border(None, Beyond(1e9, upwards=True))
    assert (kept.keeps, kept.slips, kept.joint, kept.limit) == (100.0, None, "", 100.0)
    lost = search(1.0, 0.0, 100.0).border(MotionSlip("th1", 2.0), Beyond(-1.0, upwards=True))
    assert (lost.keeps, lost.slips, lost.joint, lost.limit) == (None, 0.0, "th1", 0.0)


def test_only_what_follows_the_start_is_stretched() -> None:
    counts = np.array([-5, 0, 100, 101, 110, 1100])
    assert stretched_counts(counts, 0.5, 100).tolist() == [-5, 0, 100, 100, 105, 600]
    assert stretched_counts(counts, 2.0, 100).tolist() == [-5, 0, 100, 102, 120, 2100]


@pytest.mark.slow
def test_the_borders_of_a_run_hold_on_both_sides(comparison: Comparison, ran: MotorRun) -> None:
    reported: list[float] = []
    margins = margins_of_run(searches_of(ran.driving, comparison), ran.slip, reported.append)
    assert reported == sorted(reported)
    assert reported[-1] == 1.0
    current, payload, stretch = margins.borders
    assert [border.quantity for border in margins.borders] == ["current_a", "payload_kg", "stretch"]
    for border, change in (
        (current, ran.driving.at_current), (payload, ran.driving.with_payload), (stretch, ran.driving.stretched)
    ):  # fmt: skip
        assert border.keeps is not None
        assert first_slip(change(border.keeps)) is None
        if border.slips is not None:
            slip = first_slip(change(border.slips))
            assert slip is not None
            assert (slip.joint, slip.at_s) == (border.joint, border.slips_at_s)
    assert current.slips is not None
    assert payload.slips is not None
    assert stretch_of_drivers(comparison) == pytest.approx(stretch.limit)


@pytest.mark.slow
def test_edges_that_are_moved_in_time_are_those_of_a_slower_plan(ran: MotorRun) -> None:
    """The same way in one and a half times the time: planned so, or the faster run's edges moved: within 2 degrees."""
    slower = shoulder_turn(stretch=1.5)
    robot = slower.expected.robot
    assert robot is not None
    planned = np.abs(motors_of_run(robot, slower).trace.load_deg).max(axis=0)
    moved = np.abs(rotors_after_run(ran.driving.stretched(1.5)).load_deg).max(axis=0)
    np.testing.assert_allclose(moved, planned, atol=2.0)
    assert np.abs(moved - np.abs(ran.trace.load_deg).max(axis=0)).max() > 4.0
