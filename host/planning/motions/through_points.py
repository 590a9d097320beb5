"""Make a motion through points without velocities: curves from rest to rest, and pauses where points repeat."""

from collections.abc import Callable
from collections.abc import Sequence as Texts
from itertools import groupby

import numpy as np

from steptwin.host.common.arrays import FloatArray
from steptwin.host.common.bad_input import whole_ms
from steptwin.host.planning.motions.sampled import Sampled
from steptwin.host.planning.motions.sequence import Pause, Sequence
from steptwin.host.planning.trajectory import Trajectory

Curve = Callable[[tuple[str, ...], FloatArray, FloatArray, tuple[bool, bool]], Sampled]
"""A function of joint names, times, positions and whether start and end are at rest, such as `Sampled.c2_spline`."""


def through_points(
    joint_names: tuple[str, ...],
    times_s: FloatArray,
    positions: FloatArray,
    places: Texts[str],
    curve: Curve = Sampled.c2_spline,
    at_rest: tuple[bool, bool] = (True, True),
) -> Sampled | Sequence:
    """Return curves through positions of shape (points, joints) at times of shape (points,).

    A point that repeats the previous one makes a pause, since a curve through both would overshoot there. Messages
    name the points' times by `places`. `at_rest` tells whether the first and the last point are at rest; where a pause
    begins or ends, the motion always is. Raise InputError as `check_times`, or if a pause is not in whole milliseconds.
    """
    stands = (np.diff(positions, axis=0) == 0.0).all(axis=1).tolist()
    if not any(stands):
        return curve(joint_names, times_s, positions, at_rest)
    parts: list[Trajectory] = []
    starts_ms = [0]
    for standing, group in groupby(range(len(stands)), key=stands.__getitem__):
        segments = list(group)
        first, last = segments[0], segments[-1] + 1
        whole_ms(places[last], float(times_s[last]))
        own_s = times_s[first : last + 1] - times_s[first]
        if standing:
            parts.append(Pause(joint_names, tuple(positions[first].tolist()), float(own_s[-1])))
        else:
            ends_at_rest = (first > 0 or at_rest[0], last < len(stands) or at_rest[1])
            parts.append(curve(joint_names, own_s, positions[first : last + 1], ends_at_rest))
        starts_ms.append(round(1000 * float(times_s[last])))
    return Sequence(joint_names, tuple(parts), tuple(starts_ms), ())
