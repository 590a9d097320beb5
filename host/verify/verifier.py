"""Judge a run: compare the counted motion with the planned one and with the step rule.

A correct board differs from the ideal step sequence only at grazing steps: the motion turns so near a threshold that
rounding decides. The step rule itself separates grazing steps from lost ones. A count follows the rule if its distance
from the planned position never exceeds the threshold plus the tolerance, and if no step is made further from its
threshold than the tolerance. For a controller with another rule, the comparison's gates have the limits.
"""

from collections.abc import Iterator
from dataclasses import dataclass, field
from math import nan

import numpy as np

from steptwin.host.common.arrays import FloatArray
from steptwin.host.common.features import judge_of
from steptwin.host.verify.comparison import Comparison, Expectation, compare
from steptwin.host.verify.counted import powerless_steps
from steptwin.host.verify.deviation import Deviation, ToolDeviation, critical_instants, deviations
from steptwin.host.verify.evidence import Evidence
from steptwin.host.verify.figures import AxisReport, AxisRun, axis_report, judged_document
from steptwin.host.verify.gates import (
    OWN_FIRMWARE,
    SEGMENTS_TOLERANCE_STEPS,
    Gates,
    any_step_rule,
    threshold_tolerance_steps,
)
from steptwin.host.verify.net_counts import any_rule_end
from steptwin.host.verify.oracle import THRESHOLD_STEPS
from steptwin.host.verify.report import (
    JointsReport,
    Report,
    RunInfo,
    SkewReport,
    ToolReport,
    violation_reports,
)
from steptwin.host.verify.switching import output_reasons, output_reports


@dataclass(slots=True)
class _WorstTool:
    """Largest errors of a tool so far."""

    mm: float = 0.0
    mm_squares: float = 0.0
    attitude_deg: float = 0.0
    poses: int = 0

    def take(self, deviation: ToolDeviation) -> None:
        """Include the instants of a chunk."""
        distance_mm = deviation.distance_mm
        self.mm = float(np.maximum(self.mm, distance_mm.max()))
        self.mm_squares += float(np.sum(distance_mm**2))
        self.attitude_deg = float(np.maximum(self.attitude_deg, np.abs(deviation.attitude_deg).max()))
        self.poses += distance_mm.size

    def report(self) -> ToolReport:
        """Return the errors; NaN without a tool."""
        if not self.poses:
            return ToolReport(nan, nan, nan)
        return ToolReport(self.mm, float(np.sqrt(self.mm_squares / self.poses)), self.attitude_deg)


@dataclass(slots=True)
class _Worst:
    """Largest errors so far, of each axis, of second motors relative to the first ones, and of the tool.

    The tool's errors are by the nominal kinematics and by the actual one.
    """

    position_steps: FloatArray
    threshold_steps: FloatArray
    skews: FloatArray
    tool: _WorstTool = field(default_factory=_WorstTool)
    actual_tool: _WorstTool = field(default_factory=_WorstTool)

    def take(self, deviation: Deviation) -> None:
        """Include the instants of a chunk."""
        before, after = deviation.steps
        signs = np.sign(after - before)
        beyond = np.where(signs != 0, np.abs(-signs * before - THRESHOLD_STEPS), 0.0)
        self.threshold_steps = np.maximum(self.threshold_steps, beyond.max(axis=0))
        self.position_steps = np.maximum(self.position_steps, np.abs(deviation.steps).max(axis=(0, 1)))
        self.skews = np.maximum(self.skews, np.abs(deviation.skews).max(axis=(0, 1)))
        if deviation.tool is not None:
            self.tool.take(deviation.tool)
        if deviation.actual_tool is not None:
            self.actual_tool.take(deviation.actual_tool)


def verify(expected: Expectation, evidence: Evidence, run: RunInfo) -> Report:
    """Compare the drivers' counts with the planned motion and return the report.

    Raises:
        ValueError: the evidence's axes are not the planned joints in the same order.
    """
    return verify_comparison(compare(expected, evidence), run)


def verify_comparison(comparison: Comparison, run: RunInfo) -> Report:
    """Return the report of an existing comparison."""
    worst = _worst(comparison)
    axes = tuple(axis_report(_axis_run(comparison, i, worst)) for i in range(len(comparison.axis_names)))
    reasons = [*_strange_modes(comparison), *_slip_reasons(comparison.evidence)]
    reasons += [line for index, axis in enumerate(axes) for line in _reasons(comparison, index, axis)]
    reasons += powerless_reasons(comparison.evidence)
    skews = _skew_reports(comparison, worst)
    reasons += [
        f"{skew.second}: up to {skew.skew_max:.4g} {skew.unit} apart from {skew.first} (limit {skew.limit:g})"
        for skew in skews
        if skew.skew_max > skew.limit
    ]
    outputs = output_reports(comparison.expected.motion.output_changes, comparison.evidence)
    reasons += output_reasons(outputs, comparison.evidence)
    violations = violation_reports(comparison.evidence)
    evidence, documents = comparison.evidence, {}
    for name, seen in evidence.features.items():
        reasons += judge_of(name).reasons(seen, comparison.expected.features.get(name), evidence.start_counts)
        documents[name] = judged_document(name, seen, evidence.start_counts, comparison.axis_names)
    joints, tool = _joints_report(comparison), worst.tool.report()
    actual_tool = worst.actual_tool.report() if comparison.expected.actual_forward else None
    speeds = evidence.axes[0].rates.speeds(evidence.start_counts)
    return Report(run, tuple(reasons), axes, joints, tool, outputs, violations, actual_tool, documents, speeds, skews)


def _worst(comparison: Comparison) -> _Worst:
    axes, motors = len(comparison.axis_names), len(comparison.expected.coupling.seconds)
    worst = _Worst(np.zeros(axes), np.zeros(axes), np.zeros(motors))
    for deviation in deviations(comparison, critical_instants(comparison)):
        worst.take(deviation)
    return worst


def _axis_run(comparison: Comparison, axis: int, worst: _Worst) -> AxisRun:
    position_steps = float(worst.position_steps[axis])
    threshold_steps = float(worst.threshold_steps[axis])
    matching = comparison.matchings[axis]
    unmatched, grazing = matching.unmatched, matching.grazing
    microsteps = comparison.expected.microsteps_of(axis)
    if comparison.gates.step_rule and _follows_step_rule(position_steps, threshold_steps, microsteps):
        unmatched, grazing = 0, unmatched
    return AxisRun(
        evidence=comparison.evidence.axes[axis],
        counted=comparison.counted[axis],
        position_error_steps=position_steps,
        threshold_error_steps=threshold_steps,
        unmatched_steps=unmatched,
        grazing_steps=grazing,
        late_us=comparison.timing_errors_us(axis),
    )


def _follows_step_rule(position_steps: float, threshold_steps: float, microsteps: int | None) -> bool:
    """Return whether the count follows the step rule within the tolerance; False for NaN."""
    near = position_steps <= OWN_FIRMWARE.position_limit_steps(microsteps)
    return near and threshold_steps <= threshold_tolerance_steps(microsteps)


def _strange_modes(comparison: Comparison) -> Iterator[str]:
    """Yield one line for each axis with a driver in another excitation mode than planned."""
    microsteps = comparison.expected.microsteps
    for name, counted, planned in zip(comparison.axis_names, comparison.counted, microsteps, strict=False):
        for factor in counted.longer_by:
            made = f"{planned / factor:g} microsteps per full step"
            yield f"{name}: the driver made {made}, planned {planned}: its steps are {factor:g} times as long"


def _slip_reasons(evidence: Evidence) -> Iterator[str]:
    """Yield one line for each axis with a slip of its motor."""
    for axis in evidence.axes:
        counts, full_steps = axis.slips.counts, axis.slips.full_steps
        if counts.size:
            first_s = float(axis.rates.trajectory_s(counts[0], evidence.start_counts))
            lost, net = int(np.abs(full_steps).sum()), int(full_steps.sum())
            yield f"{axis.name}: the motor lost {lost} full steps from {first_s:.3f} s on, {net:+d} in all"


def powerless_reasons(evidence: Evidence) -> Iterator[str]:
    """Yield one line for each axis with steps without current."""
    for axis in evidence.axes:
        if count := powerless_steps(axis, evidence.start_counts):
            yield f"{axis.name}: {count} steps came while the driver's outputs were off: the motor did not follow"


def _reasons(comparison: Comparison, index: int, axis: AxisReport) -> list[str]:
    """Return one line for each reason why an axis fails."""
    gates, position_steps, threshold_steps = (
        comparison.gates,
        axis.position_error_steps_max,
        axis.threshold_error_steps_max,
    )
    first_s = comparison.matchings[index].first_s
    microsteps = comparison.expected.microsteps_of(index)
    position_limit, threshold_limit = gates.position_limit_steps(microsteps), threshold_tolerance_steps(microsteps)
    checks = (
        (axis.violations > 0, f"driver violations {axis.violations} (limit 0)"),
        (axis.unmatched_steps > 0, f"unmatched steps {axis.unmatched_steps} (limit 0), the first at {first_s:.3f} s"),
        (
            not _right_end(comparison, index, axis),
            f"end count {axis.steps_end} (planned {comparison.ideal[index].end_steps})",
        ),
        (
            not position_steps <= position_limit,
            f"position error {position_steps:.9g} steps (limit {position_limit:g}{_usual(gates)})",
        ),
        (
            gates.step_rule and not threshold_steps <= threshold_limit,
            f"threshold error {threshold_steps:.9g} steps (limit {threshold_limit:g})",
        ),
    )
    return [f"{axis.name}: {line}" for failed, line in checks if failed]


def _usual(gates: Gates) -> str:
    """Return a hint for controllers that need a wider limit than the usual one; None for a user's own limit."""
    if gates != any_step_rule():
        return ""
    return f", usual; of controllers that move in segments, such as grbl, {SEGMENTS_TOLERANCE_STEPS:g} is"


def _right_end(comparison: Comparison, index: int, axis: AxisReport) -> bool:
    """Return whether the final count is the planned one, or one that its step rule allows."""
    if axis.steps_end == comparison.ideal[index].end_steps:
        return True
    gates, expected = comparison.gates, comparison.expected
    if gates.step_rule:
        microsteps = expected.microsteps_of(index)
        return _follows_step_rule(axis.position_error_steps_max, axis.threshold_error_steps_max, microsteps)
    planned = float(expected.axis_position(index, np.array([expected.motion.duration_s]))[0])
    least, most = any_rule_end(planned, comparison.matchings[index].off_steps, gates.position_error_steps)
    return least <= axis.steps_end <= most


def _skew_reports(comparison: Comparison, worst: _Worst) -> tuple[SkewReport, ...]:
    """Return the skew of each joint with two motors."""
    expected, robot = comparison.expected, comparison.expected.robot
    if robot is None or not expected.coupling.seconds:
        return ()
    ends = expected.skews(_positions(comparison, -1)).tolist()
    joints = (robot.joints[joint] for joint in expected.coupling.seconds)
    return tuple(
        SkewReport(joint.name, joint.second_motor.name, joint.unit.value, most, end, joint.second_motor.skew_max)
        for joint, most, end in zip(joints, worst.skews.tolist(), ends, strict=True)
        if joint.second_motor
    )


def _positions(comparison: Comparison, at: int) -> FloatArray:
    return np.array([axis.positions[at] for axis in comparison.counted])


def _joints_report(comparison: Comparison) -> JointsReport:
    start, end = (comparison.expected.joints(_positions(comparison, at)) for at in (0, -1))
    return JointsReport(comparison.joint_names, tuple(start.tolist()), tuple(end.tolist()))
