"""Time a path as fast as the limits allow, jerk-bounded, as cubics that keep the limits between their points too.

The path's parameter is averaged over a time that bounds its jerk. What the board executes are the cubics between PVT
points, so these are the motion here, and each is judged at both ends, where its acceleration is highest, and where its
speed is. Where a cubic exceeds a limit, the limit is lowered around it for the next pass.
"""

from dataclasses import dataclass, replace
from itertools import count
from typing import Final, Protocol, Self

import numpy as np

from steptwin.host.common.arrays import FloatArray, Int64Array
from steptwin.host.common.errors import InputError
from steptwin.host.common.planning_time import check_planning_time
from steptwin.host.planning.fastest.drives import DriveAnswer, DrivesOnPath
from steptwin.host.planning.fastest.rows import PathLimits, PathRates, Rows, with_axes
from steptwin.host.planning.fastest.solve import Solver, fastest_squares
from steptwin.host.planning.laws import time_after
from steptwin.host.planning.motions.sampled import Sampled
from steptwin.host.planning.peaks import check_length
from steptwin.host.planning.trajectory import DEFAULT_POINT_MS
from steptwin.host.robots.robot import Robot


@dataclass(frozen=True, slots=True, eq=False)
class Averaged:
    """The moving average over `average_s` of a parameter that is a parabola between knots, and stretched a little.

    The average is continuous in its acceleration; where the parameter's acceleration is at most a, its jerk is at most
    2 a / average_s. Its duration is that of the parameter plus `average_s`, rounded up to a whole millisecond: that is
    the stretch. Made by `of`.

    Attributes:
        times_s: shape (n,), the knots before averaging, rising from 0.
        s: shape (n,), the parameter at the knots.
        speeds: shape (n,), its speed at the knots; 0 at both ends.
        areas: shape (n,), the integral of the parameter up to the knots.
        average_s: time over which it is averaged, above 0.
        duration_s: duration, a whole number of milliseconds.
    """

    times_s: FloatArray
    s: FloatArray
    speeds: FloatArray
    areas: FloatArray
    average_s: float
    duration_s: float

    @classmethod
    def of(cls, s: FloatArray, squares: FloatArray, average_s: float, slower: float = 1.0) -> Self:
        """Return the average for squares of the speed at places, both of shape (n,); the square is even in between.

        The places do not fall. `slower` is a further stretch, at least 1.
        """
        steps, roots = np.diff(s), np.sqrt(squares)
        moved = steps > 0
        dt_s = 2.0 * steps[moved] / (roots[:-1] + roots[1:])[moved]
        keep = np.concatenate([[True], moved])
        own_s, speeds = s[keep], roots[keep]
        times_s = np.concatenate([[0.0], np.cumsum(dt_s)])
        u = np.diff(speeds) / dt_s
        grown = dt_s * (own_s[:-1] + dt_s * (speeds[:-1] / 2.0 + dt_s * u / 6.0))
        areas = np.concatenate([[0.0], np.cumsum(grown)])
        duration_s = np.ceil(1000.0 * slower * (times_s[-1] + average_s) - 1e-6) / 1000.0
        return cls(times_s, own_s, speeds, areas, average_s, float(duration_s))

    def at(self, t_s: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return the parameter and its speed at times of shape (n,) in [0, duration_s]."""
        shrink = (self.times_s[-1] + self.average_s) / self.duration_s
        late = t_s * shrink
        early = late - self.average_s
        (area, s), (area_before, s_before) = self._raw(late), self._raw(early)
        value = (area - area_before) / self.average_s
        value = np.where(t_s <= 0.0, self.s[0], np.where(t_s >= self.duration_s, self.s[-1], value))
        return value, (s - s_before) / self.average_s * shrink

    def time_at(self, s: float) -> float:
        """Return the time in seconds when the parameter is first at a value; it rises everywhere in between."""
        return time_after(lambda t_s: float(self.at(np.array([t_s]))[0][0]) < s, self.duration_s)

    def _raw(self, t_s: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return the integral of the parameter, and the parameter, at times before averaging; both ends stand."""
        inside = np.clip(t_s, 0.0, self.times_s[-1])
        i = np.clip(np.searchsorted(self.times_s, inside, side="right") - 1, 0, len(self.times_s) - 2)
        dt_s = inside - self.times_s[i]
        u = (self.speeds[i + 1] - self.speeds[i]) / (self.times_s[i + 1] - self.times_s[i])
        s = self.s[i] + dt_s * (self.speeds[i] + dt_s * u / 2.0)
        area = self.areas[i] + dt_s * (self.s[i] + dt_s * (self.speeds[i] / 2.0 + dt_s * u / 6.0))
        area += self.s[0] * np.minimum(t_s, 0.0) + self.s[-1] * np.maximum(t_s - self.times_s[-1], 0.0)
        return area, s


class LimitedPath(Protocol):
    """A path of the joints with its limits."""

    def rates(self) -> PathRates:
        """Return the path at the places where its limits are looked at."""
        ...

    def limits(self) -> PathLimits:
        """Return the limits at the same places."""
        ...

    def at(self, s: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return joints and their first derivatives at parameters of shape (n,)."""
        ...

    def tool(self, s: FloatArray) -> FloatArray:
        """Return the tool's way in mm and its turn in degrees for each unit of the parameter, of shape (n, 2)."""
        ...


@dataclass(frozen=True, slots=True, eq=False)
class TimedPath:
    """A path with its time: the motion, and when it is where.

    Attributes:
        motion: the cubics of the joints; they are what the board executes.
        law: the path's parameter as a function of time.
        highest: largest part of a limit that a cubic uses, at most 1.
        drives: what the drives say of it; None where only the joints limit it.
    """

    motion: Sampled
    law: Averaged
    highest: float
    drives: DriveAnswer | None = None


class UntimedError(InputError):
    """At no pace the cubics along a path keep the limits; `s` is the parameter of the path where they do not."""

    def __init__(self, message: str, s: float = 0.0) -> None:
        super().__init__(message)
        self.s = s


_LIMIT_PASSES: Final = 8
"""Passes that lower the limits that are exceeded; the following ones cap the speed there, which reaches all of them."""
_PASSES: Final = 20
"""Passes altogether; afterwards the whole motion is made slower by what is still beyond."""
_SLOWER_MAX: Final = 1.5
"""Factor by which the whole motion is made slower at most: what needs more of it turns joints all at once."""
_LOWERED_MAX: Final = 1.3
"""Factor by which a pass lowers a limit at most: the excess of one place also comes from its neighbours."""
_BEYOND: Final = 1e-4
"""Part by which a pass lowers a limit beyond what it was exceeded by, so that the last digits take no more passes."""
_ENOUGH: Final = 1.0 - 1e-7
"""Part of a limit up to which a cubic passes: wire units and rounding need the rest."""
_TOOL_SLACK: Final = 1.004
"""Part of the tool's speed up to which a cubic passes: the tool's way on a cubic is looked at, not bounded."""

_TORQUE_SLACK: Final = 1.005
"""Part of a drive's torque up to which a cubic passes: of 70 % it is a third of a percent."""
_LINEARISED: Final = 3
"""Solutions by which the torques at the speeds that are reached are found: to about 0.1 %."""

OFF_STEPS: Final = 0.005
"""Distance in steps of the motor between the path and the cubics, above which a record is halved."""
_RECORD_MS_MIN: Final = 2


def timed(
    robot: Robot, path: LimitedPath, average_s: float, from_ms: int = 0, drives: DrivesOnPath | None = None
) -> TimedPath:
    """Return the fastest motion from rest to rest along a path, within the limits of its pieces and of the drives.

    The motion begins `from_ms` after the whole one; its points are those of the whole one. With `drives` it keeps their
    torques, too, but their rotors have not turned yet: `driven` does that.
    """
    rates, asked = path.rates(), path.limits()
    limits, caps, slower = asked, np.full(len(rates.s), np.inf), 1.0
    torques = _Torques.of(rates, drives, asked.rows(robot, rates))
    for number in count(1):
        check_planning_time()
        rows = limits.rows(robot, rates)
        squares = torques.fastest(replace(rows, x_max=np.minimum(rows.x_max, caps)))
        law = Averaged.of(rates.s, squares, average_s, slower)
        check_length("the motion", round(1000 * law.duration_s))
        motion = _cubics(robot, path, law, from_ms)
        use = _Use.of(robot, path, law, motion, asked, rates.s)
        used = torques.used(motion, law)
        highest = max(use.highest, float(used.max(initial=0.0)))
        if highest <= _ENOUGH:
            break
        if number <= _LIMIT_PASSES:
            limits = use.lowered(limits, law, rates.s)
            torques.lower(used, *use.reached(law, rates.s))
        elif number <= _PASSES:
            caps = np.minimum(caps, squares / use.factors(used, law, rates.s))
        else:
            slower *= max(1.0001, highest)
            if slower > _SLOWER_MAX:
                raise UntimedError(*use.worst(robot, law))
    return TimedPath(motion, law, highest)


@dataclass(slots=True, eq=False)
class _Torques:
    """The torques of drives along a path, if any limit it.

    Attributes:
        rates: the path.
        drives: the drives on it; None: nothing but its other limits counts.
        solver: solver of the path without drives.
        parts: shape (places, axes), what each drive may add to the weight that it carries, as a part of what it has.
        squares: shape (places,), the last squares of the speed, about which torques are linear.
    """

    rates: PathRates
    drives: DrivesOnPath | None
    solver: Solver
    parts: FloatArray
    squares: FloatArray | None = None

    @classmethod
    def of(cls, rates: PathRates, drives: DrivesOnPath | None, rows: Rows) -> "_Torques":
        return cls(rates, drives, Solver.of(rates.s, rows), np.ones((len(rates.s), drives.axes if drives else 0)))

    def fastest(self, rows: Rows) -> FloatArray:
        """Return the squares of the highest speeds within rows and torques."""
        s = self.rates.s
        if self.drives is None:
            return self.solver.squares(rows.c, rows.x_max)
        solutions = 1
        if self.squares is None:
            self.squares, solutions = self.solver.squares(rows.c, rows.x_max), _LINEARISED
        for _ in range(solutions):
            self.squares = fastest_squares(s, rows.beside(self.drives.rows(self.squares, self.parts)))
        return self.squares

    def used(self, motion: Sampled, law: Averaged) -> FloatArray:
        """Return the part of its torque that each drive uses, shape (records, axes)."""
        times_s = np.asarray(motion.curve.x)
        if self.drives is None:
            return np.zeros((len(times_s) - 1, 0))
        return self.drives.used(motion, law.at(times_s)[0]) / _TORQUE_SLACK

    def lower(self, used: FloatArray, begins: Int64Array, ends: Int64Array) -> None:
        """Lower what drives may add around the records that use too much."""
        self.parts = self.parts / _factors(used, len(self.parts), begins, ends)


@dataclass(frozen=True, slots=True, eq=False)
class _Use:
    """How much of each limit the cubics use, as shape (records, joints + axes), and the tool's speeds, (records, 2)."""

    ends_s: FloatArray
    speeds: FloatArray
    accelerations: FloatArray
    tool: FloatArray

    @classmethod
    def of(
        cls, robot: Robot, path: LimitedPath, law: Averaged, motion: Sampled, asked: PathLimits, places: FloatArray
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
            np.maximum(tool, path.tool(at) * rate[:, np.newaxis] / limit, out=tool)
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

    def worst(self, robot: Robot, law: Averaged) -> tuple[str, float]:
        """Return which limit is exceeded most, in words, and at which parameter of the path."""
        names = [*(f"{joint.name}'s" for joint in robot.joints), *(f"{joint.name}'s axis'" for joint in robot.axes)]
        parts = [self.speeds, self.accelerations, self.tool]
        row, column = np.unravel_index(int(np.argmax(used := np.concatenate(parts, axis=1))), used.shape)
        whats = [f"{name} {what}" for what in ("speed", "acceleration") for name in names]
        what = [*whats, "the tool's speed", "the tool's turn"][column]
        s = float(law.at(self.ends_s[row : row + 1])[0][0])
        return (
            f"{what} is {used[row, column]:.3g} times the highest at whatever pace: the path turns too sharply there",
            s,
        )

    def lowered(self, limits: PathLimits, law: Averaged, places: FloatArray) -> PathLimits:
        """Return limits lowered around the records that exceed theirs, as far as the average reaches."""
        reach = self.reached(law, places)
        speeds, accelerations, tool = (
            limit / _factors(used, len(places), *reach)
            for used, limit in (
                (self.speeds, limits.speeds),
                (self.accelerations, limits.accelerations),
                (self.tool, limits.tool),
            )
        )
        return replace(limits, speeds=speeds, accelerations=accelerations, tool=tool)

    def factors(self, torques: FloatArray, law: Averaged, places: FloatArray) -> FloatArray:
        """Return by how much the squares of the speeds are to be lowered at each place, of shape (places,).

        `torques` are the parts of their torques that the drives use, shape (records, drives).
        """
        parts = [self.speeds**2, self.accelerations, self.tool**2, torques]
        used = np.concatenate(parts, axis=1).max(axis=1, keepdims=True)
        return _factors(used, len(places), *self.reached(law, places))[:, 0]

    def reached(self, law: Averaged, places: FloatArray) -> tuple[Int64Array, Int64Array]:
        """Return the first place and the one after the last that each record is averaged from."""
        from_s, _ = law.at(np.clip(self.ends_s[:-1] - law.average_s, 0.0, law.duration_s))
        until_s, _ = law.at(np.clip(self.ends_s[1:] + law.average_s, 0.0, law.duration_s))
        return np.searchsorted(places, from_s, side="left"), np.searchsorted(places, until_s, side="right")


def _factors(used: FloatArray, places: int, begins: Int64Array, ends: Int64Array) -> FloatArray:
    """Return the largest excess of the records that reach each place, of shape (places, columns), at least 1."""
    factors = np.ones((places, used.shape[1]))
    for row, column in np.argwhere(used > _ENOUGH):
        part = factors[begins[row] : ends[row], column]
        np.maximum(part, min(used[row, column] * (1 + _BEYOND), _LOWERED_MAX), out=part)
    return factors


def _cubics(robot: Robot, path: LimitedPath, law: Averaged, from_ms: int) -> Sampled:
    """Return the cubics through the path at knots of whole milliseconds, as close to it as OFF_STEPS."""
    end_ms = round(1000 * law.duration_s)
    knots_ms = np.unique(
        np.concatenate([[0, end_ms], np.arange(-from_ms % DEFAULT_POINT_MS, end_ms, DEFAULT_POINT_MS)])
    )
    joints, velocities = _on_path(path, law, knots_ms)
    unseen = np.arange(len(knots_ms) - 1)
    while True:
        check_planning_time()
        begins_ms, ends_ms = knots_ms[unseen], knots_ms[unseen + 1]
        middles_ms = (begins_ms + ends_ms) // 2
        middles, speeds = _on_path(path, law, middles_ms)
        last_ms = (ends_ms - begins_ms)[:, np.newaxis]
        dt_s, part = last_ms / 1000, (middles_ms - begins_ms)[:, np.newaxis] / last_ms
        at_end = part**2 * (3.0 - 2.0 * part)
        bulge = part * (1.0 - part) * dt_s * ((1.0 - part) * velocities[unseen] - part * velocities[unseen + 1])
        made = joints[unseen] + at_end * (joints[unseen + 1] - joints[unseen]) + bulge
        off = np.abs(robot.to_steps(made) - robot.to_steps(middles)).max(axis=1)
        split = (off > OFF_STEPS) & (last_ms[:, 0] >= 2 * _RECORD_MS_MIN)
        if not split.any():
            return Sampled.hermite(robot.joint_names, knots_ms / 1000, joints, velocities)
        at = unseen[split] + 1
        knots_ms = np.insert(knots_ms, at, middles_ms[split])
        joints, velocities = (
            np.insert(joints, at, middles[split], axis=0),
            np.insert(velocities, at, speeds[split], axis=0),
        )
        halves = at + np.arange(len(at))
        unseen = np.stack([halves - 1, halves], axis=1).ravel()


def _on_path(path: LimitedPath, law: Averaged, times_ms: Int64Array) -> tuple[FloatArray, FloatArray]:
    """Return joints and their velocities, at rest at both ends of the motion."""
    s, rate = law.at(times_ms / 1000)
    joints, first = path.at(s)
    is_end = (times_ms <= 0) | (times_ms >= round(1000 * law.duration_s))
    return joints, np.where(is_end[:, np.newaxis], 0.0, first * rate[:, np.newaxis])
