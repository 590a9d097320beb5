"""Report a run in plain figures, with the reasons if it failed; the keys are a contract with the report's readers."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, field
from math import isnan
from typing import Any

import numpy as np

from steptwin.host.planning.motion import OutputChange
from steptwin.host.verify.evidence import AxisEvidence, Evidence, SpeedReport
from steptwin.host.verify.figures import AxisReport


@dataclass(frozen=True, slots=True)
class ViolationReport:
    """A limit of one axis' driver that was broken at least once.

    Attributes:
        axis: name of the joint.
        rule: short name of the limit, for programs.
        broken: the fault and its consequence, for people.
        count: number of violations.
        worst: the value furthest from the limit.
        limit: the limiting value.
        unit: unit of `worst` and `limit`.
        first_s: time of the first violation in the trajectory's time; negative before the motion's start.
        source: document and place that state the limit.
    """

    axis: str
    rule: str
    broken: str
    count: int
    worst: float
    limit: float
    unit: str
    first_s: float
    source: str


def violation_reports(evidence: Evidence) -> tuple[ViolationReport, ...]:
    """Return the violations of every axis in order, and of each axis in the order of its limits."""
    return tuple(report for axis in evidence.axes for report in _of_axis(axis, evidence.start_counts))


def _of_axis(axis: AxisEvidence, start_counts: int) -> Iterator[ViolationReport]:
    violations = axis.violations
    for index, limit in enumerate(violations.limits):
        chosen = violations.which == index
        if not chosen.any():
            continue
        values = violations.values[chosen]
        yield ViolationReport(
            axis=axis.name,
            rule=limit.rule,
            broken=limit.broken,
            count=values.size,
            worst=float(values[np.argmax(np.abs(values - limit.limit))]),
            limit=limit.limit,
            unit=limit.unit,
            first_s=float(axis.rates.trajectory_s(violations.counts[chosen].min(), start_counts)),
            source=limit.source,
        )


SIGNIFICANT_DIGITS = 9
"""Number of significant digits of a float: short enough to read, and an error of any size remains visible."""


@dataclass(frozen=True, slots=True)
class BusReport:
    """Traffic on the bus: bit rate in bit/s, number of frames, and load as a percentage of the bit rate."""

    bitrate: int
    frames: int
    load_percent: float


@dataclass(frozen=True, slots=True)
class RunInfo:
    """Facts of a run that the verifier cannot compute: names, traffic, simulated time and wall-clock time."""

    robot: str
    job: str
    duration_s: float
    bus: BusReport
    simulated_s: float
    wall_s: float


@dataclass(frozen=True, slots=True)
class JointsReport:
    """Joint positions at t = 0 and at the end, in mm and degrees, from the drivers' counts."""

    names: tuple[str, ...]
    start: tuple[float, ...]
    end: tuple[float, ...]


@dataclass(frozen=True, slots=True)
class ToolReport:
    """Deviation of the counted tool pose from the planned one, just before and just after every step of any axis.

    The rms is over these instants, not over time: parts of the motion with dense steps weigh more.
    """

    position_error_mm_max: float
    position_error_mm_rms: float
    attitude_error_deg_max: float


@dataclass(frozen=True, slots=True)
class SkewReport:
    """Distance of a joint's two motors, by their drivers' counts and their slips, in mm or degrees.

    Attributes:
        first: name of the joint and of its own axis.
        second: name of the second motor's axis.
        unit: "mm" or "deg".
        skew_max: largest distance at any instant of the motion.
        skew_end: lead of the second motor at the end.
        limit: largest distance that the robot's file allows.
    """

    first: str
    second: str
    unit: str
    skew_max: float
    skew_end: float
    limit: float


@dataclass(frozen=True, slots=True)
class Report:
    """A verified run.

    Attributes:
        run: names, traffic and times.
        reasons: one line for each failed check, naming axis, value and limit; empty if the run passed.
        axes: figures of each axis in its order.
        joints: joint positions at start and end.
        tool: deviation of the tool; without a tool, NaN here and null in the document.
        outputs: each planned change of a digital output, with its real time.
        violations: violated limits of the drivers.
        actual_tool: deviation of the actual tool, with the errors of the DH parameters in the robot's file, from the
            planned pose; None without such errors. It has no effect on the verdict: a machine that makes the planned
            steps passes.
        features: evidence of features, under the keys of the document.
        speeds: changes of the motion's speed, with pauses; the document has them only if there are any.
        skews: distances of the two motors of joints with two.
    """

    run: RunInfo
    reasons: tuple[str, ...]
    axes: tuple[AxisReport, ...]
    joints: JointsReport
    tool: ToolReport
    outputs: tuple[OutputChange, ...]
    violations: tuple[ViolationReport, ...]
    actual_tool: ToolReport | None = None
    features: Mapping[str, Mapping[str, Any]] = field(default_factory=dict)
    speeds: tuple[SpeedReport, ...] = ()
    skews: tuple[SkewReport, ...] = ()

    @property
    def passed(self) -> bool:
        """True if no check failed."""
        return not self.reasons

    def to_dict(self) -> dict[str, Any]:
        """Return plain Python values under the keys of `run --json`, floats to nine significant digits."""
        return {
            "robot": self.run.robot,
            "job": self.run.job,
            "duration_s": _plain(self.run.duration_s),
            "passed": self.passed,
            "reasons": list(self.reasons),
            "axes": [_plain(asdict(axis)) for axis in self.axes],
            "joints": _plain(asdict(self.joints)),
            "tool": None if isnan(self.tool.position_error_mm_max) else _plain(asdict(self.tool)),
            **({"actual_tool": _plain(asdict(self.actual_tool))} if self.actual_tool else {}),
            "outputs": [_plain(output.to_dict()) for output in self.outputs],
            "violations": [_plain(asdict(violation)) for violation in self.violations],
            **{name: _plain(dict(document)) for name, document in self.features.items()},
            **speeds_document(self.speeds),
            **({"skews": [_plain(asdict(skew)) for skew in self.skews]} if self.skews else {}),
            "bus": _plain(asdict(self.run.bus)),
            "simulated_s": _plain(self.run.simulated_s),
            "wall_s": _plain(self.run.wall_s),
        }


def speeds_document(speeds: Sequence[SpeedReport]) -> dict[str, Any]:
    """Return the changes of speed under their key of a run's document; empty without any."""
    return {"speeds": [_plain(asdict(speed)) for speed in speeds]} if speeds else {}


def _plain(value: Any) -> Any:
    """Return the value in types that JSON knows."""
    if isinstance(value, dict):
        return {key: _plain(item) for key, item in value.items()}
    if isinstance(value, tuple | list):
        return [_plain(item) for item in value]
    return float(f"{value:.{SIGNIFICANT_DIGITS}g}") if isinstance(value, float) else value
