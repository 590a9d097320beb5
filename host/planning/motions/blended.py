"""Straight lines in joint space from point to point, at constant speed, with parabolic blends around the points.

In a blend the velocity changes linearly from one line's to the next one's, around the point's time, so the motion
passes the point at a distance of |dv| T / 8, T being the blend's time and dv the change. Each blend is as short as the
joints' accelerations allow, and the same for all joints, so that these leave the lines together. At rest, at the
beginning and at the end, the blend lies within the motion, and its line is faster by as much.

Source: J. J. Craig, "Introduction to Robotics: Mechanics and Control", section 7.3, "linear function with parabolic
blends for a path with via points", with one time for all joints.
"""

from collections.abc import Callable
from math import sqrt
from typing import Final

import numpy as np

from steptwin.host.common.arrays import FloatArray, Int64Array
from steptwin.host.common.errors import InputError
from steptwin.host.planning.motions.sampled import Sampled, check_times

_SLACK: Final = 1e-9
"""Part of a millisecond by which a blend may be too short: a rounding error would lengthen round times by 1 ms."""

_GAP_MIN_MS: Final = 2
"""Least time between two points: one millisecond for each one's blend."""


ChangeTimes = Callable[[FloatArray], FloatArray]
"""A function from changes of velocity, of shape (n, joints), to the seconds that they take at least, of shape (n,)."""


def blended_lines(
    change_times_s: ChangeTimes,
    joint_names: tuple[str, ...],
    times_s: FloatArray,
    positions: FloatArray,
    at_rest: tuple[bool, bool] = (True, True),
) -> Sampled:
    """Return the motion along the lines through positions of shape (points, joints) at times in whole milliseconds.

    `change_times_s` determines the blends, by the robot's accelerations. Two blends that would overlap share the time
    between their points in proportion: the motion then exceeds these accelerations, which the planner refuses with the
    stretch that passes. `at_rest` tells whether the motion starts and ends at rest; otherwise it does so at the speed
    of the outermost line.

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
    nodes_ms, chosen = np.unique(ends_ms, return_index=True)  # the cubics between the blends' ends: lines, parabolas
    places = np.concatenate([positions - before * half, positions + after * half])[chosen]
    velocities = 1000.0 * np.concatenate([before, after])[chosen]
    return Sampled.hermite(joint_names, nodes_ms / 1000, places, velocities)


def _corners_ms(
    times_ms: Int64Array, reach_ms: Int64Array, at_rest: tuple[bool, bool]
) -> tuple[FloatArray, FloatArray]:
    """Return the middle and half of the time of each blend, both of shape (points,).

    A blend reaches as far to both sides of its point. At rest it lies on one side, with the middle at half its reach.
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
    """Return how far each blend must reach into the lines beside its point, of shape (points,), in whole ms."""
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
    """Return the least time r of the blend at rest for a line, at most all of its time, or half if it has two.

    The line's speed is its way over dt - r / 2, or over dt - r with such a blend at both ends, and speed / r is the
    acceleration. `change_ms2` is the way over the highest acceleration.
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
