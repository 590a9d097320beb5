"""Compute the ideal steps: the instants when the planned motion crosses the step thresholds.

The step rule, with H = 1/2 + 1/16 step: a counter n increases when p(t) >= n + H and decreases when p(t) <= n - H,
where p is the planned joint position in steps. The oracle applies the rule to the continuous functions of the
motion. It shares nothing with the firmware that it checks: no integers, no ticks, no chords.

The method: sample the motion every millisecond, and add its turning points. Between two extremes the motion is monotone
and crosses its thresholds in order. Two samples bracket each crossing; all crossings are solved together.
Chandrupatla's method uses inverse quadratic interpolation if three points promise convergence, and bisection otherwise.
A smooth function needs about five evaluations, any continuous function hardly more than bisection.


Source: T. R. Chandrupatla, "A new hybrid quadratic/bisection algorithm for finding the zero of a nonlinear function
without using derivatives", Advances in Engineering Software 28 (1997) 145-149.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from itertools import pairwise
from math import ceil, floor

import numpy as np
from numpy.typing import NDArray

from steptwin.host.common.arrays import FloatArray, Int8Array
from steptwin.host.common.errors import InputError
from steptwin.host.planning.motion import Motion

IndexArray = NDArray[np.intp]

Functions = Callable[[FloatArray, IndexArray], FloatArray]
"""Returns values at abscissae of shape (m,); the second argument is the index of the function for each abscissa."""

MAX_EVALUATIONS = 200


def bracketed_roots(
    functions: Functions,
    low: FloatArray,
    high: FloatArray,
    f_low: FloatArray,
    f_high: FloatArray,
    tolerance: float,
) -> FloatArray:
    """Return the root of each of n functions, shape (n,), with an error of at most twice the tolerance.

    All arrays have shape (n,). The signs of f_low and f_high differ, or one of them is 0. The root of an empty bracket
    (low == high) is its bound.
    """
    roots = np.where(f_low == 0.0, low, high)
    which = np.flatnonzero((f_low != 0.0) & (f_high != 0.0) & (low < high))
    a, b, f_a, f_b = low[which], high[which], f_low[which], f_high[which]
    fraction = f_a / (f_a - f_b)
    for _ in range(MAX_EVALUATIONS):
        if which.size == 0:
            break
        margin = tolerance / np.abs(b - a)
        x = a + np.clip(fraction, margin, 1.0 - margin) * (b - a)
        f_x = functions(x, which)
        same = np.sign(f_x) == np.sign(f_a)
        c, f_c = np.where(same, a, b), np.where(same, f_a, f_b)
        b, f_b = np.where(same, b, a), np.where(same, f_b, f_a)
        a, f_a = x, f_x
        roots[which] = np.where(np.abs(f_a) < np.abs(f_b), a, b)
        open_ = (f_a != 0.0) & (np.abs(b - a) > 2.0 * tolerance)
        which, a, b, c, f_a, f_b, f_c = (v[open_] for v in (which, a, b, c, f_a, f_b, f_c))
        fraction = _next_fraction(a, b, c, f_a, f_b, f_c)
    return roots


def _next_fraction(
    a: FloatArray, b: FloatArray, c: FloatArray, f_a: FloatArray, f_b: FloatArray, f_c: FloatArray
) -> FloatArray:
    """Return the next abscissa as a fraction of the interval a to b: interpolated if that is safe, else the middle."""
    xi = (a - b) / (c - b)
    phi = (f_a - f_b) / (f_c - f_b)
    safe = (phi**2 < xi) & ((1.0 - phi) ** 2 < 1.0 - xi)
    fraction = np.full(a.shape, 0.5)
    a, b, c, f_a, f_b, f_c = (v[safe] for v in (a, b, c, f_a, f_b, f_c))
    fraction[safe] = f_a / (f_b - f_a) * f_c / (f_b - f_c) + (c - a) / (b - a) * f_a / (f_c - f_a) * f_b / (f_c - f_b)
    return fraction


HYSTERESIS_STEPS = 1 / 16
"""Hysteresis of a step beyond the middle between two positions: noise at the middle makes no steps."""

THRESHOLD_STEPS = 1 / 2 + HYSTERESIS_STEPS
"""H of the step rule: distance between position and counter at which the counter changes."""

SAMPLES_PER_SECOND = 1000
SAMPLES_PER_CHUNK = 8192
"""Number of samples that are computed at once, which bounds the memory."""

CROSSINGS_PER_CHUNK = 65_536
"""Number of crossings that are solved at once, which bounds the memory."""

CROSSINGS_MAX = 1 << 26
"""Highest number of ideal steps of all axes together: an hour of six axes at 3 kHz each, 2.5 GB."""

TIME_TOLERANCE_S = 1e-11
NEGLIGIBLE_OVERSHOOT_STEPS = 1e-9
"""Least overshoot of a turning point over its neighbouring samples; less is rounding noise at standstill."""


@dataclass(frozen=True, slots=True)
class IdealSteps:
    """Ideal steps of one axis, in order of time.

    Attributes:
        start_steps: the counter before the first step.
        time_s: shape (steps,), trajectory time of each crossing.
        signs: shape (steps,), direction of each step, +1 or -1.
        speeds_hz: shape (steps,), speed of the motion at the threshold, in steps per second, never negative.
        turning_s: shape (m,), instants of local extremes of the position, and the end.
    """

    start_steps: int
    time_s: FloatArray
    signs: Int8Array
    speeds_hz: FloatArray
    turning_s: FloatArray

    @property
    def end_steps(self) -> int:
        """The counter after the last step."""
        return self.start_steps + int(self.signs.sum(dtype=np.int64))


@dataclass(frozen=True, slots=True)
class _Brackets:
    """Crossings to solve: between low_s and high_s the axis' position in steps crosses its threshold."""

    axis: IndexArray
    signs: Int8Array
    thresholds_steps: FloatArray
    low_s: FloatArray
    high_s: FloatArray
    low_steps: FloatArray
    high_steps: FloatArray

    def __getitem__(self, part: slice) -> "_Brackets":
        return _Brackets(*(getattr(self, name)[part] for name in self.__slots__))

    @staticmethod
    def joined(parts: "list[_Brackets]") -> "_Brackets":
        return _Brackets(*(np.concatenate([getattr(p, name) for p in parts]) for name in _Brackets.__slots__))


_NO_BRACKETS = _Brackets(np.empty(0, np.intp), np.empty(0, np.int8), *(np.empty(0, np.float64) for _ in range(5)))


class _AxisCounter:
    """Applies the step rule to one axis; holds its counter and the crossings found so far."""

    def __init__(self, axis: int, start_steps: int) -> None:
        self._axis = axis
        self._start_steps = start_steps
        self._counter = start_steps
        self._turning_s: list[FloatArray] = []
        self._solved: list[tuple[FloatArray, Int8Array, FloatArray]] = []

    def passes(self, position_steps: FloatArray) -> float:
        """Return an estimate of the number of crossings in the samples; it may be infinite."""
        return float(np.abs(np.diff(position_steps, prepend=self._counter)).sum())

    def follow(self, t_s: FloatArray, position_steps: FloatArray) -> list[_Brackets]:
        """Return the crossings in samples, which contain all extremes and begin at the end of the last ones."""
        extremes = _extremes(position_steps)
        self._turning_s.append(t_s[extremes[1:]])
        bounds = [0, *extremes.tolist()]  # the empty first run makes steps if the start is beyond a threshold
        runs = (self._run(t_s, position_steps, first, last) for first, last in pairwise(bounds))
        return [run for run in runs if run is not None]

    def keep(self, time_s: FloatArray, signs: Int8Array, speeds_hz: FloatArray) -> None:
        """Store solved crossings."""
        self._solved.append((time_s, signs, speeds_hz))

    def steps(self) -> IdealSteps:
        """Return all steps found."""
        time_s, signs, speeds_hz = (np.concatenate(parts) for parts in zip(*self._solved, strict=True))
        return IdealSteps(self._start_steps, time_s, signs, speeds_hz, np.concatenate(self._turning_s))

    def _run(self, t_s: FloatArray, position_steps: FloatArray, first: int, last: int) -> _Brackets | None:
        """Return the crossings in the monotone run of samples from first to last, both included; None if none."""
        distance_steps = float(position_steps[last]) - self._counter
        if abs(distance_steps) < THRESHOLD_STEPS:
            return None
        sign = 1 if distance_steps > 0.0 else -1
        count = floor(abs(distance_steps) - THRESHOLD_STEPS) + 1
        thresholds_steps = self._counter + sign * (THRESHOLD_STEPS + np.arange(count, dtype=np.float64))
        self._counter += sign * count
        passed = np.searchsorted(sign * position_steps[first : last + 1], sign * thresholds_steps)
        high = np.minimum(first + passed, last)
        low = np.maximum(high - 1, first)
        return _Brackets(
            np.full(count, self._axis),
            np.full(count, sign, np.int8),
            thresholds_steps,
            t_s[low],
            t_s[high],
            position_steps[low],
            position_steps[high],
        )


def ideal_steps(motion: Motion, steps_per_unit: FloatArray, start_steps: tuple[int, ...]) -> tuple[IdealSteps, ...]:
    """Return the ideal steps of every axis, with instants exact to 0.1 ns.

    Args:
        motion: the planned motion.
        steps_per_unit: shape (joints,), steps per mm or degree; a negative value reverses the count.
        start_steps: counter of each axis at t = 0. If it is beyond a threshold from the planned start, its steps are
            made at t = 0.

    Raises:
        InputError: the motion takes more than CROSSINGS_MAX steps.
        ValueError: a planned position is not finite.
    """
    counters = [_AxisCounter(axis, start) for axis, start in enumerate(start_steps)]
    passed = 0.0
    for grid_s in _grids(motion.duration_s):
        parts = [_NO_BRACKETS]
        samples = _samples(motion, steps_per_unit, grid_s)
        for name, counter, (t_s, position_steps) in zip(motion.joint_names, counters, samples, strict=True):
            passed += counter.passes(position_steps)
            if passed > CROSSINGS_MAX:
                raise InputError(f"{name}: from its count at the start, the plan takes more than {CROSSINGS_MAX} steps")
            parts += counter.follow(t_s, position_steps)
        brackets = _Brackets.joined(parts)
        time_s, speeds_hz = _solve(motion, steps_per_unit, brackets)
        for axis, counter in enumerate(counters):
            own = brackets.axis == axis
            counter.keep(time_s[own], brackets.signs[own], speeds_hz[own])
    return tuple(counter.steps() for counter in counters)


def _grids(duration_s: float) -> Iterator[FloatArray]:
    """Yield the sample times in chunks; each chunk begins with the last time of the previous one."""
    samples = max(1, ceil(duration_s * SAMPLES_PER_SECOND))
    for first in range(0, samples, SAMPLES_PER_CHUNK):
        last = min(first + SAMPLES_PER_CHUNK, samples)
        yield np.minimum(np.arange(first, last + 1) / SAMPLES_PER_SECOND, duration_s)


def _samples(motion: Motion, steps_per_unit: FloatArray, grid_s: FloatArray) -> Iterator[tuple[FloatArray, FloatArray]]:
    """Yield for each axis the times and positions in steps, on the grid and at the turning points between its times."""
    position_steps, velocity_hz = (values * steps_per_unit for values in motion.states(grid_s))
    _check_finite(motion, grid_s, position_steps)
    cell, axis = _turning_cells(velocity_hz)

    def velocity_at(t_s: FloatArray, which: IndexArray) -> FloatArray:
        return _pick(motion.velocities(t_s) * steps_per_unit, axis[which])

    turning_s = bracketed_roots(
        velocity_at,
        grid_s[cell],
        grid_s[cell + 1],
        velocity_hz[cell, axis],
        velocity_hz[cell + 1, axis],
        TIME_TOLERANCE_S,
    )
    turning_steps = _pick(motion.positions(turning_s) * steps_per_unit, axis)
    for j in range(len(steps_per_unit)):
        own = axis == j
        where = cell[own] + 1
        yield (
            np.insert(grid_s, where, turning_s[own]),
            np.insert(position_steps[:, j], where, turning_steps[own]),
        )


def _check_finite(motion: Motion, grid_s: FloatArray, position_steps: FloatArray) -> None:
    bad = np.argwhere(~np.isfinite(position_steps))
    if len(bad):
        sample, axis = bad[0]
        value, name = position_steps[sample, axis], motion.joint_names[axis]
        raise ValueError(f"planned position of {name} is {value} at {grid_s[sample]:g} s")


def _turning_cells(velocity_hz: FloatArray) -> tuple[IndexArray, IndexArray]:
    """Return cell (index of the sample before) and axis of every turning point; velocity_hz: shape (samples, axes)."""
    before, after = velocity_hz[:-1], velocity_hz[1:]
    overshoot_steps = np.minimum(np.abs(before), np.abs(after)) / SAMPLES_PER_SECOND
    cell, axis = np.nonzero((before * after < 0.0) & (overshoot_steps > NEGLIGIBLE_OVERSHOOT_STEPS))
    return cell, axis


def _extremes(position_steps: FloatArray) -> IndexArray:
    """Return the indices of the first sample, each turning point and the last: samples between two are monotone."""
    slopes = np.sign(np.diff(position_steps))
    moving = np.flatnonzero(slopes)
    turning = moving[:-1][slopes[moving[:-1]] != slopes[moving[1:]]] + 1
    return np.concatenate(([0], turning, [len(position_steps) - 1]))


def _solve(motion: Motion, steps_per_unit: FloatArray, brackets: _Brackets) -> tuple[FloatArray, FloatArray]:
    """Return instant and speed of every crossing."""
    time_s = np.empty(len(brackets.axis))
    speeds_hz = np.empty(len(brackets.axis))
    for first in range(0, len(time_s), CROSSINGS_PER_CHUNK):
        part = slice(first, first + CROSSINGS_PER_CHUNK)
        time_s[part], speeds_hz[part] = _solve_part(motion, steps_per_unit, brackets[part])
    return time_s, speeds_hz


def _solve_part(motion: Motion, steps_per_unit: FloatArray, brackets: _Brackets) -> tuple[FloatArray, FloatArray]:
    def distance_at(t_s: FloatArray, which: IndexArray) -> FloatArray:
        position_steps = _pick(motion.positions(t_s) * steps_per_unit, brackets.axis[which])
        return position_steps - brackets.thresholds_steps[which]

    time_s = bracketed_roots(
        distance_at,
        brackets.low_s,
        brackets.high_s,
        brackets.low_steps - brackets.thresholds_steps,
        brackets.high_steps - brackets.thresholds_steps,
        TIME_TOLERANCE_S,
    )
    return time_s, np.abs(_pick(motion.velocities(time_s) * steps_per_unit, brackets.axis))


def _pick(values: FloatArray, axis: IndexArray) -> FloatArray:
    """Return from each row of values, shape (n, axes), the value of the row's own axis, shape (n,)."""
    picked: FloatArray = values[np.arange(len(axis)), axis]
    return picked
