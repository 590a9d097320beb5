"""Make motions in closed form, and the evidence that a perfect board would leave of them."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from steptwin.host.common.arrays import FloatArray
from steptwin.host.planning.motion import JointLaw, Motion
from steptwin.host.record.folder.edges_file import PINS
from steptwin.host.verify import (
    AxisEvidence,
    BusReport,
    DriverViolations,
    Evidence,
    Expectation,
    LevelEdges,
    Phases,
    RunInfo,
)
from steptwin.host.verify.oracle import IdealSteps, ideal_steps
from steptwin.protocol.drivers import ActiveEdge
from steptwin.protocol.timer import COUNTS_PER_SECOND

START_COUNTS = 3_600_000
"""Instant of t = 0 in made evidence: 50 ms after power-up, so that a forgotten offset shows."""

ENABLE_COUNTS = 1_800_000
"""Instant at which drivers in made evidence leave reset and are enabled."""

CLK_HIGH_COUNTS = 2_376  # 33 us
RUN = RunInfo("test-arm", "test", 1.0, BusReport(1_000_000, 0, 0.0), 1.05, 0.01)

NO_VIOLATIONS = DriverViolations((), np.empty(0, np.int64), np.empty(0, np.int8), np.empty(0))
NO_PHASES = Phases(np.empty(0, np.int64), np.empty(0, np.int32), np.empty(0, np.int16), np.empty(0, np.int16))

Scalar = Callable[[FloatArray], FloatArray]


@dataclass(frozen=True, slots=True)
class Columns(JointLaw):
    """A law with a position and a velocity function for each joint."""

    position: tuple[Scalar, ...]
    velocity: tuple[Scalar, ...]

    def positions(self, t_s: FloatArray) -> FloatArray:
        return np.column_stack([f(t_s) for f in self.position])

    def velocities(self, t_s: FloatArray) -> FloatArray:
        return np.column_stack([f(t_s) for f in self.velocity])


def line(start: float, rate: float) -> tuple[Scalar, Scalar]:
    """Return a motion at constant speed; the verifier needs no rest at the ends."""
    return lambda t: start + rate * t, lambda t: np.full_like(t, rate)


def sines(terms: Sequence[tuple[float, float, float]], offset: float = 0.0) -> tuple[Scalar, Scalar]:
    """Return a sum of amplitude * sin(omega t + phase) around an offset."""
    amplitude, omega, phase = (np.array(column) for column in zip(*terms, strict=True))
    return (
        lambda t: offset + np.sin(np.outer(t, omega) + phase) @ amplitude,
        lambda t: np.cos(np.outer(t, omega) + phase) @ (amplitude * omega),
    )


def trapezoid(start: float, distance: float, duration_s: float, ramp_s: float) -> tuple[Scalar, Scalar]:
    """Return a motion from rest to rest at constant acceleration, speed and deceleration."""
    speed = distance / (duration_s - ramp_s)

    def position(t: FloatArray) -> FloatArray:
        up = speed * t**2 / (2.0 * ramp_s)
        down = distance - speed * (duration_s - t) ** 2 / (2.0 * ramp_s)
        middle = speed * (t - ramp_s / 2.0)
        return start + np.where(t < ramp_s, up, np.where(t > duration_s - ramp_s, down, middle))

    def velocity(t: FloatArray) -> FloatArray:
        return speed * np.clip(np.minimum(t, duration_s - t) / ramp_s, 0.0, 1.0)

    return position, velocity


def motion(duration_s: float, *joints: tuple[Scalar, Scalar]) -> Motion:
    """Return a motion of joints a, b, ... given as functions of time."""
    law = Columns(tuple(p for p, _ in joints), tuple(v for _, v in joints))
    return Motion(tuple("abcdefgh"[: len(joints)]), duration_s, law)


def still(position: float) -> tuple[Scalar, Scalar]:
    """Return a joint that stands still."""
    return line(position, 0.0)


def planar_forward(joints: FloatArray) -> FloatArray:
    """Forward kinematics of a stage: joints are x in mm, y in mm and attitude in degrees; missing joints are 0."""
    columns = np.zeros((len(joints), 3))
    columns[:, : joints.shape[1]] = joints[:, :3]
    return np.column_stack([columns[:, 0], columns[:, 1], np.zeros(len(joints)), columns[:, 2]])


def expect(motion: Motion, *steps_per_unit: float) -> Expectation:
    """Return the expectation for a motion of the stage."""
    units = ("mm", "mm", "deg", *("deg",) * 5)[: len(steps_per_unit)]
    return Expectation(motion, np.array(steps_per_unit), units, planar_forward)


def nearest_steps(expected: Expectation) -> tuple[int, ...]:
    """Return the counters of a board that stands at the start of the motion."""
    start = expected.motion.positions(np.zeros(1))[0] * expected.steps_per_unit
    return tuple(int(n) for n in np.floor(start + 0.5))


def perfect_evidence(expected: Expectation) -> Evidence:
    """Return the evidence of a board that makes every ideal step in the nearest count of its timer."""
    starts = nearest_steps(expected)
    ideal = ideal_steps(expected.motion, expected.steps_per_unit, starts)
    names = expected.motion.joint_names
    return Evidence(START_COUNTS, tuple(map(_perfect_axis, names, ideal)))


def _perfect_axis(name: str, ideal: IdealSteps) -> AxisEvidence:
    counts = START_COUNTS + np.rint(ideal.time_s * COUNTS_PER_SECOND).astype(np.int64)
    turns = np.flatnonzero(np.diff(ideal.signs, prepend=np.int8(-1)))  # DIR is low at power-up
    switched_on = LevelEdges(np.array([ENABLE_COUNTS]), np.array([1], np.int8))
    still_low = LevelEdges(np.empty(0, np.int64), np.empty(0, np.int8))
    return AxisEvidence(
        name=name,
        start_steps=ideal.start_steps,
        clk_rise_counts=counts,
        clk_fall_counts=counts + CLK_HIGH_COUNTS,
        active_edge=ActiveEdge.RISING,
        dir_edge_counts=counts[turns] - 720,
        dir_levels=(ideal.signs[turns] > 0).astype(np.int8),
        step_counts=counts,
        step_signs=ideal.signs,
        violations=NO_VIOLATIONS,
        phases=NO_PHASES,
        pins={pin: switched_on if pin in {"reset", "enable"} else still_low for pin in PINS},
    )


def altered(evidence: Evidence, axis: int = 0, **changes: object) -> Evidence:
    """Return the evidence with some fields of one axis replaced."""
    axes = list(evidence.axes)
    axes[axis] = replace(axes[axis], **changes)  # type: ignore[arg-type]
    return replace(evidence, axes=tuple(axes))
