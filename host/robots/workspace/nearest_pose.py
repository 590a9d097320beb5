"""Find the reachable pose nearest to one out of reach, for a refusal's message.

Poses are searched in cylindrical coordinates about the arm's own axis, one after the other: at another height, along
the same direction, at the same distance in another direction, and of a SCARA in another attitude; the orientation of a
tool that turns in space stays. If none of these is enough alone, several change. The result has tenths of a mm or
degree, which its text shows exactly.
"""

from dataclasses import dataclass
from itertools import product
from typing import Final

import numpy as np

from steptwin.host.common.arrays import BoolArray, FloatArray
from steptwin.host.common.planning_time import check_planning_time
from steptwin.host.robots.kinematics import Kinematics, make_kinematics
from steptwin.host.robots.poses import PLACE, SCARA, Pose, Task
from steptwin.host.robots.poses.rotations import wrapped_deg
from steptwin.host.robots.robot import Robot

_RADIUS, _AZIMUTH, _Z, _PHI = range(4)
"""Cylindrical coordinates: distance and direction from the arm's axis, height, and a SCARA's attitude."""

_COARSE: Final = 360
"""Values of a coordinate tried at once, over its whole range and then between two of them."""
_FINE: Final = 0.02
"""Distance between two values, in mm or degrees, that ends the search."""
_ROUNDINGS: Final = 60
"""Values tried, one _FINE after the other, until their tenths pass as well."""
_FEW: Final = {_RADIUS: 24, _AZIMUTH: 24, _Z: 24, _PHI: 12}
"""Values of each coordinate tried together, if no coordinate alone is enough."""
_TOGETHER: Final = ((_RADIUS, _Z), (_RADIUS, _AZIMUTH, _Z), (_RADIUS, _AZIMUTH, _Z, _PHI))


def passing_text(
    robot: Robot, pose: Pose, near: FloatArray, branch: str | None = None, *, on_path: bool = False
) -> str:
    """Return, after a semicolon, coordinates that would pass instead; an empty text if none are found."""
    passing = nearest_pose(robot, pose, near, branch, on_path=on_path)
    return "" if passing is None else f"; {passing_words(make_kinematics(robot).task, pose, passing)} passes"


def passing_words(task: Task, pose: Pose, passing: Pose) -> str:
    """Return the coordinates of a passing pose that differ from another pose's, as in `x 120.5, y -3 mm`."""
    both = zip(pose, passing, strict=True)
    units = dict(zip(SCARA.coordinates if task is SCARA else PLACE, both, strict=False))
    changed = {name: new for name, (old, new) in units.items() if new != old and not np.isnan(new)}
    turn = f"phi {changed.pop('phi'):g} deg" if "phi" in changed else ""
    lengths = ", ".join(f"{name} {value:g}" for name, value in changed.items())
    return ", ".join(filter(None, (f"{lengths} mm" if lengths else "", turn)))


def nearest_pose(
    robot: Robot, pose: Pose, near: FloatArray, branch: str | None = None, *, on_path: bool = False
) -> Pose | None:
    """Return the reachable pose, within joint limits, nearest to one; None if none is found.

    `near`, of shape (joints,), is the machine's position: slides stay there. Without a branch any branch may reach the
    pose. With `on_path` it is not near a singularity either. The attitude is NaN if it follows from the arm. A
    mechanism without a closed form is not searched, since that would take minutes.
    """
    if not make_kinematics(robot).has_closed_form:
        return None
    return _Search.of(robot, near, branch, pose[3:], on_path=on_path).nearest(pose)


@dataclass(frozen=True, slots=True, eq=False)
class _Search:
    """The poses that a robot reaches.

    Attributes:
        kinematics: kinematics of the robot.
        near: shape (joints,), its position.
        branches: allowed branches.
        on_path: True if poses near a singularity do not count.
        axis_mm: shape (2,), x and y of the arm's own axis.
        radius_mm: upper bound of the robot's reach from that axis.
        heights_mm: lowest and highest height that it reaches.
        orientation: columns of the wanted pose after x, y and z, which stay except for a SCARA's.
    """

    kinematics: Kinematics
    near: FloatArray
    branches: tuple[str, ...]
    on_path: bool
    axis_mm: FloatArray
    radius_mm: float
    heights_mm: tuple[float, float]
    orientation: Pose

    @classmethod
    def of(cls, robot: Robot, near: FloatArray, branch: str | None, orientation: Pose, *, on_path: bool) -> "_Search":
        kinematics = make_kinematics(robot)
        slides, axis_mm = dict(kinematics.slides), np.array(kinematics.axis_mm(near))
        places = [
            (float(near[i]),) if i in slides else (joint.lower, (joint.lower + joint.upper) / 2.0, joint.upper)
            for i, joint in enumerate(robot.joints)
        ]
        poses = kinematics.forward(np.array([*product(*places)]))
        radius_mm = 1.5 * float(np.nanmax(np.hypot(*(poses[:, :2] - axis_mm).T)))
        heights_mm = float(np.nanmin(poses[:, 2])), float(np.nanmax(poses[:, 2]))
        branches = (branch,) if branch else kinematics.branches
        return cls(kinematics, near, branches, on_path, axis_mm, radius_mm, heights_mm, orientation)

    def nearest(self, pose: Pose) -> Pose | None:
        wanted = self._cylindrical(pose)
        alone = [place for axis in self._axes if (place := self._slid(wanted, wanted, axis)) is not None]
        nearest = min(alone, key=lambda place: self._distances(place, wanted)) if alone else self._anywhere(wanted)
        return None if nearest is None else self._rounded(pose, wanted, nearest)

    @property
    def _turns(self) -> bool:
        """True if the attitude of a pose is a place's fourth coordinate."""
        return self.kinematics.task is SCARA

    @property
    def _axes(self) -> tuple[int, ...]:
        """Coordinates that may change."""
        stays = self.kinematics.attitude_follows or not self._turns
        return (_Z, _RADIUS, _AZIMUTH) if stays else (_Z, _RADIUS, _AZIMUTH, _PHI)

    def _values(self, wanted: FloatArray, axis: int, count: int) -> FloatArray:
        """Return the wanted value and values all over a coordinate's range, those near it first."""
        around = {_RADIUS: (0.0, self.radius_mm), _Z: self.heights_mm}
        lower, upper = around.get(axis, (wanted[axis] - 180.0, wanted[axis] + 180.0))
        values = np.append(np.linspace(lower, upper, count), wanted[axis])
        return values[np.argsort(np.abs(values - wanted[axis]), kind="stable")]

    def _slid(self, place: FloatArray, wanted: FloatArray, axis: int) -> FloatArray | None:
        """Return a place with one coordinate at the passing value nearest to the wanted one; None without one."""
        values = self._values(wanted, axis, _COARSE)
        while True:
            check_planning_time()
            places = np.tile(place, (len(values), 1))
            places[:, axis] = values
            passing = self._pass(places)
            if not passing.any():
                return None
            first = int(np.argmax(passing))
            nearest: FloatArray = places[first]
            side = values[:first][(values[:first] - wanted[axis]) * (nearest[axis] - wanted[axis]) >= 0.0]
            if not len(side) or abs(nearest[axis] - side[-1]) < _FINE:
                return nearest
            values = np.linspace(side[-1], nearest[axis], _COARSE)

    def _anywhere(self, wanted: FloatArray) -> FloatArray | None:
        """Return the nearest of a few places all over the workspace, then refine each coordinate."""
        for axes in _TOGETHER:
            tried = [self._values(wanted, axis, _FEW[axis]) if axis in axes else wanted[[axis]] for axis in range(4)]
            places = np.array([*product(*tried)])
            places = places[self._pass(places)]
            if len(places):
                place: FloatArray = places[np.argmin(self._distances(places, wanted))]
                for axis in reversed(self._axes):
                    slid = self._slid(place, wanted, axis)
                    place = place if slid is None else slid
                return place
        return None

    def _distances(self, places: FloatArray, wanted: FloatArray) -> FloatArray:
        """Return distances of places of shape (..., 4), in mm; a degree of attitude counts as a mm."""
        off = np.nan_to_num(places - wanted)
        off[..., _AZIMUTH] = np.deg2rad(off[..., _AZIMUTH]) * wanted[_RADIUS]
        return np.asarray(np.linalg.norm(off, axis=-1))

    def _rounded(self, pose: Pose, wanted: FloatArray, nearest: FloatArray) -> Pose | None:
        """Return the pose at a place with changed coordinates rounded to tenths, a little farther if necessary."""
        further = np.sign(np.nan_to_num(nearest - wanted)) * _FINE
        poses = self._poses(nearest + np.arange(_ROUNDINGS)[:, np.newaxis] * further)
        tenths = np.round(poses, 1) + 0.0
        changed = nearest != wanted
        same = [not (changed[_RADIUS] or changed[_AZIMUTH])] * 2 + [not changed[_Z]]
        same += [not changed[_PHI]] if self._turns else [True] * len(self.orientation)
        tenths[:, same] = np.array(pose)[same]
        if self.heights_mm[0] == self.heights_mm[1] and changed[_Z]:  # without a lift there is just one height
            tenths[:, 2] = self.heights_mm[0]
        if self.kinematics.attitude_follows:
            tenths[:, 3] = np.nan
        passing = self._reached(tenths)
        return tuple(tenths[np.argmax(passing)].tolist()) if passing.any() else None

    def _cylindrical(self, pose: Pose) -> FloatArray:
        x_mm, y_mm = np.array(pose[:2]) - self.axis_mm
        radius_mm, azimuth_rad = np.hypot(x_mm, y_mm), np.arctan2(y_mm, x_mm)
        attitude_deg = pose[3] if self._turns and not self.kinematics.attitude_follows else np.nan
        return np.array([radius_mm, np.rad2deg(azimuth_rad), pose[2], attitude_deg])

    def _poses(self, places: FloatArray) -> FloatArray:
        azimuth_rad = np.deg2rad(places[:, _AZIMUTH])
        x_mm = self.axis_mm[0] + places[:, _RADIUS] * np.cos(azimuth_rad)
        y_mm = self.axis_mm[1] + places[:, _RADIUS] * np.sin(azimuth_rad)
        orientation = (
            wrapped_deg(places[:, _PHI]) if self._turns else np.tile(np.array(self.orientation), (len(places), 1))
        )
        return np.column_stack([x_mm, y_mm, places[:, _Z], orientation])

    def _pass(self, places: FloatArray) -> BoolArray:
        return self._reached(self._poses(places))

    def _reached(self, poses: FloatArray) -> BoolArray:
        reached: BoolArray = np.logical_or.reduce([self._reached_on(poses, branch) for branch in self.branches])
        return reached

    def _reached_on(self, poses: FloatArray, branch: str) -> BoolArray:
        solved = self.kinematics.solve(poses, branch, self.near)
        singularities = self.kinematics.singularities(solved.joints) if self.on_path else ()
        reached: BoolArray = np.logical_and.reduce([solved.reachable, *(measure.kept for measure in singularities)])
        return reached
