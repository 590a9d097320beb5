"""The hybrid arm as a multibody program sees it: constraint equations of its loop, solved by Newton's method.

It is the independent check that the paper made with ADAMS. Nothing of the closed forms in `hybrid` is used:
the unknowns are the coordinates of the bodies, waist th1, sliders Z5 and Z6, both links' slopes b5 and b6, and the
gripper th4; the equations say that the links end at one point c and that the tool is at its pose:

    (-h + L cos b5) - (h + L cos b6) = 0          Z5 + L sin b5 - (Z6 + L sin b6) = 0
    rho cos th1 = X        rho sin th1 = Y        rho = l2 + (-h + L cos b5) + l3
    l1 + (Z5 + L sin b5) - l4 = Z                 th1 + th4 = phi

Each sample begins at the solution of the sample before, so that the mechanism keeps its working mode because it moves
there continuously, and not because a formula's sign chooses it.

Source of the method: E. J. Haug, "Computer Aided Kinematics and Dynamics of Mechanical Systems", 1989, chapter 3.
"""

from dataclasses import dataclass
from typing import Final, Self

import numpy as np

from steptwin.features.papers.hybrid_arm import HybridGeometry
from steptwin.host.common.arrays import FloatArray, Int64Array
from steptwin.host.common.errors import InputError
from steptwin.host.robots.kinematics.base import read_geometry
from steptwin.host.robots.poses.rotations import wrapped_deg
from steptwin.host.robots.robot import Robot

CLOSED_MM: Final = 1e-10
"""Largest residual of a closed loop, in mm and, for the attitude, rad: above it Newton's method goes on."""

STEPS_MAX: Final = 30
"""Newton steps after which a loop counts as one that cannot be closed; 4 to 6 are usual."""

_TH1, _Z5, _Z6, _B5, _B6, _TH4 = range(6)
"""Places of the coordinates: angles in radians, sliders in mm."""


@dataclass(frozen=True, slots=True, eq=False)
class Solution:
    """The mechanism at n samples.

    Attributes:
        joints: shape (n, 4), th1, Z5, Z6, th4 in degrees and mm.
        slopes_deg: shape (n, 2), the slopes of both links against the horizontal.
        poses: shape (n, 4), the tool's X, Y, Z in mm and phi in degrees.
        residual: largest residual of all equations and samples.
        steps: largest number of Newton steps that a sample took.
    """

    joints: FloatArray
    slopes_deg: FloatArray
    poses: FloatArray
    residual: float
    steps: int


@dataclass(frozen=True, slots=True)
class LoopClosure:
    """The constraint equations of a mechanism with these dimensions."""

    geometry: HybridGeometry

    @classmethod
    def of(cls, robot: Robot) -> Self:
        """Return a robot's equations; raise InputError if its dimensions are not this mechanism's."""
        return cls(read_geometry(HybridGeometry, robot))

    def driven_at_the_tool(self, poses: FloatArray) -> Solution:
        """Prescribe the tool's poses, of shape (n, 4), and return the joints: the paper's first simulation.

        Raises:
            InputError: the loop cannot be closed at a pose.
        """
        coordinates = self._assembled()
        coordinates[_TH1] = np.arctan2(poses[0, 1], poses[0, 0])  # only where the search begins
        return self._solved(poses, coordinates, np.arange(6))

    def driven_at_the_joints(self, joints: FloatArray) -> Solution:
        """Prescribe the joints, of shape (n, 4), and return the tool's poses: the paper's second simulation.

        Raises:
            InputError: the loop cannot be closed at a sample.
        """
        return self._solved(joints, self._assembled(), np.array([_B5, _B6]))

    def _assembled(self) -> FloatArray:
        """Return the coordinates as the machine is drawn: both sliders at 0, the links rising to a point between."""
        slope_rad = np.arccos(self.geometry.h_mm / self.geometry.L_mm)
        return np.array([0.0, 0.0, 0.0, slope_rad, np.pi - slope_rad, 0.0])

    def _solved(self, given: FloatArray, coordinates: FloatArray, unknowns: Int64Array) -> Solution:
        solved, most = np.empty((len(given), 6)), 0
        residual, at_tool = 0.0, len(unknowns) == 6
        for i, sample in enumerate(given):
            if not at_tool:
                coordinates[[_TH1, _Z5, _Z6, _TH4]] = self._in_radians(sample)
            coordinates, steps, left = self._newton(coordinates, unknowns, sample if at_tool else None, i)
            solved[i], most, residual = coordinates, max(most, steps), max(residual, left)
        poses = np.array([self._pose(coordinates) for coordinates in solved])
        return Solution(self._joints(solved), np.rad2deg(solved[:, [_B5, _B6]]), poses, residual, most)

    def _newton(
        self, start: FloatArray, unknowns: Int64Array, pose: FloatArray | None, sample: int
    ) -> tuple[FloatArray, int, float]:
        """Return the coordinates that fulfil the equations, the number of steps, and the largest residual."""
        coordinates = start.copy()
        for step in range(STEPS_MAX):
            residuals = self._residuals(coordinates, pose)
            left = float(np.abs(residuals).max())
            if left <= CLOSED_MM:
                return coordinates, step, left
            try:
                change = np.linalg.solve(self._jacobian(coordinates, pose)[:, unknowns], residuals)
            except np.linalg.LinAlgError:
                break
            coordinates[unknowns] -= change
        raise InputError(f"sample {sample}: the loop of the mechanism does not close within {STEPS_MAX} Newton steps")

    def _residuals(self, coordinates: FloatArray, pose: FloatArray | None) -> FloatArray:
        """Return the residuals of the loop, shape (2,), and with a pose also of the tool, shape (6,)."""
        h, length = self.geometry.h_mm, self.geometry.L_mm
        _, z5, z6, b5, b6, _ = coordinates
        loop = [
            (-h + length * np.cos(b5)) - (h + length * np.cos(b6)),
            (z5 + length * np.sin(b5)) - (z6 + length * np.sin(b6)),
        ]
        if pose is None:
            return np.array(loop)
        x, y, z, phi_deg = self._pose(coordinates) - pose
        return np.array([*loop, x, y, z, np.deg2rad(wrapped_deg(np.array(phi_deg)))])

    def _jacobian(self, coordinates: FloatArray, pose: FloatArray | None) -> FloatArray:
        """Return the derivatives of the residuals by all coordinates, shape (2, 6) or (6, 6)."""
        geometry, length = self.geometry, self.geometry.L_mm
        th1, _, _, b5, b6, _ = coordinates
        across, up = -length * np.sin(b5), length * np.cos(b5)  # how the left link's end moves with b5
        loop = [
            [0.0, 0.0, 0.0, across, length * np.sin(b6), 0.0],
            [0.0, 1.0, -1.0, up, -length * np.cos(b6), 0.0],
        ]
        if pose is None:
            return np.array(loop)
        rho = geometry.l2_mm - geometry.h_mm + length * np.cos(b5) + geometry.l3_mm
        tool = [
            [-rho * np.sin(th1), 0.0, 0.0, across * np.cos(th1), 0.0, 0.0],
            [rho * np.cos(th1), 0.0, 0.0, across * np.sin(th1), 0.0, 0.0],
            [0.0, 1.0, 0.0, up, 0.0, 0.0],
            [1.0, 0.0, 0.0, 0.0, 0.0, 1.0],
        ]
        return np.array([*loop, *tool])

    def _pose(self, coordinates: FloatArray) -> FloatArray:
        """Return the tool's pose, in mm and degrees, by way of the left slider and link."""
        geometry = self.geometry
        th1, z5, _, b5, _, th4 = coordinates
        rho = geometry.l2_mm + (-geometry.h_mm + geometry.L_mm * np.cos(b5)) + geometry.l3_mm
        height = geometry.l1_mm + (z5 + geometry.L_mm * np.sin(b5)) - geometry.l4_mm
        phi_deg = wrapped_deg(np.rad2deg(np.array(th1 + th4)))
        return np.array([rho * np.cos(th1), rho * np.sin(th1), height, float(phi_deg)])

    @staticmethod
    def _in_radians(joints: FloatArray) -> FloatArray:
        th1_deg, z5_mm, z6_mm, th4_deg = joints
        return np.array([np.deg2rad(th1_deg), z5_mm, z6_mm, np.deg2rad(th4_deg)])

    @staticmethod
    def _joints(coordinates: FloatArray) -> FloatArray:
        th1_deg, th4_deg = (wrapped_deg(np.rad2deg(coordinates[:, angle])) for angle in (_TH1, _TH4))
        return np.column_stack([th1_deg, coordinates[:, _Z5], coordinates[:, _Z6], th4_deg])
