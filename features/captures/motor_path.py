"""The path of a plan in motor steps, without its time, and where the tool is on it."""

from dataclasses import dataclass
from typing import Any, Final

import numpy as np

from steptwin.host.common.arrays import BoolArray, FloatArray
from steptwin.host.verify import Expectation

_SAMPLES_PER_S: Final = 4000
_AT_ONCE: Final = 16_384
_OFF_STEPS: Final = 0.002
"""Distance from a chord up to which a vertex is left out, each time that there are fewer vertices."""
_ROUNDS: Final = 12
_LONG_MM: Final = 1e-3
_CURVE: Final = 0.985
_LINE: Final = 0.999_999
"""Cosines of the turns between chords of a curve; those of corners are less, those of lines are more."""


@dataclass(frozen=True, slots=True, eq=False)
class MotorPath:
    """A path as a line of straight segments in steps; a place on it is a vertex and a part of the segment behind it.

    Attributes:
        points: shape (axes, vertices), at least two.
        joints: shape (vertices, joints), in mm and degrees.
        expected: the plan.
        distance_mm: shape (vertices,), how far the tool has come; None for a machine without a tool.
    """

    points: FloatArray
    joints: FloatArray
    expected: Expectation
    distance_mm: FloatArray | None

    @property
    def curve_steps_per_mm(self) -> float:
        """Most steps of an axis for a mm of the path if it is curved anywhere; 0 for straight lines only."""
        if self.distance_mm is None:
            return 0.0
        chords = np.diff(self.expected.forward(self.joints)[:, :3], axis=0)
        length_mm = np.linalg.norm(chords, axis=1)
        moved = length_mm > _LONG_MM
        ways = chords[moved] / length_mm[moved, np.newaxis]
        cosines = (ways[:-1] * ways[1:]).sum(axis=1)
        curved = (cosines > _CURVE) & (cosines < _LINE)
        steps_per_mm = np.abs(np.diff(self.points))[:, moved] / length_mm[moved]
        return float(steps_per_mm[:, :-1][:, curved].max(initial=0.0))

    def joints_at(self, place: float) -> FloatArray:
        """Return the joints' positions at a place."""
        at = np.arange(len(self.joints))
        return np.array([np.interp(place, at, own) for own in self.joints.T])

    def mm_at(self, place: float) -> float | None:
        """Return how far the tool has come at a place."""
        if self.distance_mm is None:
            return None
        return float(np.interp(place, np.arange(len(self.distance_mm)), self.distance_mm))

    def words_at(self, place: float) -> str:
        """Return where the machine is: the tool, or the joints of a machine without one."""
        joints = self.joints_at(place)
        if self.distance_mm is not None:
            return self.expected.task.words(np.round(self.expected.forward(joints[np.newaxis])[0], 3) + 0.0)
        units = zip(self.expected.motion.joint_names, joints.tolist(), self.expected.joint_units, strict=True)
        return ", ".join(f"{name} {round(value, 3) + 0.0:g} {unit}" for name, value, unit in units)

    def to_dict(self, places: tuple[float, float]) -> dict[str, Any]:
        """Return two places for JSON."""
        names, (begin, end) = self.expected.motion.joint_names, places
        return {
            "from_mm": self.mm_at(begin),
            "until_mm": self.mm_at(end),
            "from_joints": dict(zip(names, self.joints_at(begin).tolist(), strict=True)),
            "until_joints": dict(zip(names, self.joints_at(end).tolist(), strict=True)),
        }


def motor_path(expected: Expectation) -> MotorPath:
    """Return the path of a plan."""
    motion = expected.motion
    count = round(motion.duration_s * _SAMPLES_PER_S) + 1
    parts = []
    for begin in range(0, count, _AT_ONCE):
        sampled = np.arange(begin, min(begin + _AT_ONCE + 1, count))
        parts.append(_thinned(expected, motion.positions(np.minimum(sampled / _SAMPLES_PER_S, motion.duration_s))))
    joints = _thinned(expected, np.concatenate(parts))
    if len(joints) == 1:
        joints = np.repeat(joints, 2, axis=0)
    poses = expected.forward(joints)
    chords_mm = np.linalg.norm(np.diff(poses[:, :3], axis=0), axis=1)
    distance_mm = np.concatenate(([0.0], np.cumsum(chords_mm))) if poses.shape[1] >= 3 else None
    points = np.ascontiguousarray(expected.axis_steps(joints).T)
    return MotorPath(points, joints, expected, distance_mm)


def _thinned(expected: Expectation, joints: FloatArray) -> FloatArray:
    """Return positions without those that lie on the line between their neighbours, or where the machine stands."""
    for _ in range(_ROUNDS):
        steps = expected.axis_steps(joints)
        kept = np.ones(len(joints), bool)
        kept[1:-1][1::2] = ~_between(steps[:-2], steps[1:-1], steps[2:])[1::2]
        kept[1:-1][0::2] = ~_between(steps[:-2], steps[1:-1], steps[2:])[0::2] | ~(kept[:-2] & kept[2:])[0::2]
        if kept.all():
            break
        joints = joints[kept]
    return joints


def _between(begin: FloatArray, middle: FloatArray, end: FloatArray) -> BoolArray:
    """Return which points lie on the line between two others."""
    way, gone = end - begin, middle - begin
    squares = np.maximum((way * way).sum(axis=1), 1e-30)
    part = np.clip((way * gone).sum(axis=1) / squares, 0.0, 1.0)
    off = np.abs(gone - part[:, np.newaxis] * way).max(axis=1)
    return np.asarray(off <= _OFF_STEPS)
