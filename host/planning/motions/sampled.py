"""Motions through given points: the clamped C2 spline, Akima's spline, cubics through given velocities, blended lines.

The C2 spline has continuous acceleration, but overshoots at sudden changes. Akima's spline does not overshoot, but its
acceleration jumps at the points (H. Akima, "A new method of interpolation and smooth curve fitting based on local
procedures", J. ACM 17(4), 1970). Both begin and end at rest, as every motion must.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from math import sqrt
from typing import TYPE_CHECKING, Final, Literal, overload

import numpy as np
import scipy

from steptwin.host.common.arrays import FloatArray, Int64Array
from steptwin.host.common.bad_input import whole_ms
from steptwin.host.common.errors import InputError
from steptwin.host.planning.motion import JointLaw, Motion

if TYPE_CHECKING:
    from scipy.interpolate import PPoly

AKIMA_POINTS_MIN: Final = 3

_GAP_MIN_S: Final = 1e-6
"""Shortest time between two points: with a shorter one, a slope could exceed the range of floats."""


_END_CONDITIONS: Final[dict[bool, Literal["clamped", "not-a-knot"]]] = {True: "clamped", False: "not-a-knot"}
"""Boundary condition of the spline at an end, by whether it is at rest."""


@dataclass(frozen=True, slots=True, eq=False)
class Spline(JointLaw):
    """A piecewise cubic curve of all joints.

    Attributes:
        curve: curve from seconds to joint positions of shape (joints,), in mm and degrees.
    """

    curve: "PPoly"

    @classmethod
    def hermite(cls, times_s: FloatArray, positions: FloatArray, velocities: FloatArray) -> "Spline":
        """Return the cubics through points, of shape (points, joints), with velocities of that shape."""
        return cls(scipy.interpolate.CubicHermiteSpline(times_s, positions, velocities))

    @property
    def knots_s(self) -> FloatArray:
        """Times at which its cubics begin and end."""
        return np.asarray(self.curve.x)

    def positions(self, t_s: FloatArray) -> FloatArray:
        """Return joint positions, of shape (n, joints)."""
        return np.asarray(self.curve(t_s))

    def velocities(self, t_s: FloatArray) -> FloatArray:
        """Return joint velocities, of shape (n, joints)."""
        return np.asarray(self.curve(t_s, 1))

    def accelerations(self, t_s: FloatArray) -> FloatArray:
        """Return joint accelerations, of shape (n, joints)."""
        return np.asarray(self.curve(t_s, 2))

    def smooth_ms(self) -> frozenset[int]:
        """Return the inner knots, in milliseconds, at which the acceleration is almost continuous."""
        inner_s = self.knots_s[1:-1]
        before, after = self.accelerations(inner_s - _JUST_S), self.accelerations(inner_s + _JUST_S)
        most = np.maximum(np.abs(before), np.abs(after)).max(axis=0, initial=0.0)
        smooth = (np.abs(after - before) <= _SMOOTH * most).all(axis=1)
        return frozenset(np.rint(1000.0 * inner_s[smooth]).astype(np.int64).tolist())


_SMOOTH: Final = 0.03
"""Fraction of the highest acceleration that counts as almost continuous.

A jump by it, 1 ms beside a PVT point, causes an error of 0.0015 step at 100 000 steps/s^2.
"""
_JUST_S: Final = 1e-7
"""Time before and after a jump at which the accelerations are compared."""


def c2_spline(
    joint_names: tuple[str, ...],
    times_s: FloatArray,
    positions: FloatArray,
    at_rest: tuple[bool, bool] = (True, True),
) -> Motion:
    """Return the C2 spline through positions of shape (points, joints) at times that pass `check_times`.

    `at_rest` tells for start and end whether the motion is at rest there. If not, the two outermost pieces are one
    cubic (`not-a-knot`).
    """
    check_times(times_s)
    start, end = (_END_CONDITIONS[rest] for rest in at_rest)
    curve = scipy.interpolate.CubicSpline(times_s, positions, bc_type=(start, end))
    return Motion(joint_names, float(curve.x[-1]), Spline(curve))


def akima_spline(joint_names: tuple[str, ...], times_s: FloatArray, positions: FloatArray) -> Motion:
    """Return Akima's spline through 3 or more points at whole milliseconds, with slopes of 0 at both ends."""
    if len(times_s) < AKIMA_POINTS_MIN:
        raise InputError(f"{len(times_s)} points: Akima's spline takes at least {AKIMA_POINTS_MIN}")
    check_times(times_s)
    slopes = np.asarray(scipy.interpolate.Akima1DInterpolator(times_s, positions)(times_s, 1))
    slopes[[0, -1]] = 0.0
    return hermite_spline(joint_names, times_s, positions, slopes)


def hermite_spline(
    joint_names: tuple[str, ...], times_s: FloatArray, positions: FloatArray, velocities: FloatArray
) -> Motion:
    """Return the cubics through points at whole milliseconds with velocities of shape (points, joints)."""
    check_times(times_s, all_whole_ms=True)
    return along_cubics(joint_names, Spline.hermite(times_s, positions, velocities))


def along_cubics(joint_names: tuple[str, ...], spline: Spline) -> Motion:
    """Return the motion along cubics whose knots are whole milliseconds; the acceleration may jump at each."""
    knots_s = spline.knots_s
    inner_s = tuple((np.rint(1000.0 * knots_s[1:-1]) / 1000.0).tolist())
    return Motion(joint_names, float(knots_s[-1]), spline, inner_s, spline.smooth_ms())


@dataclass(frozen=True, slots=True)
class NumberedPlaces(Sequence[str]):
    """Names of points in messages: a text with the point's number, created on demand."""

    text: str
    numbers: Sequence[int]

    @overload
    def __getitem__(self, i: int) -> str: ...

    @overload
    def __getitem__(self, i: slice) -> "NumberedPlaces": ...

    def __getitem__(self, i: int | slice) -> "str | NumberedPlaces":
        chosen = self.numbers[i]
        return self.text.format(chosen) if isinstance(chosen, int) else NumberedPlaces(self.text, chosen)

    def __len__(self) -> int:
        return len(self.numbers)


def check_times(times_s: FloatArray, places: Sequence[str] = (), *, all_whole_ms: bool = False) -> None:
    """Raise InputError if points at these times are no motion; messages name the times by `places`.

    There must be at least 2 times, all finite. They begin at 0 and increase. The last time, or with `all_whole_ms`
    every time, must be a whole millisecond.
    """
    if len(times_s) < 2:
        raise InputError(f"{len(times_s)} points: a motion takes at least 2")
    places = places or NumberedPlaces("the time of point {}", range(1, len(times_s) + 1))
    finite = np.isfinite(times_s)
    if not finite.all():
        i = int(np.argmin(finite))
        raise InputError(f"{places[i]}: {times_s[i]:g} s is not finite")
    if times_s[0] != 0.0:
        raise InputError(f"{places[0]}: {times_s[0]:.9g} s, but the first point is at 0 s")
    increasing = np.diff(times_s) >= _GAP_MIN_S
    if not increasing.all():
        i = int(np.argmin(increasing))
        raise InputError(
            f"{places[i + 1]}: {times_s[i + 1]:.9g} s is not at least 1 us after"
            f" the {times_s[i]:.9g} s of the point before"
        )
    times_ms = 1000.0 * times_s
    for i in np.flatnonzero(times_ms != np.rint(times_ms)).tolist() if all_whole_ms else [len(times_s) - 1]:
        whole_ms(places[i], float(times_s[i]))


_SLACK: Final = 1e-9
"""Time in ms by which a blend may be too short; otherwise a rounding error would add 1 ms to round times."""
_GAP_MIN_MS: Final = 2
"""Shortest time between two points: one millisecond for the blend of each."""
ChangeTimes = Callable[[FloatArray], FloatArray]
"""Returns the shortest times in seconds, of shape (n,), of velocity changes of shape (n, joints)."""


def blended_lines(
    change_times_s: ChangeTimes,
    joint_names: tuple[str, ...],
    times_s: FloatArray,
    positions: FloatArray,
    at_rest: tuple[bool, bool] = (True, True),
) -> Motion:
    """Return the motion along the lines through positions of shape (points, joints) at times in whole milliseconds.

    `change_times_s` determines the blends, by the robot's accelerations. Two blends that would overlap share the time
    between their points in proportion. The motion then exceeds these accelerations; the planner refuses it and names
    the stretch factor that is possible. `at_rest` tells whether the motion starts and ends at rest; if not, it starts
    or ends at the speed of the outermost line.

    In a blend the velocity changes linearly between the velocities of two lines, around the time of the point. So the
    motion passes the point at a distance of |dv| T / 8, where T is the duration of the blend and dv the change. Each
    blend is as short as the joints' accelerations allow, and equal for all joints, so they leave the lines together.
    At a start or end at rest the blend is within the motion, and its line is correspondingly faster.


    Source: J. J. Craig, "Introduction to Robotics: Mechanics and Control", section 7.3, "linear function with parabolic
    blends for a path with via points", with one time for all joints.

    Raises:
        InputError: times as `check_times` refuses them, or 1 ms between two points.
    """
    check_times(times_s, all_whole_ms=True)
    times_ms = np.rint(1000.0 * times_s).astype(np.int64)
    dt_ms = np.diff(times_ms)
    if (dt_ms < _GAP_MIN_MS).any():
        i = int(np.argmax(dt_ms < _GAP_MIN_MS))
        raise InputError(
            f"the points at {times_s[i]:.9g} s and {times_s[i + 1]:.9g} s are 1 ms apart:"
            f" lines with blends take at least {_GAP_MIN_MS} ms"
        )
    reach_ms = _fitting_ms(_reach_ms(times_ms, positions, change_times_s, at_rest), dt_ms)
    corners_ms, half_ms = _corners_ms(times_ms, reach_ms, at_rest)
    before, after = _velocities_per_ms(corners_ms, positions, at_rest)
    half = half_ms[:, np.newaxis]
    ends_ms = np.rint(np.concatenate([corners_ms - half_ms, corners_ms + half_ms])).astype(np.int64)
    nodes_ms, chosen = np.unique(ends_ms, return_index=True)  # pieces: lines and parabolas
    places = np.concatenate([positions - before * half, positions + after * half])[chosen]
    velocities = 1000.0 * np.concatenate([before, after])[chosen]
    return hermite_spline(joint_names, nodes_ms / 1000, places, velocities)


def _corners_ms(
    times_ms: Int64Array, reach_ms: Int64Array, at_rest: tuple[bool, bool]
) -> tuple[FloatArray, FloatArray]:
    """Return the middle and half of the duration of each blend, both of shape (points,).

    A blend is symmetric to its point. At rest it is on one side, with its middle at half its reach.
    """
    corners_ms, half_ms = times_ms.astype(np.float64), reach_ms.astype(np.float64)
    for end, inwards, rests in ((0, 1, at_rest[0]), (-1, -1, at_rest[1])):
        if rests:
            half_ms[end] /= 2.0
            corners_ms[end] += inwards * half_ms[end]
    return corners_ms, half_ms


def _velocities_per_ms(
    corners_ms: FloatArray, positions: FloatArray, at_rest: tuple[bool, bool]
) -> tuple[FloatArray, FloatArray]:
    """Return the velocities before and after each blend, both of shape (points, joints)."""
    lines = np.diff(positions, axis=0) / np.diff(corners_ms)[:, np.newaxis]
    rest = np.zeros((1, positions.shape[1]))
    before = np.concatenate([rest if at_rest[0] else lines[:1], lines])
    after = np.concatenate([lines, rest if at_rest[1] else lines[-1:]])
    return before, after


def _reach_ms(
    times_ms: Int64Array, positions: FloatArray, change_times_s: ChangeTimes, at_rest: tuple[bool, bool]
) -> Int64Array:
    """Return the time, in whole ms, that each blend needs in the lines beside its point, of shape (points,)."""
    reach_ms = np.zeros(len(times_ms), dtype=np.int64)
    both_ends = len(times_ms) == 2 and all(at_rest)
    for point, other, rests in ((0, 1, at_rest[0]), (-1, -2, at_rest[1])):
        if rests:
            dt_ms = float(abs(times_ms[other] - times_ms[point]))
            way = (positions[other] - positions[point])[np.newaxis]
            change_ms2 = 1e6 * float(change_times_s(way)[0])
            reach_ms[point] = _rounded_up(_reach_at_rest_ms(dt_ms, change_ms2, both_ends=both_ends))
    corners_ms, _ = _corners_ms(times_ms, reach_ms, at_rest)
    before, after = _velocities_per_ms(corners_ms, positions, at_rest)
    reach_ms[1:-1] = _rounded_up(1e6 * change_times_s(after - before)[1:-1] / 2.0)
    return reach_ms


def _reach_at_rest_ms(dt_ms: float, change_ms2: float, *, both_ends: bool) -> float:
    """Return the shortest duration r of a line's blend at rest, at most the line's time, or half of it for two blends.

    The line's speed is its distance divided by dt - r / 2, or by dt - r with such a blend at both ends; the
    acceleration is speed / r. `change_ms2` is the distance divided by the highest acceleration.
    """
    if both_ends:
        return (dt_ms - sqrt(max(0.0, dt_ms**2 - 4.0 * change_ms2))) / 2.0
    return dt_ms - sqrt(max(0.0, dt_ms**2 - 2.0 * change_ms2))


def _fitting_ms(reach_ms: Int64Array, dt_ms: Int64Array) -> Int64Array:
    """Return the reaches, cut where two of them would overlap."""
    first, second = reach_ms[:-1], reach_ms[1:]
    total_ms = first + second
    fitting_ms = reach_ms.copy()
    for own_ms, cut_ms in ((first, fitting_ms[:-1]), (second, fitting_ms[1:])):
        share_ms = np.maximum(dt_ms * own_ms // np.maximum(total_ms, 1), 1)
        np.minimum(cut_ms, share_ms, out=cut_ms, where=total_ms > dt_ms)
    return fitting_ms


def _rounded_up(time_ms: FloatArray | float) -> Int64Array:
    return np.ceil(np.asarray(time_ms) - _SLACK).astype(np.int64)
