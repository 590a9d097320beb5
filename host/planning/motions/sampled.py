"""Motions through given points: the clamped C2 spline, Akima's spline, and cubics through given velocities.

The C2 spline has continuous acceleration, but overshoots beside sudden changes. Akima's spline does not overshoot, but
its acceleration jumps at the points (H. Akima, "A new method of interpolation and smooth curve fitting based on local
procedures", J. ACM 17(4), 1970). Both begin and end at rest, as every motion must.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Final, Literal, Self, overload

import numpy as np
import scipy

from steptwin.host.common.arrays import FloatArray
from steptwin.host.common.bad_input import whole_ms
from steptwin.host.common.errors import InputError
from steptwin.host.planning.trajectory import Switching

if TYPE_CHECKING:
    from scipy.interpolate import PPoly

AKIMA_POINTS_MIN: Final = 3

_GAP_MIN_S: Final = 1e-6
"""Least time between two points: over a shorter one a slope could exceed the range of floats."""


_END_CONDITIONS: Final[dict[bool, Literal["clamped", "not-a-knot"]]] = {True: "clamped", False: "not-a-knot"}
"""The spline's condition at an end that is at rest, and at another."""


@dataclass(frozen=True, slots=True, eq=False)
class Sampled:
    """A motion of all joints along a piecewise cubic curve; implements Trajectory.

    Attributes:
        joint_names: names of the robot's joints.
        curve: curve from seconds to joint positions of shape (joints,), in mm and degrees.
        breakpoints_s: times when the acceleration jumps.
        switchings: changes of outputs during the motion.
    """

    joint_names: tuple[str, ...]
    curve: "PPoly"
    breakpoints_s: tuple[float, ...]
    switchings: tuple[Switching, ...] = ()

    @classmethod
    def c2_spline(
        cls,
        joint_names: tuple[str, ...],
        times_s: FloatArray,
        positions: FloatArray,
        at_rest: tuple[bool, bool] = (True, True),
    ) -> Self:
        """Return the C2 spline through positions of shape (points, joints) at times as `check_times` requires them.

        `at_rest` tells for start and end whether the motion is at rest there, as every motion must be in the end;
        otherwise it goes on as the points do: the two outermost pieces are one cubic (`not-a-knot`).
        """
        check_times(times_s)
        start, end = (_END_CONDITIONS[rest] for rest in at_rest)
        return cls(joint_names, scipy.interpolate.CubicSpline(times_s, positions, bc_type=(start, end)), ())

    @classmethod
    def akima(cls, joint_names: tuple[str, ...], times_s: FloatArray, positions: FloatArray) -> Self:
        """Return Akima's spline through 3 or more points at whole milliseconds, with slopes of 0 at both ends."""
        if len(times_s) < AKIMA_POINTS_MIN:
            raise InputError(f"{len(times_s)} points: Akima's spline takes at least {AKIMA_POINTS_MIN}")
        check_times(times_s)
        slopes = np.asarray(scipy.interpolate.Akima1DInterpolator(times_s, positions)(times_s, 1))
        slopes[[0, -1]] = 0.0
        return cls.hermite(joint_names, times_s, positions, slopes)

    @classmethod
    def hermite(
        cls, joint_names: tuple[str, ...], times_s: FloatArray, positions: FloatArray, velocities: FloatArray
    ) -> Self:
        """Return the cubics through points at whole milliseconds with velocities of shape (points, joints)."""
        check_times(times_s, all_whole_ms=True)
        inner_s = tuple(round(1000 * t_s) / 1000 for t_s in times_s[1:-1].tolist())
        return cls(joint_names, scipy.interpolate.CubicHermiteSpline(times_s, positions, velocities), inner_s)

    @property
    def duration_s(self) -> float:
        """Time of the last point."""
        return float(self.curve.x[-1])

    def positions(self, t_s: FloatArray) -> FloatArray:
        """Return joint positions, of shape (n, joints)."""
        return np.asarray(self.curve(t_s))

    def velocities(self, t_s: FloatArray) -> FloatArray:
        """Return joint velocities, of shape (n, joints)."""
        return np.asarray(self.curve(t_s, 1))

    def accelerations(self, t_s: FloatArray) -> FloatArray:
        """Return joint accelerations, of shape (n, joints)."""
        return np.asarray(self.curve(t_s, 2))


@dataclass(frozen=True, slots=True)
class NumberedPlaces(Sequence[str]):
    """The places of points in their input, for messages: a text with the point's own number, made when asked for."""

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
    """Raise InputError unless points at these times can be a motion; messages name the times by `places`.

    There must be at least 2 times, all finite. They begin at 0 and rise. The last time, or with `all_whole_ms` every
    time, must be a whole millisecond.
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
