"""Workspaces: the positions that a tool reaches, as a random cloud and as sections with exact boundaries."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Final

import numpy as np

from steptwin.host.common.arrays import FloatArray
from steptwin.host.common.errors import InputError
from steptwin.host.common.planning_time import check_planning_time, in_planning_time, planning_step
from steptwin.host.robots.kinematics import Kinematics, make_kinematics
from steptwin.host.robots.robot import Robot
from steptwin.host.robots.workspace.sections import Scan, has_sections, orientation_words, scan

__all__ = ["SAMPLES_MAX", "MonteCarlo", "Scan", "has_sections", "monte_carlo", "orientation_words", "scan"]
SAMPLES_MAX: Final = 10_000_000

CLOUD_MAX: Final = 20_000
"""Number of positions kept for a picture; more of them would only fill it."""

_CHUNK: Final = 1 << 16

_NOTHING: Final = np.array([np.inf, -np.inf])


@dataclass(frozen=True, slots=True, eq=False)
class MonteCarlo:
    """The tool positions at random joint positions within their limits, slides included.

    Attributes:
        samples: number of joint positions drawn.
        seed: seed of the generator.
        counted: number of them that the mechanism can take; only they count for what follows.
        radius_mm: least and greatest distance from the base's own z axis; None if `counted` is 0.
        z_mm: least and greatest height; None if `counted` is 0.
        cloud_mm: shape (n, 3), the first tool positions, at most `CLOUD_MAX`.
    """

    samples: int
    seed: int
    counted: int
    radius_mm: tuple[float, float] | None
    z_mm: tuple[float, float] | None
    cloud_mm: FloatArray

    @property
    def left_out(self) -> int:
        """Number of samples that the mechanism cannot take."""
        return self.samples - self.counted


@in_planning_time()
def monte_carlo(robot: Robot, samples: int, seed: int) -> MonteCarlo:
    """Draw joint positions and return the tool positions; raise InputError if `samples` or `seed` is out of range.

    The samples are those of `default_rng(seed)` drawing all positions of the first joint, then of the second ...
    """
    if not 1 <= samples <= SAMPLES_MAX:
        raise InputError(f"samples: {samples} is outside 1..{SAMPLES_MAX}")
    if seed < 0:
        raise InputError(f"seed: {seed} is below 0")
    kinematics = make_kinematics(robot)
    if not kinematics.task.width:
        raise InputError(f"{robot.name} has no tool, and so no workspace")
    counted, clouds = 0, [np.empty((0, 3))]
    radius_mm, z_mm = _NOTHING, _NOTHING
    for joints in _drawn(robot, samples, seed):
        with planning_step("the workspace"):
            check_planning_time()
        positions_mm = _positions(kinematics, joints)
        radius_mm = _widened(
            radius_mm, np.hypot(positions_mm[:, 0] - robot.base.x_mm, positions_mm[:, 1] - robot.base.y_mm)
        )
        z_mm = _widened(z_mm, positions_mm[:, 2])
        clouds.append(positions_mm[: max(CLOUD_MAX - counted, 0)])
        counted += len(positions_mm)
    return MonteCarlo(samples, seed, counted, _span(radius_mm), _span(z_mm), np.concatenate(clouds))


def _drawn(robot: Robot, samples: int, seed: int) -> Iterator[FloatArray]:
    """Yield joint positions in chunks of shape (n, joints); each joint has a generator advanced to its share."""
    generators = [
        np.random.Generator(np.random.PCG64(seed).advance(axis * samples)) for axis in range(len(robot.joints))
    ]
    for begin in range(0, samples, _CHUNK):
        count = min(_CHUNK, samples - begin)
        drawn = zip(robot.joints, generators, strict=True)
        yield np.column_stack([generator.uniform(joint.lower, joint.upper, count) for joint, generator in drawn])


def _positions(kinematics: Kinematics, joints: FloatArray) -> FloatArray:
    """Return the tool positions, of shape (n, 3), of the joint positions that the mechanism's usual branch can take."""
    poses = kinematics.forward(joints)
    if not kinematics.keeps_branch:  # a chain can take all joints
        return poses[:, :3]
    if kinematics.attitude_follows:
        poses[:, 3] = np.nan  # the usual branch has another attitude than the joints' own
    branch = kinematics.solve(poses, kinematics.branches[0], near=joints)
    kept = np.logical_and.reduce([constraint.kept for constraint in branch.mechanism])
    return poses[kept, :3]


def _widened(span: FloatArray, values: FloatArray) -> FloatArray:
    return np.array([values.min(initial=span[0]), values.max(initial=span[1])])


def _span(span: FloatArray) -> tuple[float, float] | None:
    least, greatest = span.tolist()
    return (least, greatest) if least <= greatest else None
