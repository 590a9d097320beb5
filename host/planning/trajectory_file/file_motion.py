"""The motion through the points of a file, its deviation from the lines between them, and reasons of its refusal."""

from collections.abc import Callable, Iterator
from collections.abc import Sequence as Texts
from contextlib import contextmanager
from dataclasses import dataclass
from enum import StrEnum
from functools import partial
from itertools import groupby
from math import ceil
from typing import Final

import numpy as np

from steptwin.host.common.arrays import FloatArray
from steptwin.host.common.bad_input import apart, whole_ms
from steptwin.host.common.errors import InputError
from steptwin.host.planning.checks import NotAtRestError, OutsideError, TooFastError
from steptwin.host.planning.drives import DriveLimits
from steptwin.host.planning.motion import REST_TOLERANCE, Motion
from steptwin.host.planning.motions.composer import sequence, standstill
from steptwin.host.planning.motions.joint_move import change_times_s
from steptwin.host.planning.motions.sampled import blended_lines, c2_spline, hermite_spline
from steptwin.host.planning.motions.stretched import stretched
from steptwin.host.planning.motions.whole import FASTEST, motion_timer
from steptwin.host.planning.peaks import Peak, Quantity
from steptwin.host.planning.plan import Plan
from steptwin.host.planning.planner import plan
from steptwin.host.planning.polygon import Departure, Polygon
from steptwin.host.planning.trajectory_file.points import JointPoints
from steptwin.host.robots.joint import Joint
from steptwin.host.robots.robot import Robot


def with_ramps(motion: Motion, ramps_s: float) -> Motion:
    """Return a motion between a run-in and a run-out, where it starts or ends with a speed, without changes of outputs.

    A ramp lasts `ramps_s`, has constant acceleration and is straight in joint space: the run-in begins v ramps_s / 2
    before the motion's first position, v being the velocity there. The motion itself stays as it is.

    Raises:
        InputError: `ramps_s` is not a whole number of milliseconds above 0, or the motion starts and ends at rest.
    """
    if whole_ms(f"ramps_s={ramps_s:g}", ramps_s) <= 0:
        raise InputError(f"ramps_s={ramps_s:g}: is not above 0 s")
    (first, last), (start, end) = _ends(motion)
    names, rest, ramp_times_s = motion.joint_names, np.zeros_like(start), np.array([0.0, ramps_s])
    parts: list[Motion] = [motion]
    if _moves(start):
        places = np.array([first - start * ramps_s / 2, first])
        parts.insert(0, hermite_spline(names, ramp_times_s, places, np.array([rest, start])))
    if _moves(end):
        places = np.array([last, last + end * ramps_s / 2])
        parts.append(hermite_spline(names, ramp_times_s, places, np.array([end, rest])))
    if len(parts) == 1:
        raise InputError(f"ramps_s={ramps_s:g}: the motion starts and ends at rest")
    return sequence(names, parts)


def shortest_ramps_s(robot: Robot, motion: Motion, stretch: float = 1.0) -> float:
    """Return the shortest ramps, in whole milliseconds, within the robot's accelerations; 0 without speed.

    `stretch` is the factor by which the motion with its ramps will be slower.
    """
    _, velocities = _ends(motion)
    needed_ms = 1000.0 * float(change_times_s(robot, velocities).max()) / stretch**2
    return ceil(needed_ms * (1 - 1e-12)) / 1000 if _moves(velocities) else 0.0


def _ends(motion: Motion) -> tuple[FloatArray, FloatArray]:
    """Return the positions and the velocities at both ends, each of shape (2, joints)."""
    t_s = np.array([0.0, motion.duration_s])
    return motion.positions(t_s), motion.velocities(t_s)


def _moves(velocities: FloatArray) -> bool:
    return bool(np.abs(velocities).max() > REST_TOLERANCE)


Curve = Callable[[tuple[str, ...], FloatArray, FloatArray, tuple[bool, bool]], Motion]
"""A function of joint names, times, positions and whether start and end are at rest, such as `c2_spline`."""


def through_points(
    joint_names: tuple[str, ...],
    times_s: FloatArray,
    positions: FloatArray,
    places: Texts[str],
    curve: Curve = c2_spline,
    at_rest: tuple[bool, bool] = (True, True),
) -> Motion:
    """Return curves through positions of shape (points, joints) at times of shape (points,).

    A point that repeats the previous one makes a pause, since a curve through both would overshoot there. Messages
    name the points' times by `places`. `at_rest` tells whether the first and the last point are at rest; where a pause
    begins or ends, the motion always is. Raise InputError as `check_times`, or if a pause is not in whole milliseconds.
    """
    stands = (np.diff(positions, axis=0) == 0.0).all(axis=1).tolist()
    if not any(stands):
        return curve(joint_names, times_s, positions, at_rest)
    parts: list[Motion] = []
    for standing, group in groupby(range(len(stands)), key=stands.__getitem__):
        segments = list(group)
        first, last = segments[0], segments[-1] + 1
        whole_ms(places[last], float(times_s[last]))
        own_s = times_s[first : last + 1] - times_s[first]
        if standing:
            parts.append(standstill(joint_names, tuple(positions[first].tolist()), float(own_s[-1])))
        else:
            ends_at_rest = (first > 0 or at_rest[0], last < len(stands) or at_rest[1])
            parts.append(curve(joint_names, own_s, positions[first : last + 1], ends_at_rest))
    return sequence(joint_names, parts)


class PointCurve(StrEnum):
    """The motion between points without velocities."""

    SPLINE = "spline"
    """A C2 spline, from rest to rest."""
    LINEAR = "linear"
    """Straight lines of the joints with parabolic blends around the points."""
    STOP = "stop"
    """Straight lines of the joints, each from rest to rest."""


DEFAULT: Final = PointCurve.SPLINE

_SUBJECTS: Final = {
    PointCurve.SPLINE: "the spline",
    PointCurve.LINEAR: "the motion between its blends",
    PointCurve.STOP: "the motion from stop to stop",
}


@dataclass(frozen=True, slots=True, eq=False)
class FileMotion:
    """A robot's motion from a file.

    Attributes:
        robot: the robot.
        points: the file's points.
        interpolation: motion between the points; None for points with velocities, joined by cubics.
        ramps_s: duration of run-in and run-out; 0 for none.
        through: motion through the points, in the file's own time.
        whole: whole motion, with run-in and run-out, or along the same path in its own time.
        is_fastest: True if it is as fast as the robot's limits allow.
    """

    robot: Robot
    points: JointPoints
    interpolation: PointCurve | None
    ramps_s: float
    through: Motion
    whole: Motion
    is_fastest: bool = False

    @classmethod
    def of(
        cls,
        robot: Robot,
        points: JointPoints,
        interpolate: PointCurve | None,
        ramps_s: float,
        *,
        is_fastest: bool = False,
        drives: DriveLimits | None = None,
    ) -> "FileMotion":
        """Return the motion; `interpolate` and ramps are as in `read_trajectory`, which names the errors."""
        if points.velocities is not None and interpolate is not None:
            raise InputError(
                f"interpolate={interpolate}: the file gives velocities, and with them the motion between its points"
            )
        interpolation = interpolate or (DEFAULT if points.velocities is None else None)
        if ramps_s and interpolation is PointCurve.STOP:
            raise InputError(f"ramps_s={ramps_s:g}: a motion that stops at each point starts and ends at rest")
        if ramps_s and is_fastest:
            raise InputError(f"ramps_s={ramps_s:g}: law={FASTEST} starts and ends at rest, along the file's own path")
        through = _through(robot, points, interpolation, moving=bool(ramps_s))
        if is_fastest:
            return cls(
                robot, points, interpolation, ramps_s, through, motion_timer().again(robot, through, drives), is_fastest
            )
        whole = with_ramps(through, ramps_s) if ramps_s else through
        return cls(robot, points, interpolation, ramps_s, through, whole)

    @property
    def polygon(self) -> Polygon:
        """The lines from point to point."""
        return Polygon(self.points.times_s, self.points.positions, self.points.tool_mm)

    def departures(self) -> tuple[Departure, ...]:
        """Return the deviations of the motion from these lines, as `Polygon` does; none for points with velocities."""
        return () if self.interpolation is None else self.polygon.departures(self.robot, self.through)

    # --- why it is refused

    @contextmanager
    def explained(self, stretch: float = 1.0) -> Iterator[None]:
        """Extend the planner's refusal of a motion that is too fast by the points' part in it.

        That is the value of the points alone, if only the motion between them exceeds a limit; and the passing ramps.
        `stretch` is the factor by which the motion was stretched.
        """
        try:
            yield
        except InputError as error:
            text = self._explanation(error.__cause__ or error, stretch)
            if not text:
                raise
            raise InputError(f"{error}; {text}").plainly(f"{error.plain}; {text}") from error

    def _explanation(self, error: BaseException, stretch: float) -> str:
        match error:
            case OutsideError(joint=Joint() as joint):
                return self._of_position(joint)
            case TooFastError(peaks=(peak, *_)):
                if peak.quantity in (Quantity.ACCELERATION, Quantity.AXIS_ACCELERATION):
                    return self._of_acceleration(peak, stretch)
                return self._of_speed(peak, stretch)
            case NotAtRestError():
                return self._passing_ramps(stretch)
        return ""

    def _of_position(self, joint: Joint) -> str:
        positions = self.points.positions[:, self.robot.joint_names.index(joint.name)]
        lowest, highest = float(positions.min()) + 0.0, float(positions.max()) + 0.0  # -0.0 is written 0
        kept = " (interpolate=linear does too)" if self.interpolation is PointCurve.SPLINE and not self.ramps_s else ""
        return f"the points themselves stay within {lowest:g}..{highest:g} {joint.unit}{kept}"

    def _of_speed(self, peak: Peak, stretch: float) -> str:
        """Return the speed between points, if only the motion between them is too fast."""
        if self.interpolation is None:
            return ""
        velocities = self.polygon.velocities() / stretch
        if peak.quantity is not Quantity.SPEED:
            velocities = self.robot.coupling.to_axes(velocities)
        if peak.quantity is Quantity.STEP_RATE:
            velocities = velocities * self.robot.steps_per_unit
        steady = float(np.abs(velocities[:, self.robot.joint_names.index(peak.joint)]).max())
        if steady > peak.limit:
            return ""
        text, _ = apart(steady, peak.limit)
        subject = _SUBJECTS[self.interpolation]
        return f"only {subject} exceeds it, at constant speed from point to point it is {text} {peak.unit}"

    def _of_acceleration(self, peak: Peak, stretch: float) -> str:
        """Return a text about the shortest passing ramps, if the motion starts or ends too steeply; else empty."""
        t_s = peak.t_s / stretch
        times_s, ramps_s = self.points.times_s, self.ramps_s
        before_s = ramps_s or float(times_s[1])
        after_s = self.whole.duration_s - (ramps_s or float(times_s[-1] - times_s[-2]))
        return self._passing_ramps(stretch) if not before_s <= t_s < after_s else ""

    def _passing_ramps(self, stretch: float) -> str:
        """Return the shortest ramps, if the planner accepts the motion with them."""
        if self.interpolation is PointCurve.STOP:
            return ""
        try:
            moving = _through(self.robot, self.points, self.interpolation, moving=True)
            shortest_s = shortest_ramps_s(self.robot, moving, stretch)
            plan(self.robot, stretched(with_ramps(moving, shortest_s), stretch))
        except InputError:
            return ""
        return f"a run-in and a run-out of {shortest_s:g} s pass (ramps_s={shortest_s:g})"


def _through(robot: Robot, points: JointPoints, interpolation: PointCurve | None, *, moving: bool) -> Motion:
    """Return the motion through the points; `moving` tells whether it starts and ends at speed."""
    names, times_s, positions = robot.joint_names, points.times_s, points.positions
    at_rest = (not moving, not moving)
    if points.velocities is not None:
        return hermite_spline(names, times_s, positions, points.velocities)
    if interpolation is PointCurve.STOP:
        return hermite_spline(names, times_s, positions, np.zeros_like(positions))
    if interpolation is PointCurve.LINEAR:
        lines = partial(blended_lines, partial(change_times_s, robot))
        return through_points(names, times_s, positions, points.places, lines, at_rest)
    return through_points(names, times_s, positions, points.places, at_rest=at_rest)


SMALL_PERCENT: Final = 5.0
"""Percentage of every limit and of every joint's range below which a motion's units are doubted."""
_LARGER: Final = {
    "rad": "angles are then 57.3 times as large",
    "m": "lengths are then 1000 times as large",
    "rad,m": "angles are then 57.3 times, lengths 1000 times as large",
}
"""Other possible units, with the factor of positions."""
_MS: Final = 1000.0
_ACCELERATIONS: Final = (Quantity.ACCELERATION, Quantity.AXIS_ACCELERATION)


def doubt(motion: FileMotion, planned: Plan, read_in: Callable[[str], FileMotion]) -> str | None:
    """Return what to ask about a file's units, in one line; None if a joint moves far or fast enough, or none moves.

    A file that hardly moves its robot has angles probably in radians, lengths in metres or times in ms. It breaks no
    limit, so it would run: a motion in radians, read in degrees, has 1/57 of its size and speed. The question names
    other units that fit as `units=rad,m`, as `read_trajectory` takes them.

    Args:
        motion: the motion as it was read, in its file's own time.
        planned: its plan, which may be stretched; a motion made as fast as possible tells by its travel alone.
        read_in: reads the file again in other units, or raises InputError.
    """
    stretched = planned.motion.duration_s / motion.whole.duration_s
    peaks = {} if motion.is_fastest else _peaks_percent(planned, stretched)
    largest = max([_travel_percent(planned), *peaks.values()])
    if not 0.0 < largest < SMALL_PERCENT:
        return None
    units = [each for each in ("rad", "m") if _fits(motion, read_in, each)]
    if len(units) == 2 and _fits(motion, read_in, ",".join(units)):
        units = [",".join(units)]
    fitting = [f"units={each} fits, too: {_LARGER[each]}" for each in units]
    if peaks and all(_MS ** _power(quantity) * percent <= 100.0 for quantity, percent in peaks.items()):
        fitting.append("times in ms fit, too: divide them by 1000")
    return "; ".join(
        [
            f"every joint stays below {SMALL_PERCENT:g} % of its limits and of its range, at {largest:.2g} % at most."
            " Is it in s, mm and degrees?",
            *fitting,
        ]
    ).replace("?;", "?")


def _travel_percent(planned: Plan) -> float:
    """Return the largest joint travel in percent of the joint's range."""
    travels = np.ptp(planned.robot.to_positions(planned.points_units), axis=0)
    ranges = np.array([joint.upper - joint.lower for joint in planned.robot.joints])
    return float((100.0 * travels / ranges).max())


def _peaks_percent(planned: Plan, stretched: float) -> dict[Quantity, float]:
    """Return the peak of each quantity in percent of its limit, without the plan's stretching."""
    quantities = dict.fromkeys(peak.quantity for peak in planned.peaks)
    return {each: stretched ** _power(each) * planned.highest(each).percent for each in quantities}


def _power(quantity: Quantity) -> int:
    """Return the power of the speed with which a quantity grows."""
    return 2 if quantity in _ACCELERATIONS else 1


def _fits(motion: FileMotion, read_in: Callable[[str], FileMotion], units: str) -> bool:
    """Return whether the file is another motion in these units that the robot can make."""
    try:
        other = read_in(units)
        if np.array_equal(other.points.positions, motion.points.positions):
            return False
        plan(motion.robot, other.whole)
    except InputError:
        return False
    return True
