"""Put expectation and evidence side by side, axis by axis, for the report and the pictures."""

from dataclasses import dataclass

from steptwin.host.common.arrays import FloatArray
from steptwin.host.verify.counted import CountedSteps, counted_steps
from steptwin.host.verify.evidence import Evidence
from steptwin.host.verify.expectation import Expectation
from steptwin.host.verify.matching import Matching, match_steps, timing_errors_us
from steptwin.host.verify.oracle import IdealSteps, ideal_steps


@dataclass(frozen=True, slots=True)
class Comparison:
    """One run: for each axis in joint order the ideal steps, the counted steps, and the pairs of both."""

    expected: Expectation
    evidence: Evidence
    ideal: tuple[IdealSteps, ...]
    counted: tuple[CountedSteps, ...]
    matchings: tuple[Matching, ...]

    @property
    def joint_names(self) -> tuple[str, ...]:
        """Names of the axes in joint order."""
        return self.expected.trajectory.joint_names

    def timing_errors_us(self, axis: int) -> FloatArray:
        """Return how late each step of an axis came, in microseconds; steps at slow crossings are left out."""
        return timing_errors_us(self.ideal[axis], self.counted[axis], self.matchings[axis])


def compare(expected: Expectation, evidence: Evidence) -> Comparison:
    """Compute the ideal steps from the drivers' counts at t = 0 and match the accepted steps to them.

    Raises:
        ValueError: the evidence's axes are not the planned joints in the same order.
    """
    names = tuple(axis.name for axis in evidence.axes)
    if names != expected.trajectory.joint_names:
        raise ValueError(f"evidence of axes {names}, but a plan of joints {expected.trajectory.joint_names}")
    microsteps = expected.microsteps or (None,) * len(names)
    counted = tuple(
        counted_steps(axis, evidence.start_counts, planned)
        for axis, planned in zip(evidence.axes, microsteps, strict=True)
    )
    starts = tuple(axis.start_steps for axis in counted)
    ideal = ideal_steps(expected.axis_motion, expected.steps_per_unit, starts)
    matchings = tuple(match_steps(*pair) for pair in zip(ideal, counted, strict=True))
    return Comparison(expected, evidence, ideal, counted, matchings)
