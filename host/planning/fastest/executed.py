"""Time a path as fast as the limits allow, jerk-bounded, as cubics that keep the limits between their points too.

What the board executes are the cubics between PVT points, so these are the motion here, and each is judged at both
ends, where its acceleration is highest, and where its speed is. Where a cubic exceeds a limit, the limit is lowered
around it for the next pass.
"""

from dataclasses import dataclass, replace
from itertools import count
from typing import Final

import numpy as np

from steptwin.host.common.arrays import FloatArray, Int64Array
from steptwin.host.planning.fastest.averaged import Averaged
from steptwin.host.planning.fastest.pieces import PiecewisePath
from steptwin.host.planning.fastest.rows import PathLimits, with_axes
from steptwin.host.planning.fastest.solve import fastest_squares
from steptwin.host.planning.motions.sampled import Sampled
from steptwin.host.planning.planner import DEFAULT_POINT_MS
from steptwin.host.robots.robot import Robot


@dataclass(frozen=True, slots=True, eq=False)
class TimedPath:
    """A path with its time: the motion, and when it is where.

    Attributes:
        motion: the cubics of the joints; they are what the board executes.
        law: the path's parameter as a function of time.
        highest: largest part of a limit that a cubic uses, at most 1.
    """

    motion: Sampled
    law: Averaged
    highest: float


_PASSES: Final = 10
"""Passes that lower the limits; afterwards the whole motion is made slower by what is still beyond."""
_LOWERED_MAX: Final = 1.3
"""Factor by which a pass lowers a limit at most: the excess of one place also comes from its neighbours."""
_ENOUGH: Final = 1.0 - 1e-7
"""Part of a limit up to which a cubic passes: wire units and rounding need the rest."""
_TOOL_SLACK: Final = 1.004
"""Part of the tool's speed up to which a cubic passes: the tool's way on a cubic is looked at, not bounded."""

OFF_STEPS: Final = 0.005
"""Distance in steps of the motor between the path and the cubics, above which a record is halved."""
_RECORD_MS_MIN: Final = 2


def timed(robot: Robot, path: PiecewisePath, average_s: float, from_ms: int = 0) -> TimedPath:
    """Return the fastest motion from rest to rest along a path, within the limits of its pieces.

    The motion begins `from_ms` after the whole one; its points are those of the whole one.
    """
    rates, asked = path.rates(), path.limits()
    limits, slower = asked, 1.0
    for number in count(1):
        squares = fastest_squares(rates.s, limits.rows(robot, rates))
        law = Averaged.of(rates.s, squares, average_s, slower)
        motion = _cubics(robot, path, law, from_ms)
        use = _Use.of(robot, path, law, motion, asked, rates.s)
        if use.highest <= _ENOUGH:
            break
        if number <= _PASSES:
            limits = use.lowered(limits, law, rates.s)
        else:
            slower *= max(1.0001, use.highest)
    return TimedPath(motion, law, use.highest)


@dataclass(frozen=True, slots=True, eq=False)
class _Use:
    """How much of each limit the cubics use, as shape (records, joints + axes), and the tool's speeds, (records, 2)."""

    ends_s: FloatArray
    speeds: FloatArray
    accelerations: FloatArray
    tool: FloatArray

    @classmethod
    def of(
        cls, robot: Robot, path: PiecewisePath, law: Averaged, motion: Sampled, asked: PathLimits, places: FloatArray
    ) -> "_Use":
        times_s = np.asarray(motion.curve.x)
        dt_s = np.diff(times_s)[:, np.newaxis]
        positions, velocities = (with_axes(robot, of(times_s)) for of in (motion.positions, motion.velocities))
        begin, end = velocities[:-1], velocities[1:]
        chord = np.diff(positions, axis=0) / dt_s
        first, last = (6 * chord - 4 * begin - 2 * end) / dt_s, (4 * end + 2 * begin - 6 * chord) / dt_s
        speeds = np.maximum.reduce([np.abs(begin), np.abs(3 * chord - begin - end), np.abs(end)])
        s, _ = law.at(times_s)
        index = np.clip(np.searchsorted(places, s, side="right") - 1, 0, len(places) - 1)
        near = [np.maximum(limit[index[:-1]], limit[index[1:]]) for limit in (asked.speeds, asked.accelerations)]
        middle_s = (times_s[:-1] + times_s[1:]) / 2
        tool = np.zeros((len(middle_s), 2))
        for t_s in (times_s[:-1], middle_s, times_s[1:]):
            at, rate = law.at(t_s)
            limit = asked.tool[np.clip(np.searchsorted(places, at, side="right") - 1, 0, len(places) - 1)]
            np.maximum(tool, path.at(at)[2] * rate[:, np.newaxis] / limit, out=tool)
        return cls(
            times_s,
            speeds / near[0],
            np.maximum(np.abs(first), np.abs(last)) / near[1],
            tool / _TOOL_SLACK,
        )

    @property
    def highest(self) -> float:
        """The largest part of a limit that is used."""
        return float(max(self.speeds.max(), self.accelerations.max(), self.tool.max()))

    def lowered(self, limits: PathLimits, law: Averaged, places: FloatArray) -> PathLimits:
        """Return limits lowered around the records that exceed theirs, as far as the average reaches."""
        speeds, accelerations, tool = limits.speeds.copy(), limits.accelerations.copy(), limits.tool.copy()
        from_s, _ = law.at(np.clip(self.ends_s[:-1] - law.average_s, 0.0, law.duration_s))
        until_s, _ = law.at(np.clip(self.ends_s[1:] + law.average_s, 0.0, law.duration_s))
        begins = np.searchsorted(places, from_s, side="left")
        ends = np.searchsorted(places, until_s, side="right")
        for used, lowered in ((self.speeds, speeds), (self.accelerations, accelerations), (self.tool, tool)):
            _lower(used, lowered, begins, ends)
        return replace(limits, speeds=speeds, accelerations=accelerations, tool=tool)


def _lower(used: FloatArray, limits: FloatArray, begins: Int64Array, ends: Int64Array) -> None:
    """Divide limits of shape (places, columns) by the largest excess of the records that reach each place."""
    factors = np.ones_like(limits)
    for row, column in np.argwhere(used > _ENOUGH):
        part = factors[begins[row] : ends[row], column]
        np.maximum(part, min(used[row, column] * (1 + 1e-6), _LOWERED_MAX), out=part)
    limits /= factors


def _cubics(robot: Robot, path: PiecewisePath, law: Averaged, from_ms: int) -> Sampled:
    """Return the cubics through the path at knots of whole milliseconds, as close to it as OFF_STEPS."""
    end_ms = round(1000 * law.duration_s)
    knots_ms = np.unique(
        np.concatenate([[0, end_ms], np.arange(-from_ms % DEFAULT_POINT_MS, end_ms, DEFAULT_POINT_MS)])
    )
    while True:
        times_s = knots_ms / 1000
        s, rate = law.at(times_s)
        joints, first, _ = path.at(s)
        velocities = first * rate[:, np.newaxis]
        velocities[[0, -1]] = 0.0
        motion = Sampled.hermite(robot.joint_names, times_s, joints, velocities)
        middles_ms = (knots_ms[:-1] + knots_ms[1:]) // 2
        wanted, _, _ = path.at(law.at(middles_ms / 1000)[0])
        off = np.abs(robot.to_steps(motion.positions(middles_ms / 1000)) - robot.to_steps(wanted)).max(axis=1)
        split = (off > OFF_STEPS) & (np.diff(knots_ms) >= 2 * _RECORD_MS_MIN)
        if not split.any():
            return motion
        knots_ms = np.sort(np.concatenate([knots_ms, middles_ms[split]]))
