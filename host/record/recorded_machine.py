"""The machine of a stored run at any instant: planned and counted joints, its parts, and moved boxes.

Times are seconds of the motion. Counted joints follow from the drivers' counts.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Final, Self

import numpy as np

from steptwin.host.common.arrays import FloatArray
from steptwin.host.record.folder import StoredRun
from steptwin.host.robots.box import Range
from steptwin.host.robots.kinematics import ArmPart, Kinematics, make_kinematics
from steptwin.host.robots.kinematics.base import tool_places_mm
from steptwin.host.robots.robot import Robot
from steptwin.host.verify import Comparison, Evidence, OutputEdge
from steptwin.host.verify.switching import output_edges

_END: Final = float("inf")


@dataclass(frozen=True, slots=True, eq=False)
class RecordedMachine:
    """The machine of one run; methods take instants of shape (n,), in any order."""

    robot: Robot
    kinematics: Kinematics
    comparison: Comparison
    holds_s: dict[str, tuple[Range, ...]]
    """Start and end of each time when an output was on; the last one may have no end."""

    @classmethod
    def of(cls, run: StoredRun) -> Self:
        """Return the machine of a stored run; outputs are those of its pins, planned or not."""
        evidence = run.comparison.evidence
        changes = output_edges(run.robot, evidence.axes)
        holds_s = {name: _on_times_s(changes, name, evidence) for name in run.robot.outputs}
        return cls(run.robot, make_kinematics(run.robot), run.comparison, holds_s)

    @property
    def duration_s(self) -> float:
        """Duration of the planned motion."""
        return self.comparison.expected.motion.duration_s

    def planned_joints(self, t_s: FloatArray) -> FloatArray:
        """Return the planned joint positions, shape (n, joints); constant before and after the motion."""
        return self.comparison.expected.motion.positions(np.clip(t_s, 0.0, self.duration_s))

    def counts(self, t_s: FloatArray) -> FloatArray:
        """Return the drivers' counts after the steps at each instant, shape (n, axes); before 0 those at 0."""
        counted = self.comparison.counted
        return np.column_stack([one.positions[np.searchsorted(one.time_s, t_s, side="right")] for one in counted])

    def counted_joints(self, t_s: FloatArray) -> FloatArray:
        """Return the joint positions at the drivers' counts, shape (n, joints)."""
        return self.comparison.expected.joints(self.counts(t_s))

    def counted_poses(self, t_s: FloatArray) -> FloatArray:
        """Return the tool's poses at the drivers' counts."""
        return self.kinematics.forward(self.counted_joints(t_s))

    def links(self, t_s: FloatArray) -> tuple[ArmPart, ...]:
        """Return the machine's parts at the drivers' counts."""
        return self.kinematics.links(self.counted_joints(t_s))

    def box_shifts_mm(self, t_s: FloatArray) -> dict[str, FloatArray]:
        """Return the displacement of each box of the robot's file, shape (n, 3); boxes that nothing holds stay."""

        def tip_at(at_s: FloatArray) -> FloatArray:
            return tool_places_mm(self.kinematics, self.counted_joints(np.minimum(at_s, self.duration_s)))

        return {
            name: box.shifts_mm(t_s, self.holds_s.get(box.held_by, ()), tip_at)
            for name, box in self.robot.boxes.items()
        }


def _on_times_s(changes: Sequence[OutputEdge], name: str, evidence: Evidence) -> tuple[Range, ...]:
    own = [change for change in changes if change.name == name]
    instants_s = [evidence.trajectory_s(change.counts) for change in own] + [_END]
    return tuple(span for change, span in zip(own, pairwise(instants_s), strict=True) if change.level)
