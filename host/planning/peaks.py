"""The highest speed, acceleration and step rate of each joint in a motion, with their limits."""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from enum import StrEnum
from math import floor, sqrt
from typing import Final, NamedTuple

import numpy as np

from steptwin.host.common.arrays import FloatArray, Int64Array
from steptwin.host.common.errors import InputError
from steptwin.host.common.planning_time import check_planning_time
from steptwin.host.planning.motion import Motion
from steptwin.host.robots.joint import Joint
from steptwin.host.robots.robot import Robot

LONGEST_MS: Final = 3_600_000
"""Longest motion, an hour: each millisecond is examined, which takes time in proportion."""
WINDOW_MS: Final = 1 << 17
"""Part of a motion that is examined at once, some two minutes; bounds the memory."""


class TooLongError(InputError):
    """A motion lasts more than LONGEST_MS."""


def check_length(what: str, duration_ms: int) -> None:
    """Raise TooLongError, with `what` in front, for more than LONGEST_MS."""
    if duration_ms > LONGEST_MS:
        raise TooLongError(f"{what} lasts {duration_ms / 1000:.9g} s, more than an hour, {LONGEST_MS // 1000} s")


class Samples(NamedTuple):
    """A window of a motion, each millisecond of it: times of shape (n,), the rest of shape (n, joints)."""

    t_s: FloatArray
    positions: FloatArray
    velocities: FloatArray

    def row(self, i: int) -> "Samples":
        """Return one millisecond as a copy, which does not keep the window in memory."""
        return self.rows(np.array([i]))

    def rows(self, chosen: Int64Array) -> "Samples":
        """Return selected milliseconds as copies."""
        return Samples(self.t_s[chosen], self.positions[chosen], self.velocities[chosen])

    def followed_by(self, later: "Samples") -> "Samples":
        """Return these samples and later ones."""
        return Samples(*(np.concatenate(pair) for pair in zip(self, later, strict=True)))


def sampled(motion: Motion) -> Iterator[Samples]:
    """Yield a motion in windows; each begins with the last millisecond of the one before."""
    for times_ms in windows_ms(round(1000 * motion.duration_s)):
        t_s = times_ms / 1000
        yield Samples(t_s, *motion.states(t_s))


def shifted(windows: Iterable[Samples], from_s: float) -> Iterator[Samples]:
    """Yield a part's windows with the motion's times; the part begins at `from_s`."""
    for samples in windows:
        yield samples._replace(t_s=samples.t_s + from_s)


def windows_ms(end_ms: int) -> Iterator[Int64Array]:
    """Yield all milliseconds from 0 to an end in windows; each begins with the last one of the window before.

    Raises TooLongError at once for an end after LONGEST_MS.
    """
    check_length("the motion", end_ms)
    for begin_ms in range(0, end_ms, WINDOW_MS):
        check_planning_time()
        yield np.arange(begin_ms, min(begin_ms + WINDOW_MS, end_ms) + 1)


_ROUNDING: Final = 1e-9
"""Largest rounding error beyond a limit of speed or acceleration, as a fraction of it."""
_Q16: Final = 1 << 16
_RECORDS_AT_ONCE: Final = 1 << 15
"""Number of PVT records with step rates computed at once; bounds the memory."""


class Quantity(StrEnum):
    """A quantity with a limit."""

    SPEED = "speed"
    ACCELERATION = "mean acceleration over 1 ms"
    AXIS_SPEED = "axis speed"
    AXIS_ACCELERATION = "mean axis acceleration over 1 ms"
    STEP_RATE = "step rate"


@dataclass(frozen=True, slots=True)
class Peak:
    """Highest value of a quantity at a joint, with its time.

    Attributes:
        quantity: quantity that has the peak.
        joint: name of the joint.
        value: size of the peak, in `unit`.
        limit: limit of the size, in `unit`.
        unit: unit of value and limit.
        t_s: time of the peak; for a step rate, the start of its PVT record.
    """

    quantity: Quantity
    joint: str
    value: float
    limit: float
    unit: str
    t_s: float

    @property
    def percent(self) -> float:
        """The peak as percentage of its limit."""
        return 100.0 * self.value / self.limit

    @property
    def stretch(self) -> float:
        """Factor, at least 1, on the duration that puts the peak at its limit."""
        ratio = max(1.0, self.value / self.limit)
        return sqrt(ratio) if self.quantity in (Quantity.ACCELERATION, Quantity.AXIS_ACCELERATION) else ratio

    @property
    def exceeded(self) -> bool:
        """True if the peak exceeds its limit: by more than rounding errors, or for a step rate at all.

        The firmware compares step rates as integers, so the planner must not accept more than the firmware.
        """
        return self.value > self.limit * (1.0 if self.quantity is Quantity.STEP_RATE else 1.0 + _ROUNDING)


def highest(found: Iterable[Iterable[Peak]]) -> tuple[Peak, ...]:
    """Return the highest peak of each quantity over all windows; the first of equal ones."""
    return tuple(max(of_one, key=lambda peak: peak.value) for of_one in zip(*found, strict=True))


def speed_peaks(robot: Robot, samples: Samples) -> Iterator[Peak]:
    """Yield a window's peaks of speed and acceleration, joint by joint, then those of coupled axes.

    The acceleration is the mean over each interval of the grid, where it does not jump.
    """
    velocities = _with_axes(robot, samples.velocities)
    for joint, column, limits in _limited(robot):
        yield from _peaks(joint, samples.t_s, velocities[:, column], limits)


_Limits = tuple[tuple[Quantity, float], ...]
"""Quantities of speed and of acceleration, each with its limit."""
_RATES: Final = ("s", "s^2")
"""Denominators of their units."""


def _with_axes(robot: Robot, joints: FloatArray) -> FloatArray:
    """Return values of the joints, of shape (n, joints), with those of the axes if any are coupled."""
    return np.concatenate([joints, robot.coupling.to_axes(joints)], axis=1) if robot.coupling.matrix else joints


def _limited(robot: Robot) -> Iterator[tuple[Joint, int, _Limits]]:
    """Yield each joint, then each coupled axis, with the column of its values and with its limits."""
    for i, joint in enumerate(robot.joints):
        yield joint, i, ((Quantity.SPEED, joint.speed_max), (Quantity.ACCELERATION, joint.acceleration_max))
    axis_limits = list(zip(robot.axis_speeds_max.tolist(), robot.axis_accelerations_max.tolist(), strict=True))
    for i, joint in enumerate(robot.joints):  # second motors move like the first ones
        if robot.coupling.couples(i):
            speed_max, acceleration_max = axis_limits[i]
            limits = ((Quantity.AXIS_SPEED, speed_max), (Quantity.AXIS_ACCELERATION, acceleration_max))
            yield joint, len(robot.joints) + i, limits


def _peaks(joint: Joint, t_s: FloatArray, velocities: FloatArray, limits: _Limits) -> Iterator[Peak]:
    """Yield the peaks of a speed and of its acceleration; `limits` has both in this order."""
    accelerations = np.diff(velocities) / np.diff(t_s)
    for values, (quantity, limit), unit in zip((velocities, accelerations), limits, _RATES, strict=True):
        sizes = np.abs(values)
        worst = int(np.argmax(sizes))
        yield Peak(quantity, joint.name, float(sizes[worst]), limit, f"{joint.unit}/{unit}", float(t_s[worst]))


_BETWEEN_POINTS: Final = 5e-4
"""Fraction of a limit by which a cubic between two points may exceed it: a motion at its limit is no cubic."""


def excess_between_points(robot: Robot, points: Samples) -> Iterator[Peak]:
    """Yield the peaks beyond a limit of the cubics between a motion's points, which the board executes.

    A motion keeps its limits in each millisecond, and so do its cubics, unless its acceleration jumps between two
    points. A cubic's acceleration is linear, so its mean over 1 ms is highest in the first or in the last one.
    """
    if len(points.t_s) < 2:
        return
    with np.errstate(over="ignore", invalid="ignore"):  # speeds far beyond their limits are refused anyway
        yield from _excess(robot, *points)


def _excess(robot: Robot, t_s: FloatArray, positions: FloatArray, velocities: FloatArray) -> Iterator[Peak]:
    dt_s = np.diff(t_s)[:, np.newaxis]
    places, speeds = _with_axes(robot, positions), _with_axes(robot, velocities)
    begin, end, chord = speeds[:-1], speeds[1:], (places[1:] - places[:-1]) / dt_s
    first, last = (6 * chord - 4 * begin - 2 * end) / dt_s, (4 * end + 2 * begin - 6 * chord) / dt_s
    jerk = (last - first) / dt_s
    mean = np.maximum(abs(first + 0.0005 * jerk), abs(last - 0.0005 * jerk))
    turns = first * last < 0.0  # where the acceleration is 0, the speed is highest
    inner = np.where(turns, abs(begin - first**2 / np.where(turns, 2.0 * jerk, 1.0)), 0.0)
    at = [(sizes.argmax(axis=0).tolist(), sizes.max(axis=0).tolist()) for sizes in (inner, mean)]
    for joint, column, limits in _limited(robot):
        for (rows, sizes), (quantity, limit), unit in zip(at, limits, _RATES, strict=True):
            if sizes[column] > limit * (1.0 + _BETWEEN_POINTS):
                at_s = float(t_s[rows[column]])
                yield Peak(quantity, joint.name, sizes[column], limit, f"{joint.unit}/{unit}", at_s)


def step_rate_peaks(robot: Robot, times_ms: Int64Array, points: FloatArray, velocities: FloatArray) -> tuple[Peak, ...]:
    """Return the peaks of the step rates, in Hz, as the firmware bounds them for each PVT record.

    `points` are whole wire units and `velocities` whole 1/64 units per ms, both of shape (points, joints) and within
    the widths of PVT records. The firmware's limit is in Q16 steps per ms.
    """
    parts = (slice(begin, begin + _RECORDS_AT_ONCE + 1) for begin in range(0, len(times_ms) - 1, _RECORDS_AT_ONCE))
    return highest(_step_rate_peaks(robot, times_ms[part], points[part], velocities[part]) for part in parts)


def _step_rate_peaks(robot: Robot, times_ms: Int64Array, points: FloatArray, velocities: FloatArray) -> Iterator[Peak]:
    dt_ms = np.diff(times_ms)[:, np.newaxis]
    hulls_q16 = _velocity_hulls_q16(robot, dt_ms, points.astype(np.int64), velocities.astype(np.int64))
    rates_hz = hulls_q16 * (1000 / _Q16) / dt_ms
    limit_hz = floor(robot.board.driver_rate_max_hz * _Q16 / 1000) * 1000 / _Q16
    for i, joint in enumerate(robot.joints):  # second motors make the steps of the first ones
        worst = int(np.argmax(rates_hz[:, i]))
        at_s = float(times_ms[worst]) / 1000
        yield Peak(Quantity.STEP_RATE, joint.name, float(rates_hz[worst, i]), limit_hz, "Hz", at_s)


def _velocity_hulls_q16(robot: Robot, dt_ms: Int64Array, points: Int64Array, velocities: Int64Array) -> Int64Array:
    """Return a bound of each cubic's velocity, of shape (segments, joints), in Q16 steps per segment duration.

    With the displacement D, a = v0 dt and e = v1 dt, the velocity is a quadratic with the Bernstein coefficients a,
    3D - a - e and e. Its size nowhere exceeds the largest of theirs. Rounding is the firmware's.
    """
    microsteps = np.array([joint.transmission.microsteps for joint in robot.axes])
    distance = np.diff(points, axis=0) * microsteps << 2
    a = velocities[:-1] * dt_ms * microsteps + 8 >> 4
    e = velocities[1:] * dt_ms * microsteps + 8 >> 4
    hulls: Int64Array = np.maximum.reduce([np.abs(a), np.abs(3 * distance - a - e), np.abs(e)])
    return hulls
