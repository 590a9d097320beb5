"""Reports of a run find their place in the motion's own time, whatever a pause or a slow computer does to them."""

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
import pytest
from scipy.interpolate import CubicHermiteSpline

from steptwin.features.panel.service.results import REPORTS_MAX, AxisReports, Placed, Thinned, placed, time_bounds
from steptwin.host.common.arrays import FloatArray
from steptwin.host.operate.running import AxisEnd, LiveOutcome
from steptwin.host.planning.jobs import make_job
from steptwin.host.planning.plan import Plan
from steptwin.host.planning.planner import plan
from steptwin.host.robots import load_robot

ROBOT = load_robot("lab-scara")


@pytest.fixture(scope="module")
def spiral() -> Plan:
    return plan(ROBOT, make_job(ROBOT, "spiral"))


@dataclass(frozen=True)
class Course:
    """How the motion's time passes on the bus' clock: (clock, motion) in seconds, straight between them."""

    corners_s: tuple[tuple[float, float], ...]

    def motion_s(self, clock_s: FloatArray) -> FloatArray:
        clocks, motions = zip(*self.corners_s, strict=True)
        return np.asarray(np.interp(clock_s, clocks, motions))


STEADY = Course(((0.0, 0.0), (100.0, 100.0)))
PAUSED = Course(((0.0, 0.0), (4.0, 4.0), (4.4, 4.2), (64.4, 4.2), (64.8, 4.4), (164.8, 104.4)))
"""Paused for a minute, with ramps."""
HELD_UP = Course(tuple((t / 2, t / 3) for t in range(60)))
"""As on a clock that counts while the board's stands for a third of the time."""


def reported(spiral: Plan, course: Course, late_s: float = 0.0) -> tuple[AxisReports, ...]:
    """Return what the axes report: positions every 30 ms, records every 100 ms, frames up to `late_s` late."""
    begins_s = spiral.times_ms / 1000
    late = np.random.default_rng(1)
    made = tuple(AxisReports() for _ in ROBOT.joints)
    for axis, reports in enumerate(made):
        demanded = CubicHermiteSpline(begins_s, spiral.points_units[:, axis], spiral.velocities[:, axis] * 1000 / 64)
        at_s = np.arange(0.007 * axis, course.corners_s[-1][0], 0.03)
        places = demanded(np.minimum(course.motion_s(at_s), begins_s[-1])).round().astype(int)
        for time_s, units in zip(at_s.tolist(), places.tolist(), strict=True):
            reports.places.add(time_s + late.uniform(0.0, late_s), units)
        at_s = np.arange(0.003 * axis, course.corners_s[-1][0], 0.1)
        numbers = np.searchsorted(begins_s, course.motion_s(at_s), side="right") - 1
        for time_s, number in zip(at_s.tolist(), numbers.tolist(), strict=True):
            reports.records.add(time_s + late.uniform(0.0, late_s), min(number, begins_s.size - 2))
    return made


def outcome(spiral: Plan, missing_units: int = 0) -> LiveOutcome:
    end = spiral.points_units[-1].tolist()
    ends = tuple(AxisEnd(f"axis {i}", units, units - missing_units, 0.0) for i, units in enumerate(end))
    return LiveOutcome(spiral, "spiral", 1, ends, [], [], 0.0)


def errors_deg(spiral: Plan, made: tuple[Placed, ...]) -> float:
    """Return the greatest difference of a report from the plan at the time where it is placed, in deg or mm."""
    names = range(len(made))
    planned = [ROBOT.to_units(spiral.motion.positions(made[i].t_s))[:, i] for i in names]
    wire = ROBOT.wire_units_per_unit
    return max(float(np.abs(made[i].units - planned[i]).max() / wire[i]) for i in names)


@pytest.mark.parametrize("course", [STEADY, PAUSED, HELD_UP], ids=["steady", "paused", "held up"])
@pytest.mark.parametrize("late_s", [0.0, 0.004])
def test_an_exact_run_shows_no_error(spiral: Plan, course: Course, late_s: float) -> None:
    made = placed(outcome(spiral), reported(spiral, course, late_s))
    assert max(np.abs(axis.error_steps).max() for axis in made) < 0.05
    assert errors_deg(spiral, made) < 0.1
    for axis in made:
        assert axis.t_s[-1] == spiral.motion.duration_s
        assert all(before <= after for before, after in pairwise(axis.t_s.tolist()))


@pytest.mark.parametrize("course", [STEADY, PAUSED, HELD_UP], ids=["steady", "paused", "held up"])
def test_the_time_of_a_report_is_known_to_20_ms_but_for_ramps(spiral: Plan, course: Course) -> None:
    for axis, reports in enumerate(reported(spiral, course)):
        lower_s, upper_s = time_bounds(spiral, reports)
        clock_s = np.array([time_s for time_s, _ in reports.places.items])
        true_s = np.minimum(course.motion_s(clock_s), spiral.motion.duration_s)
        assert (lower_s <= true_s + 1e-9).all(), axis
        assert (true_s <= upper_s + 1e-9).all(), axis
        assert np.median(upper_s - lower_s) < (0.05 if course is HELD_UP else 0.021)
        assert (upper_s - lower_s).max() < 0.13  # within a ramp: a period of the reports, and both margins


def test_a_joint_that_stays_behind_shows_by_how_much(spiral: Plan) -> None:
    whole = reported(spiral, PAUSED)
    behind = tuple(AxisReports() for _ in whole)
    for own, other in zip(behind, whole, strict=True):
        own.records = other.records
        for time_s, units in other.places.items:
            own.places.add(time_s, units - (10_240 if time_s > 70.0 else 0))  # ten steps at 1/16
    made = placed(outcome(spiral, missing_units=10_240), behind)
    for axis, joint in zip(made, ROBOT.joints, strict=True):
        steps = 10_240 * joint.transmission.microsteps / 16_384
        assert axis.error_steps[-1] == pytest.approx(-steps)
        assert axis.error_steps.min() == pytest.approx(-steps, abs=0.1)
        assert np.abs(axis.error_steps[axis.t_s < 4.0]).max() < 0.05


def test_a_run_that_nothing_was_reported_of_has_its_end(spiral: Plan) -> None:
    made = placed(outcome(spiral), tuple(AxisReports() for _ in ROBOT.joints))
    assert [axis.t_s.tolist() for axis in made] == [[spiral.motion.duration_s]] * len(ROBOT.joints)


def test_numbers_of_records_go_on_beyond_256_and_old_ones_change_nothing() -> None:
    reports = AxisReports()
    for executing in (255, 0, 100, 200, 44, 40, 144, 244, 88):  # 255: before the first, and 40 an old one
        reports.take_record(1.0, bytes((0, 0, 0, executing, 0, 0, 0, 0)))
    assert [number for _, number in reports.records.items] == [0, 100, 200, 300, 400, 500, 600]


@pytest.mark.parametrize("count", [1, 1024, 1025, 5000, 100_000])
def test_reports_of_a_long_run_are_thinned_evenly(count: int) -> None:
    kept = Thinned()
    for i in range(count):
        kept.add(float(i), i)
    numbers = [number for _, number in kept.items]
    assert len(numbers) <= REPORTS_MAX
    assert len(numbers) >= min(count, 512)
    assert len({after - before for before, after in pairwise(numbers)}) <= 1
    assert count - numbers[-1] <= max(1, count // 512)
