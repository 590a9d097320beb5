"""The points of a trajectory file, whatever its format, and the motion through them."""

from collections.abc import Sequence as Texts
from dataclasses import dataclass
from math import inf
from typing import Final

import numpy as np

from steptwin.host.common.arrays import FloatArray
from steptwin.host.common.bad_input import unknown
from steptwin.host.common.errors import InputError
from steptwin.host.planning.motions.sampled import Sampled, check_times
from steptwin.host.planning.motions.sequence import Sequence
from steptwin.host.planning.motions.through_points import through_points
from steptwin.host.robots.robot import Robot

LONGEST_S: Final = 3600.0
"""Longest motion that a file may hold; a longer one probably has times in other units, and would not fit in memory."""


@dataclass(frozen=True, slots=True)
class Points:
    """The contents of a trajectory file, in the order of its columns.

    Attributes:
        joint_names: one for each column.
        places: where each point's time stands in the file, for messages.
        times_s: shape (points,).
        positions: shape (points, columns), in mm and degrees.
        velocities: likewise, in mm/s and deg/s; None if the file gives none.
    """

    joint_names: list[str]
    places: Texts[str]
    times_s: FloatArray
    positions: FloatArray
    velocities: FloatArray | None

    def until(self, end_s: float) -> "Points":
        """Return the points up to an instant, all if it is infinite; raise InputError if no motion ends before it."""
        if end_s == inf:
            return self
        kept = int(np.count_nonzero(self.times_s <= end_s))
        if kept < min(2, len(self.times_s)):
            raise InputError(f"there is no second point up to {end_s:.6f} s")
        return Points(
            self.joint_names,
            self.places[:kept],
            self.times_s[:kept],
            self.positions[:kept],
            None if self.velocities is None else self.velocities[:kept],
        )

    def motion(self, robot: Robot) -> Sampled | Sequence:
        """Return the motion through the points; raise InputError if the joints or times are not a robot's motion."""
        columns = self._columns(robot)
        times_s, positions = self.times_s, self.positions[:, columns]
        late = times_s > LONGEST_S
        if late.any():
            i = int(np.argmax(late))
            raise InputError(f"{self.places[i]}: {times_s[i]:.9g} s is more than {LONGEST_S:g} s")
        check_times(times_s, self.places, all_whole_ms=self.velocities is not None)
        if self.velocities is None:
            return through_points(robot.joint_names, times_s, positions, self.places)
        return Sampled.hermite(robot.joint_names, times_s, positions, self.velocities[:, columns])

    def _columns(self, robot: Robot) -> list[int]:
        """Return the column of each of the robot's joints."""
        names = self.joint_names
        for name in names:
            if name not in robot.joint_names:
                raise unknown("joint", name, robot.joint_names)
            if names.count(name) > 1:
                raise InputError(f"joint {name!r} appears {names.count(name)} times")
        for name in robot.joint_names:
            if name not in names:
                raise InputError(f"joint {name!r} is missing: {robot.name} has {' '.join(robot.joint_names)}")
        return [names.index(name) for name in robot.joint_names]
