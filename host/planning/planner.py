"""From trajectory to PVT: sample, convert once, check everything before anything is sent.

Positions are converted to wire units on absolute values and rounded once; a record's displacement is the difference of
two rounded absolutes, so nothing drifts. Velocities are the trajectory's own at the points.
"""

from dataclasses import dataclass
from math import floor
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from steptwin.host.common.arrays import FloatArray
from steptwin.host.common.bad_input import apart, whole_ms
from steptwin.host.common.errors import InputError
from steptwin.host.planning.trajectory import Trajectory
from steptwin.host.robots.joint import Joint
from steptwin.host.robots.robot import Robot
from steptwin.protocol.pvt import DURATION_MAX_MS, I24_MAX, I24_MIN, VELOCITY_PER_UNIT_PER_MS

Int64Array = NDArray[np.int64]

DEFAULT_POINT_MS: Final = 10
_CHECK_MS: Final = 1
"""Limits are checked on a grid as fine as this, and at every point."""
_LIMIT_TOLERANCE: Final = 1e-9
_REST_TOLERANCE: Final = 1e-9
"""In mm/s or deg/s: what rounding leaves of a velocity of zero."""
_Q16: Final = 1 << 16


@dataclass(frozen=True, slots=True, eq=False)
class Plan:
    """A checked trajectory as points on the wire; its arrays are read-only.

    Attributes:
        robot: whose joints these are.
        trajectory: the motion itself.
        times_ms: shape (points,), whole milliseconds, from 0 to the end.
        points_units: shape (points, joints), absolute positions in wire units.
        velocities: shape (points, joints), in 1/64 unit per ms; 0 at both ends.
    """

    robot: Robot
    trajectory: Trajectory
    times_ms: Int64Array
    points_units: Int64Array
    velocities: Int64Array

    def __post_init__(self) -> None:
        for array in (self.times_ms, self.points_units, self.velocities):
            array.flags.writeable = False

    @property
    def start_units(self) -> list[int]:
        """Where each axis must stand before the motion."""
        return [int(units) for units in self.points_units[0]]

    @property
    def start_joints(self) -> list[float]:
        """The trajectory's joint positions at t = 0, in mm and degrees."""
        return [float(q) for q in self.trajectory.positions(np.zeros(1))[0]]

    def durations_ms(self) -> list[int]:
        """The duration of each segment."""
        return [int(dt) for dt in np.diff(self.times_ms)]

    def displacements_units(self, axis: int) -> list[int]:
        """One axis' displacement in each segment."""
        return [int(d) for d in np.diff(self.points_units[:, axis])]

    def end_velocities(self, axis: int) -> list[int]:
        """One axis' velocity at the end of each segment."""
        return [int(v) for v in self.velocities[1:, axis]]


def plan(robot: Robot, trajectory: Trajectory, point_ms: int = DEFAULT_POINT_MS) -> Plan:
    """Sample a trajectory every `point_ms` and at its breakpoints, check it and convert it.

    Raises:
        InputError: the trajectory has other joints than the robot, is not finite, leaves a limit of position, speed,
            acceleration or step rate, does not start and end at rest, or does not fit the PVT record; the message
            names joint, time, value and limit.
    """
    _check_joint_names(robot, trajectory)
    times_ms = _point_times_ms(trajectory, point_ms)
    samples = _samples(trajectory, times_ms)
    _check_positions(robot, samples)
    _check_rest(robot, samples)
    at_points = np.searchsorted(samples.t_s, times_ms / 1000)
    points = robot.to_units(samples.positions[at_points])
    velocities = np.round(samples.velocities[at_points] * robot.wire_units_per_unit * VELOCITY_PER_UNIT_PER_MS / 1000)
    _check_record_widths(robot, times_ms, points, velocities)  # before they become integers, which end somewhere too
    made = Plan(robot, trajectory, times_ms, points.astype(np.int64), velocities.astype(np.int64))
    _check_step_rates(made)
    _check_speeds(robot, samples)
    return made


def check_start(made: Plan, board_joints: list[float]) -> None:
    """Refuse a plan that does not start where the board stands, half a step being what it can stand off.

    Raises:
        InputError: naming the first joint that differs, with both positions.
    """
    for joint, start, board in zip(made.robot.joints, made.start_joints, board_joints, strict=True):
        half_step = 0.5 / joint.transmission.steps_per_unit
        if abs(start - board) > half_step * (1 + 1e-6):
            raise InputError(
                f"{joint.name}: the trajectory starts at {start:.4f} {joint.unit}, "
                f"the board stands at {board:.4f} {joint.unit} (limit: half a step, {half_step:.4f} {joint.unit})"
            )


def _check_joint_names(robot: Robot, trajectory: Trajectory) -> None:
    if trajectory.joint_names != robot.joint_names:
        given, right = " ".join(trajectory.joint_names), " ".join(robot.joint_names)
        raise InputError(f"the trajectory moves the joints {given}, but {robot.name} has {right}, in this order")


def _point_times_ms(trajectory: Trajectory, point_ms: int) -> Int64Array:
    """The grid and the breakpoints; all of them must be whole milliseconds, and the end not before the first one."""
    if not 1 <= point_ms <= DURATION_MAX_MS:
        raise InputError(f"{point_ms} ms between points is not from 1 to {DURATION_MAX_MS} ms")
    end_ms = whole_ms("the duration", trajectory.duration_s)
    breakpoints_ms = [whole_ms("a breakpoint", t_s) for t_s in trajectory.breakpoints_s]
    for what, t_ms in (("the duration", end_ms), *(("a breakpoint", t_ms) for t_ms in breakpoints_ms)):
        if not 1 <= t_ms <= end_ms:
            raise InputError(f"{what}: {t_ms} ms is not from 1 ms to the end at {end_ms} ms")
    return np.unique(np.array([*range(0, end_ms, point_ms), *breakpoints_ms, end_ms], dtype=np.int64))


class _Samples(NamedTuple):
    """The trajectory on the fine grid: times of shape (n,), the rest of shape (n, joints)."""

    t_s: FloatArray
    positions: FloatArray
    velocities: FloatArray


def _samples(trajectory: Trajectory, times_ms: Int64Array) -> _Samples:
    t_s = np.union1d(np.arange(0, times_ms[-1], _CHECK_MS), times_ms) / 1000
    return _Samples(t_s, trajectory.positions(t_s), trajectory.velocities(t_s))


def _check_positions(robot: Robot, samples: _Samples) -> None:
    for i, joint in enumerate(robot.joints):
        _check_finite(joint, samples.t_s, samples.positions[:, i], samples.velocities[:, i])
        _check_range(joint, samples.t_s, samples.positions[:, i])


def _check_speeds(robot: Robot, samples: _Samples) -> None:
    """Speed and acceleration; the latter is the mean over each interval of the grid, which no breakpoint divides."""
    t_s, velocities = samples.t_s, samples.velocities
    accelerations = np.diff(velocities, axis=0) / np.diff(t_s)[:, np.newaxis]
    for i, joint in enumerate(robot.joints):
        per_s = f"{joint.unit}/s"
        _check_size(joint, t_s, velocities[:, i], joint.speed_max, "a speed", per_s)
        mean = "a mean acceleration over 1 ms"
        _check_size(joint, t_s, accelerations[:, i], joint.acceleration_max, mean, f"{per_s}^2")


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


def _check_size(joint: Joint, t_s: FloatArray, values: FloatArray, limit: float, what: str, unit: str) -> None:
    sizes = np.abs(values)
    i = int(np.argmax(sizes))
    if sizes[i] > limit * (1 + _LIMIT_TOLERANCE):
        size_text, limit_text = apart(sizes[i], limit)
        raise InputError(
            f"{joint.name}: {what} of {size_text} {unit} at t = {t_s[i]:.3f} s is more than {limit_text} {unit}"
        )


def _check_rest(robot: Robot, samples: _Samples) -> None:
    for i, joint in enumerate(robot.joints):
        for when, row in (("starts", 0), ("ends", -1)):
            velocity = samples.velocities[row, i]
            if abs(velocity) > _REST_TOLERANCE:
                raise InputError(
                    f"{joint.name}: the motion {when} at t = {samples.t_s[row]:.3f} s"
                    f" with {velocity:g} {joint.unit}/s instead of 0 {joint.unit}/s, at rest"
                )


def _check_record_widths(robot: Robot, times_ms: Int64Array, points: FloatArray, velocities: FloatArray) -> None:
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


def _check_step_rates(made: Plan) -> None:
    """The firmware's own test, so that no record of a plan is refused for its speed."""
    dt_ms = np.diff(made.times_ms)[:, np.newaxis]
    rates_hz = _velocity_hulls_q16(made) * (1000 / _Q16) / dt_ms
    limit_hz = floor(made.robot.board.driver_rate_max_hz * _Q16 / 1000) * 1000 / _Q16  # it counts in Q16 steps per ms
    for i, joint in enumerate(made.robot.joints):
        worst = int(np.argmax(rates_hz[:, i]))
        if rates_hz[worst, i] > limit_hz:
            rate, limit = apart(rates_hz[worst, i] / 1000, limit_hz / 1000)
            raise InputError(
                f"{joint.name}: {rate} kHz of steps at t = {made.times_ms[worst] / 1000:.3f} s "
                f"is more than the driver's {limit} kHz"
            )


def _velocity_hulls_q16(made: Plan) -> Int64Array:
    """A bound of each cubic's velocity, shape (segments, joints), in Q16 steps per segment duration.

    With D the displacement, a = v0 dt and e = v1 dt the velocity is a quadratic with the Bernstein coefficients a,
    3D - a - e and e, which is nowhere larger than the largest of them. Rounded as the firmware rounds.
    """
    dt_ms = np.diff(made.times_ms)[:, np.newaxis]
    microsteps = np.array([joint.transmission.microsteps for joint in made.robot.joints])
    distance = np.diff(made.points_units, axis=0) * microsteps << 2
    a = made.velocities[:-1] * dt_ms * microsteps + 8 >> 4
    e = made.velocities[1:] * dt_ms * microsteps + 8 >> 4
    hulls: Int64Array = np.maximum.reduce([np.abs(a), np.abs(3 * distance - a - e), np.abs(e)])
    return hulls
