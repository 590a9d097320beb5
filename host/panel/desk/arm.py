"""The arm as a page draws it, computed only when it has moved."""

from collections.abc import Mapping

import numpy as np

from steptwin.host.common.arrays import FloatArray
from steptwin.host.robots.kinematics import make_kinematics
from steptwin.host.robots.kinematics.base import POSE_KEYS
from steptwin.host.robots.robot import Robot


class Arm:
    """A robot's tool pose and polylines at the joint position that was given last."""

    def __init__(self, robot: Robot) -> None:
        self.robot = robot
        self._kinematics = make_kinematics(robot)
        self._positions: list[float] = []
        self.pose: Mapping[str, float] | None = None
        """The tool's pose; None where the mechanism cannot be assembled."""
        self.links_mm: tuple[FloatArray, ...] = ()
        """The arm's polylines, each of shape (n, 3)."""

    def move_to(self, positions: list[float]) -> None:
        """Take a joint position in mm and degrees."""
        if positions == self._positions:
            return
        self._positions = positions
        joints = np.array([positions])
        pose = self._kinematics.forward(joints)[0]
        assembled = bool(np.isfinite(pose).all())
        self.pose = dict(zip(POSE_KEYS, pose.tolist(), strict=True)) if assembled else None
        self.links_mm = tuple(link.points_mm[0] for link in self._kinematics.links(joints))
