"""Checks of a motion and of its points; all must pass before anything is sent.

Each raises an InputError that names joint, time, value and limit.
"""

from collections.abc import Callable, Iterable, Iterator, Sequence
from typing import Final, NamedTuple

import numpy as np

from steptwin.host.common.arrays import FloatArray, Int64Array
from steptwin.host.common.bad_input import apart, by, nearest_within, outside
from steptwin.host.common.errors import InputError
from steptwin.host.planning.motion import REST_TOLERANCE, Motion
from steptwin.host.planning.paths import OutOfReachError
from steptwin.host.planning.peaks import Peak, Quantity, Samples, sampled
from steptwin.host.robots.joint import Joint
from steptwin.host.robots.robot import Robot
from steptwin.protocol.pvt import I24_MAX, I24_MIN

_LIMIT_TOLERANCE: Final = 1e-9
"""Largest rounding error, in mm or degrees, beyond a position limit."""
BEYOND_STEPS: Final = 0.02
"""Largest distance in driver steps beyond a position limit between a motion's knots: cubics deviate less."""


class OutsideError(OutOfReachError):
    """A joint leaves its position limits; `joint` is its name, if known."""

    def __init__(self, message: str, joint: Joint | None = None) -> None:
        super().__init__(message)
        self.joint = joint


class NotAtRestError(InputError):
    """The motion starts or ends with a velocity."""


class TooFastError(InputError):
    """The motion is too fast for a limit.

    Attributes:
        peaks: peaks beyond their limits, that of the message first; empty if PVT records cannot hold the motion.
        advice: end of the message with a remedy, if known.
    """

    def __init__(self, message: str, peaks: tuple[Peak, ...] = (), advice: str = "") -> None:
        super().__init__(message)
        self.peaks = peaks
        self.advice = advice

    @property
    def least_stretch(self) -> float:
        """Lower bound, at least 1, of the stretch factors that pass."""
        return max((peak.stretch for peak in self.peaks), default=1.0)


def check_joint_names(robot: Robot, motion: Motion) -> None:
    """Check that the motion moves the robot's joints, in their order."""
    if motion.joint_names != robot.joint_names:
        given, right = " ".join(motion.joint_names), " ".join(robot.joint_names)
        raise InputError(f"the trajectory moves the joints {given}, but {robot.name} has {right}, in this order")


class SampleCheck:
    """Examines a motion window by window: all values of each joint, its positions, and its speed at both ends."""

    def __init__(self, robot: Robot, knots_ms: FloatArray) -> None:
        """Prepare to examine a motion with these knots, by the times of its windows."""
        self._joints = robot.joints
        self._knots_ms = knots_ms
        self._beyond_between = BEYOND_STEPS / np.abs(robot.to_steps(np.eye(len(robot.joints)))).max(axis=1)
        self._not_finite: dict[int, InputError] = {}
        self._beyond: dict[int, _Beyond] = {}
        self._first: Samples | None = None
        self._last: Samples | None = None

    def watched(self, windows: Iterable[Samples]) -> Iterator[Samples]:
        """Examine windows as they pass; raise InputError, as `check_positions`, for one that is not finite."""
        for samples in self.looking(windows):
            if self._not_finite:
                self.check_positions()
            yield samples

    def looking(self, windows: Iterable[Samples]) -> Iterator[Samples]:
        """Examine windows as they pass, without raising errors."""
        for samples in windows:
            self._look(samples)
            yield samples

    def _look(self, samples: Samples) -> None:
        """Look at the next window."""
        self._first, self._last = self._first or samples.row(0), samples.row(-1)
        exact = np.isin(np.round(1000 * samples.t_s), self._knots_ms)
        exact |= np.abs(samples.velocities).max(axis=1) <= REST_TOLERANCE
        for i, joint in enumerate(self._joints):
            positions = samples.positions[:, i]
            if error := _not_finite(joint, samples.t_s, positions, samples.velocities[:, i]):
                self._not_finite.setdefault(i, error)
            elif found := _Beyond.of(joint, samples.t_s, positions, np.where(exact, 0.0, self._beyond_between[i])):
                self._beyond[i] = self._beyond.get(i, found).and_later(found)

    def check_positions(self) -> None:
        """Check that all values are finite and all positions within the joints' limits."""
        for i in range(len(self._joints)):
            self.check_joint(i)

    def check_joint(self, i: int) -> None:
        """Check that all values of a joint, given by its index, are finite and its positions within its limits."""
        if i in self._not_finite:
            raise self._not_finite[i]
        if i in self._beyond and self._beyond[i].counts:
            raise self._beyond[i].error(self._joints[i])

    def check_rest(self) -> None:
        """Check that the motion starts and ends at rest."""
        for i, joint in enumerate(self._joints):
            for when, samples in (("starts", self._first), ("ends", self._last)):
                velocity = samples.velocities[0, i] if samples else 0.0
                if samples and abs(velocity) > REST_TOLERANCE:
                    raise NotAtRestError(
                        f"{joint.name}: the motion {when} at t = {samples.t_s[0]:.3f} s"
                        f" with {velocity:g} {joint.unit}/s instead of 0 {joint.unit}/s, at rest"
                    )


def knots_ms(motion: Motion) -> FloatArray:
    """Return the times in ms of a motion's breakpoints; there, and at rest, points are exact."""
    return np.round(1000 * np.array(motion.breakpoints_s))


def check_positions(robot: Robot, motion: Motion) -> None:
    """Check that all values of a motion are finite and all positions within the joints' limits."""
    check = SampleCheck(robot, knots_ms(motion))
    for _ in check.watched(sampled(motion)):
        pass
    check.check_positions()


def check_within(joint: Joint, position: float) -> None:
    """Check that a position is within a joint's limits."""
    if is_outside(joint, position):
        limits = (joint.lower, joint.upper, joint.unit)
        raise OutsideError(f"{joint.name}: {outside(position, *limits)}{nearest_within(position, *limits)}", joint)


def is_outside(joint: Joint, position: float) -> bool:
    """Return whether a position is outside a joint's limits, by more than a rounding error."""
    return not joint.lower - _LIMIT_TOLERANCE <= position <= joint.upper + _LIMIT_TOLERANCE


def _not_finite(joint: Joint, t_s: FloatArray, positions: FloatArray, velocities: FloatArray) -> InputError | None:
    finite = np.isfinite(positions) & np.isfinite(velocities)
    if finite.all():
        return None
    i = int(np.argmin(finite))
    return InputError(
        f"{joint.name}: at t = {t_s[i]:.3f} s the position is {positions[i]:g} {joint.unit} "
        f"and the speed {velocities[i]:g} {joint.unit}/s; both must be finite (is the arm singular there?)"
    )


class _Beyond(NamedTuple):
    """A joint beyond its limits: first place and time, largest distance, and whether the distance is too large."""

    position: float
    t_s: float
    farthest: float
    counts: bool

    @classmethod
    def of(cls, joint: Joint, t_s: FloatArray, positions: FloatArray, may: FloatArray) -> "_Beyond | None":
        """Return a joint's first position beyond its limits; `may` is the allowed distance at each instant."""
        beyond = np.maximum(joint.lower - positions, positions - joint.upper)
        outside = beyond > _LIMIT_TOLERANCE
        if not outside.any():
            return None
        i = int(np.argmax(outside))
        return cls(float(positions[i]), float(t_s[i]), float(beyond.max()), bool((outside & (beyond > may)).any()))

    def and_later(self, later: "_Beyond") -> "_Beyond":
        """Return this combined with a later window."""
        return self._replace(farthest=max(self.farthest, later.farthest), counts=self.counts or later.counts)

    def error(self, joint: Joint) -> OutsideError:
        limits = (joint.lower, joint.upper, joint.unit)
        return OutsideError(
            f"{joint.name}: {outside(self.position, *limits, f' at t = {self.t_s:.3f} s')}"
            f", by up to {by(self.farthest, joint.unit)}{nearest_within(self.position, *limits)}",
            joint,
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
            name, at = robot.axes[i].name, f"at t = {times_ms[row] / 1000:.3f} s"
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
