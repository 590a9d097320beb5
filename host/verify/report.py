"""The report of a run: plain figures, whether it passed, and if not, why; its keys are a contract with its readers."""

from dataclasses import asdict, dataclass
from typing import Any

from steptwin.host.verify.switching import OutputReport
from steptwin.host.verify.violations import ViolationReport

SIGNIFICANT_DIGITS = 9
"""To which floats are written: short enough to read, and an error of any size remains visible."""


@dataclass(frozen=True, slots=True)
class BusReport:
    """Traffic of the run on the bus."""

    bitrate: int
    frames: int
    load_percent: float


@dataclass(frozen=True, slots=True)
class RunInfo:
    """What the verifier cannot know of a run: names, traffic, and how long it took on the board and on the wall."""

    robot: str
    job: str
    duration_s: float
    bus: BusReport
    simulated_s: float
    wall_s: float


@dataclass(frozen=True, slots=True)
class AxisReport:
    """One axis of a run. None stands for what an axis without pulses does not have; its timing errors are 0.0.

    Attributes:
        name: the joint.
        steps_start: the driver's count at t = 0, in steps from the joint's zero.
        steps_end: the driver's count after its last step.
        pulses: on STEP, accepted or not.
        reversals: how often an accepted step goes against the one before it.
        peak_rate_hz: the inverse of the smallest interval between accepted steps that follow each other the same way.
        position_error_steps_max: the largest |count - planned position| at any instant from the start of the motion.
        timing_error_us_p50: median of |accepted edge - ideal crossing|, crossings below 1 % of the peak rate left out.
        timing_error_us_p99: its 99th percentile.
        timing_error_us_max: its maximum.
        clk_high_us_min: how long the driver chip's CLK is high, at least: a pulse on STEP, or a pause between two of
            them where `active_edge` is falling.
        clk_low_us_min: how long it is low, at least: the other one of these.
        violations: how often limits of the driver were broken, all together.
        unmatched_steps: ideal crossings without a step and steps without a crossing, together.
        grazing_steps: such steps where the motion turns around within the tolerance of a threshold, so that stepping
            and not stepping are both right; they are not counted as unmatched.
        threshold_error_steps_max: how far from its threshold the planned position was when a step was made, at most.
        mean_step_interval_us: from the first accepted step to the last, per step.
        active_edge: "rising" or "falling", the edge of the board's STEP with which the chip's CLK rises.
    """

    name: str
    steps_start: int
    steps_end: int
    pulses: int
    reversals: int
    peak_rate_hz: float
    position_error_steps_max: float
    timing_error_us_p50: float
    timing_error_us_p99: float
    timing_error_us_max: float
    clk_high_us_min: float | None
    clk_low_us_min: float | None
    violations: int
    unmatched_steps: int
    grazing_steps: int
    threshold_error_steps_max: float
    mean_step_interval_us: float | None
    active_edge: str


@dataclass(frozen=True, slots=True)
class JointsReport:
    """Joint positions in mm and degrees as the drivers counted them, at t = 0 and at the end."""

    names: tuple[str, ...]
    start: tuple[float, ...]
    end: tuple[float, ...]


@dataclass(frozen=True, slots=True)
class ToolReport:
    """The counted tool pose against the planned one, just before and just after every step edge of any axis.

    The rms is over these instants, not over time: where steps are dense it weighs more.
    """

    position_error_mm_max: float
    position_error_mm_rms: float
    attitude_error_deg_max: float


@dataclass(frozen=True, slots=True)
class Report:
    """A verified run.

    Attributes:
        run: names, traffic and times.
        reasons: one line for each thing that failed, naming axis, value and limit; empty when the run passed.
        axes: the figures per axis in joint order.
        joints: where the joints started and ended.
        tool: how far the tool was off.
        outputs: the planned changes of digital outputs, and when each was made.
        violations: the limits of the drivers that were broken.
    """

    run: RunInfo
    reasons: tuple[str, ...]
    axes: tuple[AxisReport, ...]
    joints: JointsReport
    tool: ToolReport
    outputs: tuple[OutputReport, ...]
    violations: tuple[ViolationReport, ...]

    @property
    def passed(self) -> bool:
        """Whether nothing failed."""
        return not self.reasons

    def to_dict(self) -> dict[str, Any]:
        """Plain Python values under the keys of `run --json`, floats to nine significant digits."""
        return {
            "robot": self.run.robot,
            "job": self.run.job,
            "duration_s": _plain(self.run.duration_s),
            "passed": self.passed,
            "reasons": list(self.reasons),
            "axes": [_plain(asdict(axis)) for axis in self.axes],
            "joints": _plain(asdict(self.joints)),
            "tool": _plain(asdict(self.tool)),
            "outputs": [_plain(asdict(output)) for output in self.outputs],
            "violations": [_plain(asdict(violation)) for violation in self.violations],
            "bus": _plain(asdict(self.run.bus)),
            "simulated_s": _plain(self.run.simulated_s),
            "wall_s": _plain(self.run.wall_s),
        }


def _plain(value: Any) -> Any:
    """The same value for a JSON document."""
    if isinstance(value, dict):
        return {key: _plain(item) for key, item in value.items()}
    if isinstance(value, tuple | list):
        return [_plain(item) for item in value]
    return float(f"{value:.{SIGNIFICANT_DIGITS}g}") if isinstance(value, float) else value
