"""The checks of a trajectory and of its points: all of them pass before anything is sent.

Each raises an InputError that names joint, time, value and limit.
"""

from collections.abc import Callable, Sequence
from typing import Final

import numpy as np

from steptwin.host.common.arrays import FloatArray, Int64Array
from steptwin.host.common.bad_input import apart, by, nearest_within, outside
from steptwin.host.common.errors import InputError
from steptwin.host.planning.out_of_reach import OutOfReachError
from steptwin.host.planning.peaks import Peak, Quantity
from steptwin.host.planning.samples import Samples
from steptwin.host.planning.trajectory import REST_TOLERANCE, Trajectory
from steptwin.host.robots.joint import Joint
from steptwin.host.robots.robot import Robot
from steptwin.protocol.pvt import I24_MAX, I24_MIN

_LIMIT_TOLERANCE: Final = 1e-9
"""Rounding error, in mm or degrees, allowed beyond a limit of position."""


class OutsideError(OutOfReachError):
    """A joint leaves its range of positions; `joint` is the one, if it is known."""

    def __init__(self, message: str, joint: Joint | None = None) -> None:
        super().__init__(message)
        self.joint = joint


class NotAtRestError(InputError):
    """The motion starts or ends at speed."""


class TooFastError(InputError):
    """The motion is too fast for a limit.

    Attributes:
        peaks: peaks beyond their limits, that of the message first; empty if PVT records cannot hold the motion.
        advice: end of the message that says what would pass, as far as it is known.
    """

    def __init__(self, message: str, peaks: tuple[Peak, ...] = (), advice: str = "") -> None:
        super().__init__(message)
        self.peaks = peaks
        self.advice = advice

    @property
    def least_stretch(self) -> float:
        """A factor, at least 1, by less than which the motion is certainly not slow enough."""
        return max((peak.stretch for peak in self.peaks), default=1.0)


def check_joint_names(robot: Robot, trajectory: Trajectory) -> None:
    """Check that the trajectory moves the robot's joints, in their order."""
    if trajectory.joint_names != robot.joint_names:
        given, right = " ".join(trajectory.joint_names), " ".join(robot.joint_names)
        raise InputError(f"the trajectory moves the joints {given}, but {robot.name} has {right}, in this order")


def check_positions(robot: Robot, samples: Samples) -> None:
    """Check that all values are finite and all positions within the joints' limits."""
    for i in range(len(robot.joints)):
        check_joint_positions(robot, i, samples)


def check_joint_positions(robot: Robot, i: int, samples: Samples) -> None:
    """Check that all values of a joint, given by its index, are finite and its positions within its limits."""
    joint = robot.joints[i]
    _check_finite(joint, samples.t_s, samples.positions[:, i], samples.velocities[:, i])
    _check_range(joint, samples.t_s, samples.positions[:, i])


def check_within(joint: Joint, position: float) -> None:
    """Check that a position is within a joint's limits."""
    if is_outside(joint, position):
        limits = (joint.lower, joint.upper, joint.unit)
        raise OutsideError(f"{joint.name}: {outside(position, *limits)}{nearest_within(position, *limits)}", joint)


def is_outside(joint: Joint, position: float) -> bool:
    """Return whether a position is outside a joint's limits, by more than a rounding error."""
    return not joint.lower - _LIMIT_TOLERANCE <= position <= joint.upper + _LIMIT_TOLERANCE


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
        limits = (joint.lower, joint.upper, joint.unit)
        farthest = float(np.maximum(joint.lower - positions, positions - joint.upper).max())
        raise OutsideError(
            f"{joint.name}: {outside(positions[i], *limits, f' at t = {t_s[i]:.3f} s')}"
            f", by up to {by(farthest, joint.unit)}{nearest_within(positions[i], *limits)}",
            joint,
        )


def check_rest(robot: Robot, samples: Samples) -> None:
    """Check that the trajectory starts and ends at rest."""
    for i, joint in enumerate(robot.joints):
        for when, row in (("starts", 0), ("ends", -1)):
            velocity = samples.velocities[row, i]
            if abs(velocity) > REST_TOLERANCE:
                raise NotAtRestError(
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
            name, at = robot.joints[i].name, f"at t = {times_ms[row] / 1000:.3f} s"
            raise TooFastError(
                f"{name}: a {what} of {values[row, i]:.0f} {unit} {at} does not fit a PVT record's {I24_MIN}..{I24_MAX}"
            ).plainly(f"{name}: {at} it is faster than the board can be told")


def check_peaks(peaks: Sequence[Peak]) -> None:
    """Check that no peak of speed, acceleration or step rate is beyond its limit."""
    exceeded = tuple(peak for peak in peaks if peak.exceeded)
    if exceeded:
        worst = exceeded[0]
        raise TooFastError(f"{worst.joint}: {_PEAK_TEXTS[worst.quantity](worst)}", exceeded)


def _size_text(peak: Peak) -> str:
    value, limit = apart(peak.value, peak.limit)
    article = "an" if peak.quantity is Quantity.AXIS_SPEED else "a"
    return f"{article} {peak.quantity} of {value} {peak.unit} at t = {peak.t_s:.3f} s is more than {limit} {peak.unit}"


def _step_rate_text(peak: Peak) -> str:
    value, limit = apart(peak.value / 1000, peak.limit / 1000)
    return f"{value} kHz of steps at t = {peak.t_s:.3f} s is more than the driver's {limit} kHz"


_PEAK_TEXTS: Final[dict[Quantity, Callable[[Peak], str]]] = {
    Quantity.SPEED: _size_text,
    Quantity.ACCELERATION: _size_text,
    Quantity.AXIS_SPEED: _size_text,
    Quantity.AXIS_ACCELERATION: _size_text,
    Quantity.STEP_RATE: _step_rate_text,
}
