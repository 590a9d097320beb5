"""Motions through given points: the clamped C2 spline, Akima's spline, and cubics through given velocities.

The C2 spline has continuous acceleration, but rings beside sudden changes; Akima's does not ring, but its acceleration
jumps at the points (H. Akima, "A new method of interpolation and smooth curve fitting based on local procedures",
J. ACM 17(4), 1970). Both begin and end at rest: a motion here always does.
"""

from dataclasses import dataclass
from typing import Final, Self

import numpy as np
from scipy.interpolate import Akima1DInterpolator, CubicHermiteSpline, CubicSpline, PPoly

from host.errors import InputError
from host.inputs import whole_ms
from host.trajectory import FloatArray, Switching

AKIMA_POINTS_MIN: Final = 3


@dataclass(frozen=True, slots=True, eq=False)
class Sampled:
    """All joints along a piecewise cubic curve; fulfils Trajectory.

    Attributes:
        joint_names: the robot's joints.
        curve: from seconds to joint positions, mm and degrees, shape (joints,).
        breakpoints_s: the points at which the acceleration jumps.
    """

    joint_names: tuple[str, ...]
    curve: PPoly
    breakpoints_s: tuple[float, ...]

    @classmethod
    def c2_spline(cls, joint_names: tuple[str, ...], times_s: FloatArray, positions: FloatArray) -> Self:
        """Through positions of shape (points, joints) at times of shape (points,), the acceleration continuous.

        Raises:
            InputError: times that do not begin at 0, do not increase, or do not end at a whole millisecond.
        """
        _check_times(times_s, positions)
        return cls(joint_names, CubicSpline(times_s, positions, bc_type="clamped"), ())

    @classmethod
    def akima(cls, joint_names: tuple[str, ...], times_s: FloatArray, positions: FloatArray) -> Self:
        """Through at least 3 points with Akima's slopes, but 0 at both ends; arguments as for `c2_spline`.

        Raises:
            InputError: as for `c2_spline`, and if a time in between is not a whole millisecond.
        """
        if len(times_s) < AKIMA_POINTS_MIN:
            raise InputError(f"{len(times_s)} points: Akima's spline takes at least {AKIMA_POINTS_MIN}")
        _check_times(times_s, positions)
        slopes = np.asarray(Akima1DInterpolator(times_s, positions)(times_s, 1))
        slopes[[0, -1]] = 0.0
        return cls.hermite(joint_names, times_s, positions, slopes)

    @classmethod
    def hermite(
        cls, joint_names: tuple[str, ...], times_s: FloatArray, positions: FloatArray, velocities: FloatArray
    ) -> Self:
        """Through points with given velocities of shape (points, joints); raises as `akima` does for times."""
        _check_times(times_s, positions)
        times_ms = [whole_ms(f"the time of point {i + 1}", t_s) for i, t_s in enumerate(times_s.tolist())]
        inner_s = tuple(ms / 1000 for ms in times_ms[1:-1])
        return cls(joint_names, CubicHermiteSpline(times_s, positions, velocities), inner_s)

    @property
    def duration_s(self) -> float:
        """The last point's time."""
        return float(self.curve.x[-1])

    @property
    def switchings(self) -> tuple[Switching, ...]:
        """None."""
        return ()

    def positions(self, t_s: FloatArray) -> FloatArray:
        """Joint positions, shape (n, joints)."""
        return np.asarray(self.curve(t_s))

    def velocities(self, t_s: FloatArray) -> FloatArray:
        """Joint velocities, shape (n, joints)."""
        return np.asarray(self.curve(t_s, 1))

    def accelerations(self, t_s: FloatArray) -> FloatArray:
        """Joint accelerations, shape (n, joints)."""
        return np.asarray(self.curve(t_s, 2))


def _check_times(times_s: FloatArray, positions: FloatArray) -> None:
    if len(times_s) < 2:
        raise InputError(f"{len(times_s)} points: a motion takes at least 2")
    if positions.shape[0] != len(times_s):
        raise ValueError(f"{len(times_s)} times, but positions of shape {positions.shape}")
    if times_s[0] != 0.0:
        raise InputError(f"the first point is at t = {times_s[0]:g} s instead of 0 s")
    increasing = np.diff(times_s) > 0
    if not increasing.all():
        i = int(np.argmin(increasing))
        raise InputError(
            f"the time of point {i + 2}: {times_s[i + 1]:g} s is not after the {times_s[i]:g} s of the point before"
        )
    whole_ms("the last point's time", float(times_s[-1]))
