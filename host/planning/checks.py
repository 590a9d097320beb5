"""The checks of a trajectory and of its points: all of them pass before anything is sent.

Each raises an InputError that names joint, time, value and limit.
"""

from math import floor
from typing import Final, NamedTuple, Self

import numpy as np

from steptwin.host.common.arrays import FloatArray, Int64Array
from steptwin.host.common.bad_input import apart
from steptwin.host.common.errors import InputError
from steptwin.host.planning.plan import Plan
from steptwin.host.planning.trajectory import Trajectory
from steptwin.host.robots.joint import Joint
from steptwin.host.robots.robot import Robot
from steptwin.protocol.pvt import I24_MAX, I24_MIN

_CHECK_MS: Final = 1
"""Time between two instants at which limits are checked; every PVT point is checked as well."""
_LIMIT_TOLERANCE: Final = 1e-9
"""Rounding error allowed beyond a limit: in mm or degrees for positions, as a fraction of the limit for speeds."""
_REST_TOLERANCE: Final = 1e-9
"""Rounding error of a velocity of zero, in mm/s or deg/s."""
_Q16: Final = 1 << 16


class Samples(NamedTuple):
    """A trajectory on a fine grid of time: times of shape (n,), the rest of shape (n, joints)."""

    t_s: FloatArray
    positions: FloatArray
    velocities: FloatArray

    @classmethod
    def of(cls, trajectory: Trajectory, times_ms: Int64Array) -> Self:
        """Sample a trajectory every millisecond and at its points' times."""
        t_s = np.union1d(np.arange(0, times_ms[-1], _CHECK_MS), times_ms) / 1000
        return cls(t_s, trajectory.positions(t_s), trajectory.velocities(t_s))


def check_joint_names(robot: Robot, trajectory: Trajectory) -> None:
    """Check that the trajectory moves the robot's joints, in their order."""
    if trajectory.joint_names != robot.joint_names:
        given, right = " ".join(trajectory.joint_names), " ".join(robot.joint_names)
        raise InputError(f"the trajectory moves the joints {given}, but {robot.name} has {right}, in this order")


def check_positions(robot: Robot, samples: Samples) -> None:
    """Check that all values are finite and all positions within the joints' limits."""
    for i, joint in enumerate(robot.joints):
        _check_finite(joint, samples.t_s, samples.positions[:, i], samples.velocities[:, i])
        _check_range(joint, samples.t_s, samples.positions[:, i])


def _check_finite(joint: Joint, t_s: FloatArray, positions: FloatArray, velocities: FloatArray) -> None:
    finite = np.isfinite(positions) & np.isfinite(velocities)
    if not finite.all():
        i = int(np.argmin(finite))
        raise InputError(
            f"{joint.name}: at t = {t_s[i]:.3f} s the position is {positions[i]:g} {joint.unit} "
            f"and the speed {velocities[i]:g} {joint.unit}/s; both must be finite (is the arm singular there?)"
        )


def _check_range(joint: Joint, t_s: FloatArray, positions: FloatArray) -> None:
    inside = (positions >= joint.lower - _LIMIT_TOLERANCE) & (positions <= joint.upper + _LIMIT_TOLERANCE)
    if not inside.all():
        i = int(np.argmin(inside))
        text, _ = apart(positions[i], joint.lower if positions[i] < joint.lower else joint.upper)
        raise InputError(
            f"{joint.name}: {text} {joint.unit} at t = {t_s[i]:.3f} s "
            f"is outside {joint.lower:g}..{joint.upper:g} {joint.unit}"
        )


def check_speeds(robot: Robot, samples: Samples) -> None:
    """Check speed, and acceleration as the mean over each interval of the grid, inside which it does not jump."""
    t_s, velocities = samples.t_s, samples.velocities
    accelerations = np.diff(velocities, axis=0) / np.diff(t_s)[:, np.newaxis]
    for i, joint in enumerate(robot.joints):
        per_s = f"{joint.unit}/s"
        _check_size(joint, t_s, velocities[:, i], joint.speed_max, "a speed", per_s)
        mean = "a mean acceleration over 1 ms"
        _check_size(joint, t_s, accelerations[:, i], joint.acceleration_max, mean, f"{per_s}^2")


def _check_size(joint: Joint, t_s: FloatArray, values: FloatArray, limit: float, what: str, unit: str) -> None:
    sizes = np.abs(values)
    i = int(np.argmax(sizes))
    if sizes[i] > limit * (1 + _LIMIT_TOLERANCE):
        size_text, limit_text = apart(sizes[i], limit)
        raise InputError(
            f"{joint.name}: {what} of {size_text} {unit} at t = {t_s[i]:.3f} s is more than {limit_text} {unit}"
        )


def check_rest(robot: Robot, samples: Samples) -> None:
    """Check that the trajectory starts and ends at rest."""
    for i, joint in enumerate(robot.joints):
        for when, row in (("starts", 0), ("ends", -1)):
            velocity = samples.velocities[row, i]
            if abs(velocity) > _REST_TOLERANCE:
                raise InputError(
                    f"{joint.name}: the motion {when} at t = {samples.t_s[row]:.3f} s"
                    f" with {velocity:g} {joint.unit}/s instead of 0 {joint.unit}/s, at rest"
                )


def check_record_widths(robot: Robot, times_ms: Int64Array, points: FloatArray, velocities: FloatArray) -> None:
    """Check that displacements and velocities, still floats, fit in the i24 fields of PVT records."""
    for values, what, unit in (
        (np.diff(points, axis=0), "displacement", "units"),
        (velocities, "velocity", "1/64 unit per ms"),
    ):
        outside = (values < I24_MIN) | (values > I24_MAX)
        if outside.any():
            row, i = (int(index) for index in np.argwhere(outside)[0])
            raise InputError(
                f"{robot.joints[i].name}: a {what} of {values[row, i]:.0f} {unit} at t = "
                f"{times_ms[row] / 1000:.3f} s does not fit a PVT record's {I24_MIN}..{I24_MAX}"
            )


def check_step_rates(made: Plan) -> None:
    """Check step rates as the firmware does, so that the firmware accepts the speed of every record of a plan."""
    dt_ms = np.diff(made.times_ms)[:, np.newaxis]
    rates_hz = _velocity_hulls_q16(made) * (1000 / _Q16) / dt_ms
    limit_hz = (
        floor(made.robot.board.driver_rate_max_hz * _Q16 / 1000) * 1000 / _Q16
    )  # the firmware's limit is in Q16 steps per ms
    for i, joint in enumerate(made.robot.joints):
        worst = int(np.argmax(rates_hz[:, i]))
        if rates_hz[worst, i] > limit_hz:
            rate, limit = apart(rates_hz[worst, i] / 1000, limit_hz / 1000)
            raise InputError(
                f"{joint.name}: {rate} kHz of steps at t = {made.times_ms[worst] / 1000:.3f} s "
                f"is more than the driver's {limit} kHz"
            )


def _velocity_hulls_q16(made: Plan) -> Int64Array:
    """Return a bound of each cubic's velocity, of shape (segments, joints), in Q16 steps per segment duration.

    With the displacement D, a = v0 dt and e = v1 dt, the velocity is a quadratic with the Bernstein coefficients a,
    3D - a - e and e. Its size nowhere exceeds the largest of theirs. Rounding is the firmware's.
    """
    dt_ms = np.diff(made.times_ms)[:, np.newaxis]
    microsteps = np.array([joint.transmission.microsteps for joint in made.robot.joints])
    distance = np.diff(made.points_units, axis=0) * microsteps << 2
    a = made.velocities[:-1] * dt_ms * microsteps + 8 >> 4
    e = made.velocities[1:] * dt_ms * microsteps + 8 >> 4
    hulls: Int64Array = np.maximum.reduce([np.abs(a), np.abs(3 * distance - a - e), np.abs(e)])
    return hulls
