"""A plan: a checked motion as points on the wire, and its highest speed by its peaks and the bus."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from math import floor, sqrt
from typing import Final, NamedTuple

import numpy as np

from steptwin.host.common.arrays import AxisRecords, Int64Array
from steptwin.host.common.errors import InputError
from steptwin.host.common.features import ChangedMotion, drive_model
from steptwin.host.planning.motion import Motion
from steptwin.host.planning.motions.held import Hold, held, time_span
from steptwin.host.planning.peaks import Peak, Quantity
from steptwin.host.robots.robot import Robot
from steptwin.protocol.od import FULL_RATE_Q16, RATE_PERCENT_MAX, rate_q16

PLANNED_PERCENT: Final = 100
BITS_OF_A_RECORD: Final = 135
"""Longest frame of eight bytes with a standard identifier and the space after it, in bits (ISO 11898-1).

It has 47 + 64 bits, and a stuff bit for every fourth of the 34 + 64 - 1 bits after the first stuffable one.
"""
BUS_PART: Final = 0.8
"""Fraction of the bus for the records; the rest is for the nodes' reports and for repeated records."""
_ACCELERATIONS: Final = (Quantity.ACCELERATION, Quantity.AXIS_ACCELERATION)
_ROUNDING: Final = 1e-9


@dataclass(frozen=True, eq=False)
class Plan:
    """A checked motion as points on the wire, made by `planner.plan`; its arrays are read-only.

    Attributes:
        robot: the robot that moves.
        motion: motion that the points were sampled from.
        times_ms: shape (points,), whole milliseconds, from 0 to the end.
        points_units: shape (points, joints), absolute positions in wire units.
        velocities: shape (points, joints), in 1/64 unit per ms; 0 at both ends.
        peaks: highest step rate, speed and acceleration of each joint, all within their limits.
        changed: how a feature has changed the motion before it was planned; None if it has not.
    """

    robot: Robot
    motion: Motion
    times_ms: Int64Array
    points_units: Int64Array
    velocities: Int64Array
    peaks: tuple[Peak, ...]
    changed: ChangedMotion | None = None

    def __post_init__(self) -> None:
        for array in (self.times_ms, self.points_units, self.velocities):
            array.flags.writeable = False

    @property
    def start_units(self) -> list[int]:
        """The position of each axis at the start, in wire units."""
        return [int(units) for units in self.points_units[0]]

    @property
    def start_joints(self) -> list[float]:
        """The motion's joint positions at t = 0, in mm and degrees."""
        return [float(q) for q in self.motion.positions(np.zeros(1))[0]]

    def records(self, count: int | None = None) -> tuple[AxisRecords, ...]:
        """Return the PVT records of each axis, or only the first `count` of them.

        A displacement is the difference of two rounded absolute positions, so rounding errors do not add up.
        """
        displacements, durations_ms = np.diff(self.points_units, axis=0)[:count], np.diff(self.times_ms)[:count]
        return tuple(
            AxisRecords(distances.tolist(), end_velocities.tolist(), durations_ms.tolist())
            for distances, end_velocities in zip(displacements.T, self.velocities[1:][:count].T, strict=True)
        )

    def held(self, holds: Sequence[Hold], record_ms: int) -> "Plan":
        """Return the plan with standstills at some of its points, made of records of `record_ms` each.

        The other records stay as they are.

        Raises:
            ValueError: a standstill is not at a point, or is not a whole number of records.
        """
        times_ms, points, velocities = self.times_ms, self.points_units, self.velocities
        for hold in reversed(holds):
            (at,) = np.flatnonzero(times_ms == hold.at_ms)
            count, rest = divmod(hold.duration_ms, record_ms)
            if rest:
                raise ValueError(f"{hold.duration_ms} ms are not a number of records of {record_ms} ms")
            stands_ms = hold.at_ms + record_ms * np.arange(1, count + 1)
            times_ms = np.concatenate((times_ms[: at + 1], stands_ms, times_ms[at + 1 :] + hold.duration_ms))
            points = np.insert(points, at + 1, np.repeat(points[[at]], count, axis=0), axis=0)
            velocities = np.insert(velocities, at + 1, np.zeros((count, velocities.shape[1]), np.int64), axis=0)
        return replace(
            self,
            motion=held(self.motion, tuple(holds)),
            times_ms=times_ms,
            points_units=points,
            velocities=velocities,
        )

    def highest(self, quantity: Quantity) -> Peak:
        """Return the peak of a quantity that is nearest to its limit, over all joints."""
        return max((peak for peak in self.peaks if peak.quantity is quantity), key=lambda peak: peak.percent)

    @cached_property
    def highest_speed(self) -> "HighestSpeed":
        """Highest speed of its execution, by limits, drivers, bus and motors, if any.

        It is computed on first use, since turning the motors takes some time.
        """
        found = [HighestSpeed(RATE_PERCENT_MAX, "this is the highest speed"), _by_bus(self)]
        found += [HighestSpeed(_by_peak(peak), f"{peak.joint}: {peak.quantity}") for peak in self.peaks]
        lowest = min(found, key=lambda each: each.percent)
        if lowest.percent <= PLANNED_PERCENT:
            return lowest._replace(percent=PLANNED_PERCENT)
        drives = drive_model()
        held = None if drives is None else drives.highest_speed(self, lowest.percent)
        return lowest if held is None or held.percent >= lowest.percent else held

    def until(self, end_ms: int) -> "Plan":
        """Return the plan up to a point at standstill; raise ValueError for another time.

        The peaks stay those of the whole plan.
        """
        at = np.flatnonzero(self.times_ms == end_ms)
        if not at.size or self.velocities[at].any():
            raise ValueError(f"the plan does not stand at a point at {end_ms} ms")
        count = int(at[0]) + 1
        return replace(
            self,
            motion=time_span(self.motion, 0.0, end_ms / 1000),
            times_ms=self.times_ms[:count],
            points_units=self.points_units[:count],
            velocities=self.velocities[:count],
        )

    def check_start(self, joints: list[float]) -> None:
        """Raise InputError, naming the joint, if the machine is half a step or more away from the start.

        `joints` are the machine's positions in mm and degrees.
        """
        coupling = self.robot.coupling
        starts, places = coupling.to_axes(np.array([self.start_joints, joints])).tolist()
        for i, (joint, start, now) in enumerate(zip(self.robot.axes, starts, places, strict=True)):
            half_step = 0.5 / joint.transmission.steps_per_unit
            if abs(start - now) > half_step * (1 + 1e-6):
                what = f"{joint.name}'s axis" if coupling.couples(i) else joint.name
                raise InputError(
                    f"{what}: the trajectory starts at {start:.4f} {joint.unit}, "
                    f"the board stands at {now:.4f} {joint.unit} (limit: half a step, {half_step:.4f} {joint.unit})"
                )


class HighestSpeed(NamedTuple):
    """Highest speed of a motion's execution, in percent of the planned one, and its limiting factor."""

    percent: int
    by: str


def highest_speed(plan: Plan) -> HighestSpeed:
    """Return the highest speed of a motion, a whole percentage from 100 to 150.

    At r times the planned speed, speeds and step rates are r times as high and accelerations r^2 times. So r is at most
    the least limit / peak, or its square root for accelerations. Step rates are compared in the board's integers. A
    robot's motors turn by the motion: at r times the speed they must keep step, with some reserve.
    """
    return plan.highest_speed


def _by_peak(peak: Peak) -> int:
    if not peak.value:
        return RATE_PERCENT_MAX
    if peak.quantity is Quantity.STEP_RATE:
        return _by_step_rate(peak)
    ratio = peak.limit / peak.value
    factor = sqrt(ratio) if peak.quantity in _ACCELERATIONS else ratio
    return min(RATE_PERCENT_MAX, floor(100 * factor * (1 + _ROUNDING)))


def _by_step_rate(peak: Peak) -> int:
    """Return the highest percentage with which the board accepts the fastest record (see `AxisMotion.push_record`)."""
    limit_q16 = round(peak.limit * FULL_RATE_Q16 / 1000)
    percent = min(RATE_PERCENT_MAX, floor(100 * peak.limit / peak.value))
    while (
        percent > PLANNED_PERCENT and peak.value > limit_q16 * FULL_RATE_Q16 // rate_q16(percent) * 1000 / FULL_RATE_Q16
    ):
        percent -= 1
    return percent


def _by_bus(plan: Plan) -> HighestSpeed:
    records = plan.points_units.shape[1] * (len(plan.times_ms) - 1)
    bits_per_s = records * BITS_OF_A_RECORD / (plan.times_ms[-1] / 1000)
    percent = floor(100 * BUS_PART * plan.robot.board.bitrate / bits_per_s)
    return HighestSpeed(min(RATE_PERCENT_MAX, percent), f"the bus of {plan.robot.board.bitrate} bit/s")
