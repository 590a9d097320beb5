"""The reach of an arm whose slides stand still: which positions its tool reaches, in one attitude or in any."""

from dataclasses import dataclass
from typing import Final, Self

import numpy as np

from steptwin.host.common.arrays import BoolArray, FloatArray
from steptwin.host.robots.kinematics import Kinematics, Scara, make_kinematics
from steptwin.host.robots.robot import Robot

ATTITUDES: Final = 36
"""Number of attitudes tried, evenly spaced, if any attitude is allowed.

Attitudes in between would widen the reach of a tool at the distance l from the wrist's axis by at most
l (1 - cos 5 deg), 0.4 % of l.
"""

_STRIDES: Final = (9, 3, 1)
"""The other attitudes are tried in rounds, every ninth first: most positions within reach need no other round."""

_CHUNK: Final = 1 << 12
"""Number of poses solved at once: their arrays fit in the processor's cache."""

_PROBES: Final = 4096
"""Number of random joint positions from which the box is estimated."""
_MARGIN: Final = 0.1
"""Part by which the estimated box is widened, so that it holds the whole workspace."""


@dataclass(frozen=True, slots=True, eq=False)
class ArmReach:
    """A robot with its slides at their home positions.

    Attributes:
        robot: the whole machine.
        kinematics: the kinematics of the whole machine.
        home: shape (joints,), the home position, where the slides stay.
        axis_x_mm: x of the arm's own axis, which is at y = 0.
        attitude_deg: attitude of the tool; None if any attitude is allowed.
    """

    robot: Robot
    kinematics: Kinematics
    home: FloatArray
    axis_x_mm: float
    attitude_deg: float | None

    @classmethod
    def of(cls, robot: Robot, attitude_deg: float | None) -> Self:
        """Return a robot's arm; raise InputError if its dimensions or joints are not its mechanism's."""
        kinematics = make_kinematics(robot)
        shifts = _shifts(kinematics)
        axis_x_mm = sum((robot.home[column] for column, coordinate in shifts if coordinate == 0), 0.0)
        return cls(robot, kinematics, np.array(robot.home), axis_x_mm, attitude_deg)

    @property
    def slides(self) -> dict[str, float]:
        """The positions of the slides, which shift the whole arm, by name, in mm."""
        return {self.robot.joint_names[column]: self.robot.home[column] for column, _ in _shifts(self.kinematics)}

    @property
    def home_azimuth_deg(self) -> float:
        """The direction from the arm's axis to the tool in the home position."""
        x_mm, y_mm, _, _ = self._home_pose
        return float(np.rad2deg(np.arctan2(y_mm, x_mm - self.axis_x_mm)))

    @property
    def home_z_mm(self) -> float:
        """The tool's height in the home position."""
        return float(self._home_pose[2])

    def reachable(self, radius_mm: FloatArray, azimuth_deg: FloatArray, z_mm: FloatArray) -> BoolArray:
        """Return, of shape (n,), whether a branch reaches positions in cylindrical coordinates, each of shape (n,)."""
        azimuth_rad = np.deg2rad(azimuth_deg)
        x_mm, y_mm = self.axis_x_mm + radius_mm * np.cos(azimuth_rad), radius_mm * np.sin(azimuth_rad)
        if self.attitude_deg is not None:
            return self._reached(np.column_stack([x_mm, y_mm, z_mm, np.full(len(x_mm), self.attitude_deg)]))
        if self.kinematics.attitude_follows:
            return self._reached(np.column_stack([x_mm, y_mm, z_mm, np.full(len(x_mm), np.nan)]))
        outwards = np.column_stack([x_mm, y_mm, z_mm, azimuth_deg])
        reached, turnable = self._solved(outwards)
        places = np.flatnonzero(turnable & ~reached)
        for begin in range(0, len(places), _CHUNK):
            part = places[begin : begin + _CHUNK]
            reached[part] = self._reached_turned(outwards[part])
        return reached

    def box_mm(self) -> tuple[float, float, float]:
        """Return the greatest radius, the least and the greatest height of a box that holds the workspace."""
        lower, upper = ([getattr(joint, bound) for joint in self.robot.joints] for bound in ("lower", "upper"))
        joints = np.random.default_rng(0).uniform(lower, upper, (_PROBES, len(lower)))
        for column, _ in _shifts(self.kinematics):
            joints[:, column] = self.home[column]
        poses = self.kinematics.forward(np.vstack([self.home, joints]))
        radius_mm = np.nanmax(np.hypot(poses[:, 0] - self.axis_x_mm, poses[:, 1]))
        lowest_mm, highest_mm = np.nanmin(poses[:, 2]), np.nanmax(poses[:, 2])
        margin_mm = _MARGIN * (highest_mm - lowest_mm)
        return float((1.0 + _MARGIN) * radius_mm), float(lowest_mm - margin_mm), float(highest_mm + margin_mm)

    @property
    def _home_pose(self) -> FloatArray:
        pose: FloatArray = self.kinematics.forward(self.home[None])[0]
        return pose

    def _reached_turned(self, outwards: FloatArray) -> BoolArray:
        """Return, of shape (n,), whether some branch reaches poses of shape (n, 4) in another of the attitudes."""
        reached, tried = np.zeros(len(outwards), np.bool_), {0}
        for stride in _STRIDES:
            turns_deg = np.array(
                [turn * 360.0 / ATTITUDES for turn in range(0, ATTITUDES, stride) if turn not in tried]
            )
            tried |= {*range(0, ATTITUDES, stride)}
            left = np.flatnonzero(~reached)
            poses = np.repeat(outwards[left], len(turns_deg), axis=0)
            poses[:, 3] += np.tile(turns_deg, len(left))
            found = self._reached(poses).reshape(len(left), len(turns_deg))
            reached[left] = np.logical_or.reduce(found, axis=1)
        return reached

    def _reached(self, poses: FloatArray) -> BoolArray:
        """Return, of shape (n,), whether some branch reaches poses of shape (n, 4)."""
        return self._solved(poses)[0]

    def _solved(self, poses: FloatArray) -> tuple[BoolArray, BoolArray]:
        """Return, each of shape (n,), whether some branch reaches poses of shape (n, 4), or may in another attitude."""
        reached, turnable = np.empty(len(poses), np.bool_), np.ones(len(poses), np.bool_)
        turning = self.kinematics.turning
        for begin in range(0, len(poses), _CHUNK):
            part = slice(begin, begin + _CHUNK)
            branches = self.kinematics.inverse(poses[part], self.home)
            reached[part] = np.logical_or.reduce([branch.reachable for branch in branches])
            if turning is not None:
                turnable[part] = np.logical_or.reduce([branch.reachable_but_for(turning) for branch in branches])
        return reached, turnable


def _shifts(kinematics: Kinematics) -> tuple[tuple[int, int], ...]:
    """Return the column of each slide and the coordinate of the pose that it shifts, 0 for x or 2 for z."""
    return kinematics.slides if isinstance(kinematics, Scara) else ()
