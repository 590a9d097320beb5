"""Time a path as fast as the limits allow, jerk-bounded, as cubics that keep the limits between their points too.

The path's parameter is averaged over a time that bounds its jerk. What the board executes are the cubics between PVT
points, so these are the motion here, and each is judged at both ends, where its acceleration is highest, and where its
speed is. Where a cubic exceeds a limit, the limit is lowered around it for the next pass.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Final, NamedTuple, Protocol, Self

import numpy as np

from steptwin.features.fastest.averaged import NO_STOPS, Averaged
from steptwin.features.fastest.drives import DrivesOnPath
from steptwin.features.fastest.rows import AVERAGE_S, PathLimits, PathRates, Rows, squares_in_bends, with_axes
from steptwin.features.fastest.shaper import NO_SHAPER, Shaper
from steptwin.features.fastest.solve import Bounds, Solver, fastest_squares
from steptwin.features.fastest.straight_runs import ramps, straight_runs
from steptwin.host.common.arrays import FloatArray, Int64Array
from steptwin.host.common.errors import InputError
from steptwin.host.common.planning_time import check_planning_time
from steptwin.host.planning.drives import DriveAnswer
from steptwin.host.planning.laws import SCurve
from steptwin.host.planning.motion import DEFAULT_POINT_MS, Motion
from steptwin.host.planning.motions.sampled import Spline, along_cubics
from steptwin.host.planning.peaks import check_length
from steptwin.host.robots.robot import Robot


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

    motion: Motion
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
_PASSES: Final = 80
"""Passes altogether; afterwards each run is made slower as a whole by what is still beyond."""
_ROUGH_PASSES: Final = 20
"""Passes after which motions are compared, if their cubics do not keep `_NEARLY` before."""
_WORK_MAX: Final = 4e6
"""Places of a path times passes altogether, but for the first `_ROUGH_PASSES`: long motions have fewer passes."""
_HARDLY_S: Final = 0.001
"""Time by which a run may be made slower as a whole at once: no pass saves a part of a millisecond."""
_NEARLY: Final = 1.05
"""Part of a limit up to which further passes make a motion longer by no more than a few thousandths."""
_SLOWER_MAX: Final = 1.5
"""Factor by which a run is made slower at most: what needs more of it turns joints all at once."""
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
    robot: Robot,
    path: LimitedPath,
    average_s: float,
    from_ms: int = 0,
    drives: DrivesOnPath | None = None,
    stops: FloatArray = NO_STOPS,
) -> TimedPath:
    """Return the fastest motion from rest to rest along a path, within the limits of its pieces and of the drives.

    The motion begins `from_ms` after the whole one; its points are those of the whole one. With `drives` it keeps their
    torques, too, but their rotors have not turned yet: `driven` does that. It rests at the parameters `stops`, rising,
    at which pieces of the path meet; the runs in between are timed each by itself.
    """
    timing = _Timing.of(robot, path, average_s, from_ms, drives, stops)
    if drives is None:
        timing = _with_better_start(timing)
    tried = timing.passed()
    return TimedPath(along_cubics(robot.joint_names, tried.cubics), tried.law, float(tried.highest.max()))


def _with_better_start(timing: "_Timing") -> "_Timing":
    """Return the timing of a path, or one that is slow in some bends from the start on, whichever is faster.

    In a bend that is passed in hardly more than the averaging time, passes lower accelerations all around; where that
    takes more time than to approach the bend slowly, the bend is slow from the start on.
    """
    in_bends = squares_in_bends(timing.robot, timing.rates, timing.asked, timing.average_s)
    squares, s = timing.passed(_ROUGH_PASSES, _NEARLY).squares, timing.rates.s
    binds = np.concatenate([[False], in_bends < squares, [False]])
    begins, ends = np.flatnonzero(~binds[:-1] & binds[1:]), np.flatnonzero(binds[:-1] & ~binds[1:]) - 1
    if not len(begins):
        return timing
    slow = timing.starting_below(in_bends)
    seams = np.concatenate([s[:1], (s[ends[:-1]] + s[begins[1:]]) / 2.0, s[-1:]])
    lasts_s = [np.diff(each.passed(_ROUGH_PASSES, _NEARLY).law.times_at(seams)) for each in (timing, slow)]
    is_faster = lasts_s[1] < lasts_s[0]
    if not slow.is_hopeful:
        return timing
    if is_faster.all() or not timing.is_hopeful:
        return slow
    if not is_faster.any():
        return timing
    near = np.clip(np.searchsorted(seams, s, side="right") - 1, 0, len(begins) - 1)
    mixed = timing.starting_below(np.where(is_faster[near], in_bends, np.inf))
    mixed.passed(_ROUGH_PASSES, _NEARLY)
    hopeful = [each for each in (timing, slow, mixed) if each.is_hopeful]
    return min(hopeful, key=lambda each: each.passed(_ROUGH_PASSES, _NEARLY).law.duration_s)


def lasting_s(
    robot: Robot,
    path: LimitedPath,
    average_s: float,
    drives: DrivesOnPath | None = None,
    stops: FloatArray = NO_STOPS,
) -> FloatArray:
    """Return how long each run between stops lasts in `timed`, or nearly so and not in whole ms, of shape (runs,).

    One that cannot be timed lasts for ever.
    """
    timing = _Timing.of(robot, path, average_s, 0, drives, stops)
    if drives is None:
        timing = timing.starting_below(squares_in_bends(robot, timing.rates, timing.asked, average_s))
    tried = timing.passed(_ROUGH_PASSES, _NEARLY)
    return np.where(tried.highest > _SLOWER_MAX, np.inf, tried.law.least_s)


class _Tried(NamedTuple):
    """What a pass has made; `highest` is the largest part of a limit that each run uses, of shape (runs,)."""

    law: Averaged
    cubics: Spline
    squares: FloatArray
    use: "_Use"
    torques: FloatArray
    highest: FloatArray


@dataclass(slots=True, eq=False)
class _Timing:
    """A path that is timed in passes, each of which lowers what the one before has exceeded.

    Attributes:
        limits: shape as those of the path, what is asked for, lowered.
        rows: these limits as rows.
        caps: shape (places,), bounds of the squares of the speeds.
        slower: shape (runs,), stretch of each run.
        straight: the S-curves of straight runs, by the numbers of the runs.
        passes: number of passes so far.
        last: what the last one has made.
    """

    robot: Robot
    path: LimitedPath
    average_s: float
    from_ms: int
    stops: FloatArray
    rates: PathRates
    asked: PathLimits
    limits: PathLimits
    rows: Rows
    caps: FloatArray
    slower: FloatArray
    torques: "_Torques"
    straight: Mapping[int, SCurve]
    passes: int = 0
    last: _Tried | None = None

    @classmethod
    def of(
        cls,
        robot: Robot,
        path: LimitedPath,
        average_s: float,
        from_ms: int,
        drives: DrivesOnPath | None,
        stops: FloatArray,
    ) -> "_Timing":
        rates, asked = path.rates(), path.limits()
        caps = np.where(np.isin(rates.s, stops), 0.0, np.inf)
        rows = asked.rows(robot, rates)
        torques = _Torques.of(rates, drives, rows)
        slower = np.ones(len(stops) + 1)
        straight = {} if drives else straight_runs(robot, rates, asked, stops)
        return cls(robot, path, average_s, from_ms, stops, rates, asked, asked, rows, caps, slower, torques, straight)

    def starting_below(self, squares: FloatArray) -> Self:
        """Return the timing of the same path from the first pass on, with bounds of the squares of the speeds."""
        caps = np.where(np.isin(self.rates.s, self.stops), 0.0, squares)
        torques, slower = replace(self.torques, squares=None), np.ones(len(self.slower))
        rows = self.asked.rows(self.robot, self.rates)
        return replace(
            self, limits=self.asked, rows=rows, caps=caps, slower=slower, torques=torques, passes=0, last=None
        )

    def passed(self, number: int | None = None, within: float = _ENOUGH) -> _Tried:
        """Return what the pass of a number makes, or an earlier one that keeps this part of the limits."""
        while self.last is None or (self.last.highest > within).any():
            if self.last is not None:
                if self.passes == number:
                    break
                self.correct(self.passes, self.last)
            self.last = self.tried()
            self.passes += 1
        return self.last

    @property
    def is_hopeful(self) -> bool:
        """Whether further passes can make the last one keep all limits."""
        return self.last is not None and bool((self.last.highest <= _SLOWER_MAX).all())

    def tried(self) -> _Tried:
        """Return the motion within the present limits, and what it uses of those that are asked for."""
        check_planning_time()
        robot, places = self.robot, self.rates.s
        squares = self.torques.fastest(self.rows, self.caps)
        law = self._law(squares)
        check_length("the motion", round(1000 * law.duration_s))
        cubics = self._cubics(law)
        use = _Use.of(robot, self.path, law, cubics, self.asked, places)
        torques = self.torques.used(cubics, law)
        each = np.maximum(use.highest, torques.max(axis=1, initial=0.0))
        firsts = np.searchsorted(use.ends_s, law.begins_s[:-1])
        return _Tried(law, cubics, squares, use, torques, np.maximum.reduceat(each, firsts))

    def _law(self, squares: FloatArray) -> Averaged:
        """Return the path's parameter by time for squares of its speed; straight runs have their S-curves."""
        places, average_s = self.rates.s, np.full(len(self.slower), self.average_s)
        if not self.straight:
            return Averaged.of(places, squares, average_s, self.slower, self.stops, self.torques.shaper)
        seams = np.searchsorted(places, self.stops) + 1
        parts = list(zip(np.split(places, seams), np.split(squares, seams), strict=True))
        for run, curve in self.straight.items():
            parts[run], average_s[run] = ramps(curve, parts[run][0][0]), curve.jerk_s
        s, squares = (np.concatenate(each) for each in zip(*parts, strict=True))
        return Averaged.of(s, squares, average_s, self.slower, self.stops)

    def _cubics(self, law: Averaged) -> Spline:
        """Return the cubics through the path at knots of whole milliseconds, as close to it as OFF_STEPS.

        Where the jerk of S-curves jumps, there is a knot: so they are exact.
        """
        robot, path = self.robot, self.path
        begins_ms = np.rint(1000 * law.begins_s).astype(np.int64)
        grid_ms = np.arange(-self.from_ms % DEFAULT_POINT_MS, begins_ms[-1], DEFAULT_POINT_MS)
        jumps_s = [law.begins_s[run] + np.array(curve.breakpoints_s) for run, curve in self.straight.items()]
        jumps_ms = np.rint(1000 * np.concatenate([*jumps_s, np.zeros(0)])).astype(np.int64)
        knots_ms = np.unique(np.concatenate([begins_ms, grid_ms, jumps_ms]))
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
            off = np.abs(robot.to_steps(made) - robot.to_steps(middles)).max(axis=1) > OFF_STEPS
            if self._is_fine:
                ends = [with_axes(robot, each[rows]) for each in (joints, velocities) for rows in (unseen, unseen + 1)]
                steep = _end_accelerations(dt_s, (ends[1] - ends[0]) / dt_s, ends[2], ends[3])
                index = [_piece_of(law, each_ms / 1000, self.rates.s) for each_ms in (begins_ms, ends_ms)]
                near = np.maximum(*(self.asked.accelerations[each] for each in index))
                off |= (np.maximum(*map(np.abs, steep)) > near).any(axis=1)
            split = off & (last_ms[:, 0] >= 2 * _RECORD_MS_MIN)
            if not split.any():
                return Spline.hermite(knots_ms / 1000, joints, velocities)
            at = unseen[split] + 1
            knots_ms = np.insert(knots_ms, at, middles_ms[split])
            joints, velocities = (
                np.insert(joints, at, middles[split], axis=0),
                np.insert(velocities, at, speeds[split], axis=0),
            )
            halves = at + np.arange(len(at))
            unseen = np.stack([halves - 1, halves], axis=1).ravel()

    @property
    def _is_fine(self) -> bool:
        """Whether records are halved where their own acceleration is beyond a limit, not the path's."""
        return self.average_s < AVERAGE_S or self.passes >= _ROUGH_PASSES

    def correct(self, number: int, tried: _Tried) -> None:
        """Lower what a pass of a number exceeds; raise UntimedError if nothing helps."""
        law, use, places = tried.law, tried.use, self.rates.s
        if number <= _LIMIT_PASSES:
            self.limits = use.lowered(self.limits, law, places)
            self.rows = self.limits.rows(self.robot, self.rates)
            self.torques.lower(tried.torques, *use.reached(law, places))
        elif number <= _ROUGH_PASSES or (
            number <= min(_PASSES, _WORK_MAX / len(places))
            and self.is_hopeful
            and (law.least_s * (tried.highest - 1.0) > _HARDLY_S).any()
        ):
            self.caps = np.minimum(self.caps, tried.squares / use.factors(tried.torques, law, places))
        else:
            later = (law.lasts_s + 0.5e-3) / law.least_s  # the next whole millisecond
            beyond = np.maximum(self.slower * np.maximum(1.0001, tried.highest), later)
            self.slower = np.where(tried.highest > _ENOUGH, beyond, self.slower)
            if self.slower.max() > _SLOWER_MAX:
                raise UntimedError(*use.worst(self.robot, law))


@dataclass(slots=True, eq=False)
class _Torques:
    """The torques of drives along a path, if any limit it.

    Attributes:
        rates: the path.
        drives: the drives on it; None: nothing but its other limits counts.
        solver: solver of the path without drives.
        parts: shape (places, axes), what each drive may add to the weight that it carries, as a part of what it has.
        squares: shape (places,), the last squares of the speed, about which torques are linear.
        bounds: the last rows, and what they mean for each interval.
    """

    rates: PathRates
    drives: DrivesOnPath | None
    solver: Solver
    parts: FloatArray
    squares: FloatArray | None = None
    bounds: tuple[Rows, Bounds] | None = None

    @classmethod
    def of(cls, rates: PathRates, drives: DrivesOnPath | None, rows: Rows) -> "_Torques":
        return cls(rates, drives, Solver.of(rates.s, rows), np.ones((len(rates.s), drives.axes if drives else 0)))

    def fastest(self, rows: Rows, caps: FloatArray) -> FloatArray:
        """Return the squares of the highest speeds within rows, caps of shape (places,), and torques."""
        x_max = np.minimum(rows.x_max, caps)
        if self.drives is None:
            if self.bounds is None or self.bounds[0] is not rows:
                self.bounds = rows, self.solver.bounds(rows.c)
            return self.solver.squares(self.bounds[1], x_max)
        solutions = 1
        if self.squares is None:
            self.squares, solutions = self.solver.squares(self.solver.bounds(rows.c), x_max), _LINEARISED
        for _ in range(solutions):
            with_torques = replace(rows, x_max=x_max).beside(self.drives.rows(self.squares, self.parts))
            self.squares = fastest_squares(self.rates.s, with_torques)
        return self.squares

    @property
    def shaper(self) -> Shaper:
        """What shapes a motion so that the arm does not swing on its drives."""
        return NO_SHAPER if self.drives is None else self.drives.shaper

    def used(self, cubics: Spline, law: Averaged) -> FloatArray:
        """Return the part of its torque that each drive uses, shape (records, axes)."""
        times_s = cubics.knots_s
        if self.drives is None:
            return np.zeros((len(times_s) - 1, 0))
        return self.drives.used(cubics, law.at(times_s)[0]) / _TORQUE_SLACK

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
        cls, robot: Robot, path: LimitedPath, law: Averaged, cubics: Spline, asked: PathLimits, places: FloatArray
    ) -> "_Use":
        times_s = cubics.knots_s
        dt_s = np.diff(times_s)[:, np.newaxis]
        positions, velocities = (with_axes(robot, of(times_s)) for of in (cubics.positions, cubics.velocities))
        begin, end = velocities[:-1], velocities[1:]
        chord = np.diff(positions, axis=0) / dt_s
        first, last = _end_accelerations(dt_s, chord, begin, end)
        speeds = np.maximum.reduce([np.abs(begin), np.abs(3 * chord - begin - end), np.abs(end)])
        index = _piece_of(law, times_s, places)
        near = [np.maximum(limit[index[:-1]], limit[index[1:]]) for limit in (asked.speeds, asked.accelerations)]
        middle_s = (times_s[:-1] + times_s[1:]) / 2
        at_ends, at_middles = (_tool_used(path, law, t_s, asked, places) for t_s in (times_s, middle_s))
        tool = np.maximum.reduce([at_ends[:-1], at_middles, at_ends[1:]])
        return cls(
            times_s,
            speeds / near[0],
            np.maximum(np.abs(first), np.abs(last)) / near[1],
            tool / _TOOL_SLACK,
        )

    @property
    def highest(self) -> FloatArray:
        """Shape (records,), the largest part of a limit that each uses."""
        parts = (self.speeds, self.accelerations, self.tool)
        return np.asarray(np.maximum.reduce([each.max(axis=1) for each in parts]))

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
        """Return the first place and the one after the last that each record is averaged from, all of its run."""
        run = law.run_at(self.ends_s[:-1])
        begin_s, end_s = law.begins_s[run], law.begins_s[run + 1]
        from_s, _ = law.at(np.clip(self.ends_s[:-1] - law.spans_s[run], begin_s, end_s))
        until_s, _ = law.at(np.clip(self.ends_s[1:] + law.spans_s[run], begin_s, end_s))
        # where two runs meet the place stands twice: once for each
        bounds = np.concatenate([[0], np.searchsorted(places, law.s[law.rests[1:-1]]) + 1, [len(places)]])
        firsts, lasts = np.searchsorted(places, from_s, side="left"), np.searchsorted(places, until_s, side="right")
        return np.maximum(firsts, bounds[run]), np.minimum(lasts, bounds[run + 1])


def _end_accelerations(
    dt_s: FloatArray, chord: FloatArray, begin: FloatArray, end: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return the accelerations at both ends of cubics, by the slope of their chord and their speeds at both ends."""
    return (6 * chord - 4 * begin - 2 * end) / dt_s, (4 * end + 2 * begin - 6 * chord) / dt_s


def _piece_of(law: Averaged, times_s: FloatArray, places: FloatArray) -> Int64Array:
    """Return the last place up to which the path is at each time."""
    return np.clip(np.searchsorted(places, law.at(times_s)[0], side="right") - 1, 0, len(places) - 1)


def _tool_used(path: LimitedPath, law: Averaged, t_s: FloatArray, asked: PathLimits, places: FloatArray) -> FloatArray:
    """Return the part of the tool's speeds that is used at times of shape (n,), as shape (n, 2)."""
    at, rate = law.at(t_s)
    limit = asked.tool[np.clip(np.searchsorted(places, at, side="right") - 1, 0, len(places) - 1)]
    return path.tool(at) * rate[:, np.newaxis] / limit


def _factors(used: FloatArray, places: int, begins: Int64Array, ends: Int64Array) -> FloatArray:
    """Return the largest excess of the records that reach each place, of shape (places, columns), at least 1."""
    factors = np.ones((places, used.shape[1]))
    for row, column in np.argwhere(used > _ENOUGH):
        part = factors[begins[row] : ends[row], column]
        np.maximum(part, min(used[row, column] * (1 + _BEYOND), _LOWERED_MAX), out=part)
    return factors


def _on_path(path: LimitedPath, law: Averaged, times_ms: Int64Array) -> tuple[FloatArray, FloatArray]:
    """Return joints and their velocities, at rest at both ends of each run."""
    s, rate = law.at(times_ms / 1000)
    joints, first = path.at(s)
    is_end = np.isin(times_ms, np.rint(1000 * law.begins_s))
    return joints, np.where(is_end[:, np.newaxis], 0.0, first * rate[:, np.newaxis])
