"""Measure the kinematics of six-axis arms: one with a closed form and one without, beside EAIK if it is installed.

The time is the processor time of one core, so that other programs count little: the shortest of all runs, in which the
calculations take turns. Ratios are to numpy's sine of as many values as joint values are read or written.
"""

from collections.abc import Callable, Iterator
from dataclasses import replace
from importlib import import_module
from importlib.util import find_spec
from typing import Final

import numpy as np
from rich.table import Table

from steptwin.bench.bench_table import bench_table
from steptwin.bench.host_speed import BATCH, best_s
from steptwin.host.common.arrays import FloatArray
from steptwin.host.robots import load_robot
from steptwin.host.robots.kinematics import Kinematics, make_kinematics
from steptwin.host.robots.kinematics.base import read_geometry
from steptwin.host.robots.kinematics.serial.arm_axes import axes_of
from steptwin.host.robots.kinematics.serial.chain_geometry import ChainGeometry
from steptwin.host.robots.kinematics.serial.serial_arm import SerialArm
from steptwin.host.robots.poses.rotations import matrix
from steptwin.host.robots.robot import Robot

MISS_MM: Final = 1.774
"""Distance of axis 5 from axis 4 in the arm without a closed form: as far as they miss each other in Arctos' URDF."""
NEAR_DEG: Final = 3.0
"""Standard deviation of the joints from which the numeric inverse starts."""
ALONE: Final = 500
"""Poses that EAIK solves one after the other, as its interface has them."""
_WANTED: Final = {"forward": 2e6, "all branches in closed form": 1e5, "from a near start": 1e4}


def arms_table() -> Table:
    """Measure forward kinematics, the inverse with all branches, and that from a near start."""
    arms = {"ar4-mk3": load_robot("ar4-mk3"), f"its axis 5 off by {MISS_MM} mm": _missing()}
    return bench_table(
        f"Six-axis arms: batches of {BATCH}, processor time of one core",
        "arm|way|poses a second|wanted|x numpy sin",
        (row for name, robot in arms.items() for row in _rows(name, robot)),
    )


def _missing() -> Robot:
    """Return the AR4 with its wrist's axes missing each other."""
    robot = load_robot("ar4-mk3")
    geometry = read_geometry(ChainGeometry, robot)
    chain = tuple((name, replace(joint, a_mm=MISS_MM) if name == "J5" else joint) for name, joint in geometry.chain)
    return replace(robot, geometry={**robot.geometry, "chain": chain})


def _rows(name: str, robot: Robot) -> Iterator[str]:
    kinematics = make_kinematics(robot)
    assert isinstance(kinematics, SerialArm)
    lower, upper = ([getattr(joint, end) for joint in robot.joints] for end in ("lower", "upper"))
    rng = np.random.default_rng(1)
    joints = rng.uniform(lower, upper, (BATCH, len(lower)))
    poses, near = kinematics.forward(joints), joints + rng.normal(0.0, NEAR_DEG, joints.shape)
    every = np.tile(joints, (len(kinematics.branches), 1))
    how = "in closed form" if kinematics.has_closed_form else "numerically"
    yield _row(name, "forward", lambda: kinematics.forward(joints), joints)
    yield _row(name, f"all branches {how}", lambda: kinematics.inverse(poses), every)
    yield _row(name, "from a near start", lambda: kinematics.numeric.near(poses, near), joints)
    if kinematics.has_closed_form and find_spec("eaik"):
        alone = np.tile(joints[:ALONE], (len(kinematics.branches), 1))
        yield _row(name, "all branches by EAIK", _eaik(kinematics, robot, poses[:ALONE]), alone, ALONE)


def _row(name: str, way: str, calculate: Callable[[], object], values: FloatArray, count: int = BATCH) -> str:
    """Measure one way for this many poses; `values` are the joints that it reads or writes."""
    angles = np.deg2rad(values)
    sines = np.empty_like(angles)
    sin_s, taken_s = best_s(lambda: np.sin(angles, out=sines), calculate)
    wanted = f"{_WANTED[way]:,.0f}" if way in _WANTED else "-"
    return f"{name}|{way}|{count / taken_s:,.0f}|{wanted}|{taken_s / sin_s:.1f}"


def _eaik(kinematics: Kinematics, robot: Robot, poses: FloatArray) -> Callable[[], object]:
    """Return what solves poses, of shape (n, 7), with EAIK, each by itself."""
    axes = axes_of(kinematics.dh, robot.joint_names)
    points = np.vstack([np.zeros(3), axes.points_mm, axes.home_mm])
    arm = import_module("eaik.IK_HP").HPRobot(axes.directions, np.diff(points, axis=0))
    targets = np.tile(np.eye(4), (len(poses), 1, 1))
    targets[:, :3, :3], targets[:, :3, 3] = matrix(poses[:, 3:]) @ axes.home_rotation.T, poses[:, :3]
    return lambda: [arm.IK(target) for target in targets]
