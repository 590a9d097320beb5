"""Judge made evidence: perfect evidence passes with almost no error; every kind of fault is caught and counted."""

import json
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from steptwin.host.common.arrays import FloatArray, Int8Array, Int64Array
from steptwin.host.robots.poses.rotations import wrapped_deg
from steptwin.host.verify import (
    POSITION_ERROR_LIMIT_STEPS,
    THRESHOLD_TOLERANCE_STEPS,
    DriverLimit,
    DriverViolations,
    Evidence,
    Expectation,
    Slips,
    compare,
    verify,
)
from steptwin.host.verify.counted import clk_durations
from steptwin.host.verify.report import ViolationReport
from steptwin.protocol.drivers import ActiveEdge
from steptwin.protocol.timer import COUNTS_PER_SECOND
from tests.host.verify.motions import (
    CLK_HIGH_COUNTS,
    RUN,
    START_COUNTS,
    altered,
    expect,
    line,
    motion,
    nearest_steps,
    perfect_evidence,
    planar_forward,
    sines,
    still,
    trapezoid,
)
from tests.messages import refusing

RATE_HZ = 1000.0
PERIOD_COUNTS = 72_000
STEADY = expect(motion(1.0, line(0.0, 100.0)), 10.0)
"""One joint at 100 mm/s and 10 steps/mm: 1000 steps at 1 kHz, the first after 0.5625 ms."""

THREE_VIOLATIONS = DriverViolations(
    (
        DriverLimit("clk_high", "too short", 30.0, "us", "page 8"),
        DriverLimit("clk_low", "too soon", 20.0, "us", "page 9"),
        DriverLimit("over_temperature", "too hot", 170.0, "degC", "page 7"),
    ),
    START_COUNTS + np.array([-720_000, 36_000_000, 40_000_000]),
    np.array([2, 0, 0], np.int8),
    np.array([171.0, 29.0, 3.0]),
)

SWINGING = expect(
    motion(3.0, sines([(20.0, 2.0, 0.0)]), trapezoid(3.0, -50.0, 3.0, 1.0), sines([(90.0, 3.0, 1.0)]), still(7.0)),
    80.0,
    40.0,
    400.0 / 9.0,
    10.0,
)


def with_steps(evidence: Evidence, counts: Int64Array, signs: Int8Array) -> Evidence:
    """Return the evidence with other steps on its first axis; every pulse is accepted."""
    return altered(
        evidence,
        step_counts=counts,
        step_signs=signs,
        clk_rise_counts=counts,
        clk_fall_counts=counts + CLK_HIGH_COUNTS,
    )


def without_step(evidence: Evidence, *index: int) -> Evidence:
    first = evidence.axes[0]
    return with_steps(evidence, np.delete(first.step_counts, index), np.delete(first.step_signs, index))


def with_extra_step(evidence: Evidence, index: int, sign: int) -> Evidence:
    """Return the evidence with one more step, half a period after the given one."""
    first = evidence.axes[0]
    counts = np.insert(first.step_counts, index + 1, first.step_counts[index] + PERIOD_COUNTS // 2)
    return with_steps(evidence, counts, np.insert(first.step_signs, index + 1, np.int8(sign)))


def with_moved_step(evidence: Evidence, index: int, dt_counts: int) -> Evidence:
    """Return the evidence with the given step later, or earlier if negative."""
    first = evidence.axes[0]
    counts = first.step_counts.copy()
    counts[index] += dt_counts
    return with_steps(evidence, counts, first.step_signs)


def with_turned_step(evidence: Evidence, index: int) -> Evidence:
    """Return the evidence with the given step in the wrong direction."""
    first = evidence.axes[0]
    signs = first.step_signs.copy()
    signs[index] *= -1
    return with_steps(evidence, first.step_counts, signs)


def test_perfect_evidence_passes_with_almost_no_error() -> None:
    report = verify(SWINGING, perfect_evidence(SWINGING), RUN)
    assert report.passed
    assert report.reasons == ()
    for axis in report.axes:
        assert axis.unmatched_steps == axis.grazing_steps == axis.violations == 0
        assert axis.position_error_steps_max <= 0.5625 + 1e-4
        assert axis.threshold_error_steps_max <= 1e-4  # half a timer count at a few kHz
        assert axis.timing_error_us_p50 <= axis.timing_error_us_p99 <= axis.timing_error_us_max <= 0.5 / 72.0 + 1e-4


def test_figures_of_a_steady_axis_by_hand() -> None:
    """The error is 1/2 + 1/16 = 0.5625 step just before each edge and 0.4375 step just after."""
    report = verify(STEADY, perfect_evidence(STEADY), RUN)
    (axis,) = report.axes
    assert (axis.steps_start, axis.steps_end, axis.pulses, axis.reversals) == (0, 1000, 1000, 0)
    assert axis.peak_rate_hz == pytest.approx(RATE_HZ)
    assert axis.mean_step_interval_us == pytest.approx(1000.0)
    assert axis.clk_high_us_min == pytest.approx(33.0)
    assert axis.clk_low_us_min == pytest.approx(967.0)
    assert axis.position_error_steps_max == pytest.approx(0.5625, abs=1e-6)
    assert (report.joints.start, report.joints.end) == ((0.0,), (100.0,))
    assert report.tool.position_error_mm_max == pytest.approx(0.05625, abs=1e-7)
    squares = 1000 * (0.05625**2 + 0.04375**2)  # start and end have no error, just before and just after
    assert report.tool.position_error_mm_rms == pytest.approx((squares / 2004) ** 0.5, abs=1e-7)
    assert report.tool.attitude_error_deg_max == 0.0


def test_clk_is_low_while_step_is_high_if_the_falling_edge_is_active() -> None:
    """STEP has pulses of 33 us every 1000 us; the record does not contain the end of the last pause."""
    evidence = altered(perfect_evidence(STEADY), active_edge=ActiveEdge.FALLING)
    (axis,) = verify(STEADY, evidence, RUN).axes
    assert (axis.clk_high_us_min, axis.clk_low_us_min) == pytest.approx((967.0, 33.0))
    assert axis.active_edge == "falling"
    high, low, period = clk_durations(evidence.axes[0])
    assert (high.size, low.size, period.size) == (999, 1000, 999)
    np.testing.assert_array_equal(high + low[1:], period)


def test_an_axis_without_steps_has_zeros_and_nulls() -> None:
    axis = verify(SWINGING, perfect_evidence(SWINGING), RUN).axes[3]
    assert (axis.steps_start, axis.steps_end, axis.pulses, axis.reversals) == (70, 70, 0, 0)
    assert (axis.peak_rate_hz, axis.timing_error_us_p50, axis.timing_error_us_p99, axis.timing_error_us_max) == (0,) * 4
    assert axis.clk_high_us_min is axis.clk_low_us_min is axis.mean_step_interval_us is None


def test_reversals_and_peak_rate_of_a_sine() -> None:
    axis = verify(SWINGING, perfect_evidence(SWINGING), RUN).axes[0]
    assert axis.reversals == 2  # at 2 t = pi/2 and 3 pi/2
    assert axis.peak_rate_hz == pytest.approx(20.0 * 2.0 * 80.0, rel=1e-3)


FAULTS: dict[str, tuple[Callable[[Evidence], Evidence], int, str, int, float, float]] = {
    "missing": (lambda e: without_step(e, 500), 1, "0.501", 999, 1.5625, 1.0),
    "two missing": (lambda e: without_step(e, 300, 700), 2, "0.301", 998, 2.5625, 2.0),
    "last missing": (lambda e: without_step(e, 999), 1, "1.000", 999, 1.0, 0.0),
    "extra": (lambda e: with_extra_step(e, 500, 1), 1, "0.501", 1001, 1.4375, 1.0),
    "extra back": (lambda e: with_extra_step(e, 500, -1), 1, "0.501", 999, 1.5625, 1.0),
    "wrong way": (lambda e: with_turned_step(e, 500), 2, "0.501", 998, 2.5625, 2.0),
}
"""Each with the number of unmatched steps, the time of the first, the count at the end, and the largest errors."""


@pytest.mark.parametrize("fault", FAULTS)
def test_a_fault_is_caught_and_counted(fault: str) -> None:
    make, unmatched, first_s, end, position_steps, threshold_steps = FAULTS[fault]
    report = verify(STEADY, make(perfect_evidence(STEADY)), RUN)
    (axis,) = report.axes
    assert not report.passed
    assert axis.unmatched_steps == unmatched
    assert axis.grazing_steps == 0
    assert axis.steps_end == end
    assert axis.position_error_steps_max == pytest.approx(position_steps, abs=1e-6)
    assert axis.threshold_error_steps_max >= threshold_steps - 1e-6
    assert f"a: unmatched steps {unmatched} (limit 0), the first at {first_s} s" in report.reasons
    assert f"a: end count {end} (planned 1000)" in report.reasons


def test_the_steps_around_a_lost_one_keep_their_partners() -> None:
    comparison = compare(STEADY, without_step(perfect_evidence(STEADY), 500))
    assert np.abs(comparison.timing_errors_us(0)).max() < 1e-3
    assert comparison.matchings[0].ideal.tolist() == [i for i in range(1000) if i != 500]


def counts_of(steps: float) -> int:
    """Return the time that the steady axis takes for a fraction of a step, in counts."""
    return round(steps * PERIOD_COUNTS)


@pytest.mark.parametrize(("late_steps", "passed"), [(0.0074, True), (0.0076, False), (0.4, False)])
def test_a_late_step_passes_up_to_the_position_limit(late_steps: float, passed: bool) -> None:
    report = verify(STEADY, with_moved_step(perfect_evidence(STEADY), 500, counts_of(late_steps)), RUN)
    (axis,) = report.axes
    assert report.passed == passed
    assert axis.position_error_steps_max == pytest.approx(0.5625 + late_steps, abs=2e-5)
    assert axis.timing_error_us_max == pytest.approx(late_steps * 1000.0, abs=0.02)
    assert axis.timing_error_us_p50 < 0.01
    assert axis.unmatched_steps == 0
    assert any("position error 0.57" in reason for reason in report.reasons) == (late_steps == 0.0076)


@pytest.mark.parametrize(("early_steps", "passed"), [(0.0074, True), (0.0076, False), (0.1, False)])
def test_an_early_step_passes_up_to_the_threshold_tolerance(early_steps: float, passed: bool) -> None:
    """An early step brings the count nearer to the plan for a while, so the position error alone does not show it."""
    report = verify(STEADY, with_moved_step(perfect_evidence(STEADY), 500, -counts_of(early_steps)), RUN)
    (axis,) = report.axes
    assert report.passed == passed
    assert axis.threshold_error_steps_max == pytest.approx(early_steps, abs=2e-5)
    assert axis.timing_error_us_max == pytest.approx(early_steps * 1000.0, abs=0.02)
    assert passed or "a: threshold error" in report.reasons[-1]


def test_the_limits_are_the_step_rule_plus_its_tolerance() -> None:
    assert pytest.approx(0.57) == POSITION_ERROR_LIMIT_STEPS
    assert pytest.approx(0.5 + 1 / 16 + THRESHOLD_TOLERANCE_STEPS) == POSITION_ERROR_LIMIT_STEPS


def test_a_drift_is_caught_although_every_step_has_a_partner() -> None:
    """The timer is 20 ppm slow: the last of the 1000 steps comes 20 us late, which is 0.02 steps."""
    evidence = perfect_evidence(STEADY)
    counts = evidence.axes[0].step_counts
    slow = START_COUNTS + np.rint((counts - START_COUNTS) * 1.00002).astype(np.int64)
    (axis,) = (report := verify(STEADY, with_steps(evidence, slow, evidence.axes[0].step_signs), RUN)).axes
    assert not report.passed
    assert axis.unmatched_steps == 0
    assert axis.timing_error_us_max == pytest.approx(20.0, abs=0.05)
    assert axis.position_error_steps_max == pytest.approx(0.5825, abs=1e-4)
    assert report.reasons[0].startswith("a: position error 0.582")


def test_an_offset_from_the_start_is_caught() -> None:
    """The count is one step off at t = 0; then come the ideal pulses of the true start."""
    report = verify(STEADY, altered(perfect_evidence(STEADY), start_steps=-1), RUN)
    assert not report.passed
    assert report.axes[0].steps_end == 999
    assert report.axes[0].position_error_steps_max == pytest.approx(1.5625, abs=1e-6)


def test_violations_fail_an_otherwise_perfect_run() -> None:
    report = verify(STEADY, altered(perfect_evidence(STEADY), violations=THREE_VIOLATIONS), RUN)
    assert report.reasons == ("a: driver violations 3 (limit 0)",)
    assert report.axes[0].violations == 3


def test_a_motor_that_slips_fails_by_its_position_though_every_step_is_right() -> None:
    """Half-way, by one cycle: the line with what was lost comes first, and the end is that of the motor."""
    evidence = perfect_evidence(STEADY)
    half = START_COUNTS + COUNTS_PER_SECOND // 2
    slips = Slips(np.array([half, half + 72_000]), np.array([-8, 4]))
    report = verify(replace(STEADY, microsteps=(16,)), altered(evidence, slips=slips), RUN)
    assert report.reasons[0] == "a: the motor lost 12 full steps from 0.500 s on, -4 in all"
    (axis,) = report.axes
    assert 127 < axis.position_error_steps_max < 129
    unslipped = verify(STEADY, evidence, RUN)
    assert report.joints.end[0] == pytest.approx(unslipped.joints.end[0] - 64 / STEADY.steps_per_unit[0])


def test_violations_are_grouped_by_axis_and_limit() -> None:
    """The worst value is the one furthest from the limit, above or below; times are the trajectory's."""
    evidence = altered(perfect_evidence(SWINGING), axis=2, violations=THREE_VIOLATIONS)
    report = verify(SWINGING, evidence, RUN)
    assert report.violations == (
        ViolationReport("c", "clk_high", "too short", 2, 3.0, 30.0, "us", 0.5, "page 8"),
        ViolationReport("c", "over_temperature", "too hot", 1, 171.0, 170.0, "degC", -0.01, "page 7"),
    )
    assert [group["count"] for group in report.to_dict()["violations"]] == [2, 1]


def test_a_pulse_that_the_driver_ignores_counts_as_a_pulse_but_not_as_a_step() -> None:
    evidence = perfect_evidence(STEADY)
    first = evidence.axes[0]
    steps = np.delete(first.step_counts, 500), np.delete(first.step_signs, 500)
    (axis,) = verify(STEADY, altered(evidence, step_counts=steps[0], step_signs=steps[1]), RUN).axes
    assert (axis.pulses, axis.steps_end) == (1000, 999)


GRAZES = [  # peak, True if the board stepped there, number of grazing and of unmatched steps
    (0.5625 + 0.0003, True, 0, 0),
    (0.5625 + 0.0003, False, 2, 0),
    (0.5625 - 0.0003, True, 2, 0),
    (0.5625 - 0.0003, False, 0, 0),
    (0.5625 + 0.02, False, 0, 2),
    (0.5625 - 0.02, True, 0, 2),
]


@pytest.mark.parametrize(("peak", "made", "grazing", "unmatched"), GRAZES)
def test_a_grazed_threshold_may_step_or_not(peak: float, made: bool, grazing: int, unmatched: int) -> None:
    """From 0 to the peak and back to 0 within 1 s: a step up at the peak and one down on the way back, or no steps."""
    expected = expect(motion(1.0, sines([(-peak / 2.0, 2.0 * np.pi, np.pi / 2.0)], peak / 2.0)), 1.0)
    back_s = 1.0 - np.arccos(1.0 - 2.0 * 0.4375 / peak) / (2.0 * np.pi)
    times_s = np.array([0.5, back_s] if made else [])
    counts = START_COUNTS + np.rint(times_s * COUNTS_PER_SECOND).astype(np.int64)
    evidence = with_steps(perfect_evidence(expected), counts, np.array([1, -1] if made else [], np.int8))
    report = verify(expected, evidence, RUN)
    assert (report.axes[0].grazing_steps, report.axes[0].unmatched_steps) == (grazing, unmatched)
    assert report.passed == (unmatched == 0)


def test_missing_steps_at_a_turning_point_show_between_the_edges() -> None:
    """The board should have stepped up and back at the peak; no edge is near it to show the error."""
    expected = expect(motion(1.0, sines([(-0.4, 2.0 * np.pi, np.pi / 2.0)], 0.4)), 1.0)
    evidence = with_steps(perfect_evidence(expected), np.empty(0, np.int64), np.empty(0, np.int8))
    (axis,) = verify(expected, evidence, RUN).axes
    assert axis.position_error_steps_max == pytest.approx(0.8)
    assert axis.unmatched_steps == 2


def test_slow_crossings_have_no_timing_error() -> None:
    """The steps beside a reversal come 10 us late, which is a tiny distance at their speed."""
    expected = expect(motion(2.0, sines([(10.0, np.pi / 2.0, 0.0)])), 2000.0)
    evidence = perfect_evidence(expected)
    comparison = compare(expected, evidence)
    slow = comparison.ideal[0].speeds_hz < 0.01 * comparison.ideal[0].speeds_hz.max()
    assert np.count_nonzero(slow) == 2
    counts = evidence.axes[0].step_counts + np.where(slow, COUNTS_PER_SECOND // 100_000, 0)
    (axis,) = verify(expected, with_steps(evidence, counts, evidence.axes[0].step_signs), RUN).axes
    assert axis.timing_error_us_max < 0.01
    assert axis.threshold_error_steps_max > 1e-3


def test_steps_before_the_start_only_set_the_count_at_the_start() -> None:
    expected = expect(motion(1.0, line(0.2, 100.0)), 10.0)
    evidence = perfect_evidence(expected)
    first = evidence.axes[0]
    counts = np.concatenate([START_COUNTS - np.arange(5, 0, -1) * PERIOD_COUNTS, first.step_counts])
    signs = np.concatenate([np.ones(5, np.int8), first.step_signs])
    report = verify(expected, altered(with_steps(evidence, counts, signs), start_steps=-3), RUN)
    assert report.passed
    assert (report.axes[0].steps_start, report.axes[0].pulses) == (2, 1005)


def test_steps_after_the_end_are_compared_with_the_end() -> None:
    evidence = perfect_evidence(STEADY)
    first = evidence.axes[0]
    counts = np.append(first.step_counts, START_COUNTS + 3 * COUNTS_PER_SECOND)
    report = verify(STEADY, with_steps(evidence, counts, np.append(first.step_signs, np.int8(1))), RUN)
    assert report.axes[0].position_error_steps_max == pytest.approx(1.0)
    assert report.axes[0].steps_end == 1001
    assert not report.passed


def test_the_attitude_error_does_not_jump_at_half_a_turn() -> None:
    def forward(joints: FloatArray) -> FloatArray:
        poses = planar_forward(joints)
        poses[:, 3] = wrapped_deg(poses[:, 3])
        return poses

    expected = expect(motion(1.0, still(0.0), still(0.0), line(150.0, 60.0)), 10.0, 10.0, 10.0)
    expected = replace(expected, forward=forward)
    report = verify(expected, perfect_evidence(expected), RUN)
    assert report.tool.attitude_error_deg_max == pytest.approx(0.05625, abs=1e-6)


def test_angles_wrap_into_a_half_open_turn() -> None:
    angles = np.array([0.0, 180.0, -180.0, 181.0, -181.0, 540.0, 359.0])
    assert wrapped_deg(angles).tolist() == [0.0, 180.0, 180.0, -179.0, 179.0, 180.0, -1.0]


def test_a_planned_position_that_is_not_finite_is_refused() -> None:
    broken = expect(motion(1.0, still(0.0), (lambda t: np.where(t > 0.5, np.nan, 0.0), lambda t: 0.0 * t)), 1.0, 1.0)
    standing = expect(motion(1.0, still(0.0), still(0.0)), 1.0, 1.0)
    with refusing(ValueError):
        verify(broken, perfect_evidence(standing), RUN)


def test_evidence_of_other_axes_than_planned_is_refused() -> None:
    with refusing(ValueError):
        verify(SWINGING, perfect_evidence(STEADY), RUN)


def test_an_expectation_needs_one_conversion_per_joint() -> None:
    with refusing(ValueError):
        Expectation(STEADY.motion, np.array([1.0, 2.0]), ("mm",), planar_forward)


@pytest.fixture(scope="module")
def document() -> dict[str, Any]:
    return verify(SWINGING, perfect_evidence(SWINGING), RUN).to_dict()


def test_the_document_has_the_contract_keys(document: dict[str, Any]) -> None:
    assert list(document) == [
        "robot", "job", "duration_s", "passed", "reasons", "axes", "joints", "tool", "outputs", "violations", "bus",
        "simulated_s", "wall_s",
    ]  # fmt: skip
    assert list(document["axes"][0]) == [
        "name", "steps_start", "steps_end", "pulses", "reversals", "peak_rate_hz", "position_error_steps_max",
        "timing_error_us_p50", "timing_error_us_p99", "timing_error_us_max", "clk_high_us_min", "clk_low_us_min",
        "violations", "unmatched_steps", "grazing_steps", "threshold_error_steps_max", "mean_step_interval_us",
        "active_edge",
    ]  # fmt: skip
    assert list(document["joints"]) == ["names", "start", "end"]
    assert list(document["tool"]) == ["position_error_mm_max", "position_error_mm_rms", "attitude_error_deg_max"]
    assert document["bus"] == {"bitrate": 1_000_000, "frames": 0, "load_percent": 0.0}
    assert (document["robot"], document["job"], document["simulated_s"]) == ("test-arm", "test", 1.05)


def test_the_document_is_plain_json(document: dict[str, Any]) -> None:
    assert json.loads(json.dumps(document, allow_nan=False)) == document


def test_rounding_keeps_the_digits_of_a_tiny_error() -> None:
    report = verify(STEADY, perfect_evidence(STEADY), RUN)
    tiny = replace(report.axes[0], position_error_steps_max=1.23456789012e-7)
    assert replace(report, axes=(tiny,)).to_dict()["axes"][0]["position_error_steps_max"] == 1.23456789e-7


@pytest.mark.slow
def test_many_steps_in_many_chunks_give_the_same_report(monkeypatch: pytest.MonkeyPatch) -> None:
    evidence = perfect_evidence(SWINGING)
    whole = verify(SWINGING, evidence, RUN)
    monkeypatch.setattr("steptwin.host.verify.deviation.INSTANTS_PER_CHUNK", 17)
    parts = verify(SWINGING, evidence, RUN)
    assert [axis.position_error_steps_max for axis in parts.axes] == [
        axis.position_error_steps_max for axis in whole.axes
    ]
    assert parts.tool.position_error_mm_rms == pytest.approx(whole.tool.position_error_mm_rms)


@pytest.mark.slow
def test_random_faults_never_pass() -> None:
    """A step lost or reversed anywhere on a moving axis fails the run and is counted."""
    rng = np.random.default_rng(11)
    evidence = perfect_evidence(SWINGING)
    steps = len(evidence.axes[0].step_counts)
    for index in rng.integers(0, steps - 1, 20).tolist():
        for fault, unmatched in ((without_step(evidence, index), 1), (with_turned_step(evidence, index), 2)):
            report = verify(SWINGING, fault, RUN)
            assert not report.passed
            assert report.axes[0].unmatched_steps == unmatched
            assert all(axis.unmatched_steps == 0 for axis in report.axes[1:])


def test_the_counters_start_where_the_board_stands() -> None:
    evidence = perfect_evidence(SWINGING)
    assert tuple(axis.start_steps for axis in evidence.axes) == nearest_steps(SWINGING) == (0, 120, 3366, 70)


def test_the_actual_tool_is_reported_and_decides_nothing() -> None:
    """With an error across the motion, both errors of the tool add up by Pythagoras."""

    def shifted(joints: FloatArray) -> FloatArray:
        return np.asarray(planar_forward(joints) + np.array([0.0, 5.0, 12.0, -0.5]))

    plain = verify(STEADY, perfect_evidence(STEADY), RUN)
    report = verify(replace(STEADY, actual_forward=shifted), perfect_evidence(STEADY), RUN)
    assert plain.actual_tool is None
    assert "actual_tool" not in plain.to_dict()
    assert replace(report, actual_tool=None) == plain
    assert report.passed
    actual = report.to_dict()["actual_tool"]
    assert actual["position_error_mm_max"] == pytest.approx(np.hypot(13.0, plain.tool.position_error_mm_max))
    assert actual["position_error_mm_rms"] == pytest.approx(np.hypot(13.0, plain.tool.position_error_mm_rms))
    assert actual["attitude_error_deg_max"] == pytest.approx(0.5)
