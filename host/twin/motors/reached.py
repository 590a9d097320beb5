"""The tool's pose that the rotors really reach, beside the planned one and the one that the drivers have counted."""

from dataclasses import dataclass
from typing import Self

import numpy as np

from steptwin.host.common.arrays import FloatArray
from steptwin.host.robots.poses import Task
from steptwin.host.twin.motors.after_run import RotorTrace
from steptwin.host.twin.motors.driving import Driving
from steptwin.host.verify import Comparison
from steptwin.protocol.timer import COUNTS_PER_SECOND


@dataclass(frozen=True, slots=True, eq=False)
class ToolPaths:
    """Poses each ms from the start of the motion until the drivers go off.

    Attributes:
        task: task of the tool, which says what their columns are.
        t_s: shape (n,), from the start of the motion.
        planned: shape (n, task.width).
        counted: shape (n, task.width), where the drivers' steps put the tool.
        reached: shape (n, task.width), where the rotors put it.
    """

    task: Task

    t_s: FloatArray
    planned: FloatArray
    counted: FloatArray
    reached: FloatArray

    @classmethod
    def of(cls, driving: Driving, comparison: Comparison, trace: RotorTrace) -> Self:
        """Return the paths of a run; with the errors of the arm's links if the robot's file states some."""
        expected = comparison.expected
        first = min(int(np.searchsorted(trace.counts, driving.start_counts)), len(trace.counts) - 1)
        shown = slice(first, max(int(np.searchsorted(trace.counts, driving.off_counts)), first + 1))
        t_s = (trace.counts[shown] - driving.start_counts) / COUNTS_PER_SECOND
        planned = expected.trajectory.positions(np.minimum(t_s, expected.trajectory.duration_s))
        steps = np.column_stack([axis.around(t_s)[1] for axis in comparison.counted])
        forward = expected.actual_forward or expected.forward
        return cls(
            task=expected.task,
            t_s=t_s,
            planned=expected.forward(planned),
            counted=forward(expected.joints(steps)),
            reached=forward(expected.coupling.to_joints(trace.positions[shown])),
        )


@dataclass(frozen=True, slots=True)
class ToolReached:
    """How far the tool really is from where the drivers have counted it.

    Attributes:
        position_mm_max: largest distance.
        position_max_at_s: when, from the start of the motion.
        attitude_deg_max: largest angle.
        position_mm_end: just before the drivers go off.
        attitude_deg_end: likewise, with its sign.
    """

    position_mm_max: float
    position_max_at_s: float
    attitude_deg_max: float
    position_mm_end: float
    attitude_deg_end: float

    @classmethod
    def of(cls, paths: ToolPaths) -> Self:
        """Return the distances of a run; a mechanism that cannot be where the rotors are counts up to there."""
        apart = paths.reached - paths.counted
        possible = np.isfinite(apart).all(axis=1)
        distances_mm = np.linalg.norm(apart[possible, :3], axis=1)
        angles_deg = paths.task.off_deg(paths.reached[possible], paths.counted[possible])
        worst = int(distances_mm.argmax())
        return cls(
            position_mm_max=float(distances_mm[worst]),
            position_max_at_s=float(paths.t_s[possible][worst]),
            attitude_deg_max=float(np.abs(angles_deg).max()),
            position_mm_end=float(distances_mm[-1]),
            attitude_deg_end=float(angles_deg[-1]),
        )
