"""The evaluation finds errors that were put in by hand, to the count."""

from dataclasses import replace

import numpy as np
import pytest

from steptwin.bench.step_methods import AxisPulses, Method, PlacedPulses
from steptwin.bench.step_methods.evaluation import (
    StepErrors,
    figures_of,
    ideal_of,
    pair,
    step_errors,
    violations,
)
from steptwin.protocol.drivers import ActiveEdge
from tests.bench.step_methods.lines import BOARD, EXACT_COUNTS, LINE, STEPS, upward


def errors_of(pulses: AxisPulses) -> StepErrors:
    return step_errors(LINE, 0, ideal_of(LINE)[0], pulses)


def test_exact_steps_have_no_error() -> None:
    errors = errors_of(upward(EXACT_COUNTS))
    assert np.abs(errors.steps).max() < 1e-9
    assert np.abs(errors.timing_us).max() < 1e-4
    assert len(errors.timing_us) == STEPS
    assert (errors.pairing.missing, errors.pairing.extra) == (0, 0)


@pytest.mark.parametrize("late_us", [-30, 10, 2500], ids=["early", "late", "late by more than two intervals"])
def test_a_common_delay(late_us: int) -> None:
    errors = errors_of(upward(EXACT_COUNTS + 72 * late_us))
    assert errors.timing_us == pytest.approx(np.full(STEPS, late_us), abs=1e-4)
    within = EXACT_COUNTS + 72 * late_us <= 7_200_000  # after its end the planned motion stands still
    assert errors.steps[within] == pytest.approx(late_us / 1000, abs=1e-9)
    assert np.abs(errors.jitter_us).max() < 1e-4


def test_jitter_is_of_intervals() -> None:
    """Steps are late and early by 2 us in turn: each interval is off by 4 us."""
    errors = errors_of(upward(EXACT_COUNTS + 144 * (-1) ** np.arange(STEPS)))
    assert np.abs(errors.timing_us) == pytest.approx(2, abs=1e-4)
    assert np.abs(errors.jitter_us) == pytest.approx(4, abs=1e-4)


def test_a_step_left_out_at_the_end_is_missing() -> None:
    errors = errors_of(upward(EXACT_COUNTS[:-1]))
    assert (errors.pairing.missing, errors.pairing.extra) == (1, 0)
    assert np.abs(errors.timing_us).max() < 1e-4


def test_a_step_too_many_is_extra() -> None:
    errors = errors_of(upward(np.append(EXACT_COUNTS, 7_180_000)))
    assert (errors.pairing.missing, errors.pairing.extra) == (0, 1)
    assert np.abs(errors.timing_us).max() < 1e-4


def test_a_reversal_left_out_shifts_no_other_pair() -> None:
    """Up to 3 and back, twice; the steps around the second reversal are left out."""
    signs = np.array([1, 1, 1, -1, -1, -1] * 2, np.int8)
    times_s = np.arange(12) / 10
    kept = np.delete(np.arange(12), [8, 9])
    pairing = pair(0, times_s, signs, times_s[kept] + 0.25, signs[kept])
    assert pairing.ideal.tolist() == kept.tolist()
    assert pairing.made.tolist() == list(range(10))
    assert (pairing.missing, pairing.extra) == (2, 0)


def test_without_any_step() -> None:
    pairing = pair(0, np.arange(3) / 10, np.ones(3, np.int8), np.empty(0), np.empty(0, np.int8))
    assert (len(pairing.ideal), pairing.missing, pairing.extra) == (0, 3, 0)


def test_figures_are_over_all_steps() -> None:
    late_us = np.where(np.arange(STEPS) < 3, 50, 10)
    placed = PlacedPulses([upward(EXACT_COUNTS + 72 * late_us)], wall_s=0.001)
    figures = figures_of(LINE, ideal_of(LINE), Method("kernel", "by hand", lambda _: placed))
    assert figures.steps == STEPS
    assert figures.timing_us_p50 == pytest.approx(10, abs=1e-4)
    assert figures.timing_us_p99 == pytest.approx(50, abs=1e-4)
    assert figures.timing_us_max == pytest.approx(50, abs=1e-4)
    assert figures.error_steps_max == pytest.approx(0.05, abs=1e-9)
    assert figures.error_steps_rms == pytest.approx(np.sqrt((3 * 0.05**2 + 97 * 0.01**2) / 100), abs=1e-9)
    assert figures.jitter_us_rms == pytest.approx(40 / np.sqrt(99), abs=1e-4)
    assert figures.steps_per_s == pytest.approx(100_000)
    assert figures.violations == 0


@pytest.mark.parametrize(("interval_counts", "broken"), [(4800, 0), (4799, 1)])
def test_violations_on_both_sides_of_15_khz(interval_counts: int, broken: int) -> None:
    assert violations(upward(np.array([0, interval_counts])), 16, BOARD) == broken


def test_violations_are_those_of_the_boards_drivers() -> None:
    """The slow blue board needs CLK high for 150 us; two pulses of 33 us are too short."""
    slow = replace(BOARD, osc_pf=None, driver_profile="slow-blue-board")
    assert violations(upward(np.array([72_000, 144_000])), 16, slow) == 2


@pytest.mark.parametrize(("active_edge", "broken"), [(None, 1), (ActiveEdge.FALLING, 1), (ActiveEdge.RISING, 0)])
def test_violations_are_those_of_drivers_as_the_robots_file_sets_them(
    active_edge: ActiveEdge | None, broken: int
) -> None:
    """DIR changes 267 us after the rise and 100 us after the fall; the slow blue board needs 150 us."""
    pulse = AxisPulses(np.array([72_000]), np.array([84_000]), np.array([0, 91_200]), np.array([1, 0], np.int8))
    blue = replace(BOARD, osc_pf=None, driver_profile="slow-blue-board", active_edge=active_edge)
    assert violations(pulse, 16, blue) == broken
