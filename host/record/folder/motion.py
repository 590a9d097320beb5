"""Write and read trajectory.csv: the planned motion as points with velocities, cubic between two points.

`steptwin run ROBOT trajectory.csv` makes the same motion again.
"""

from collections.abc import Sequence
from dataclasses import replace
from math import inf
from pathlib import Path
from typing import TYPE_CHECKING, Final

import numpy as np
import scipy

from steptwin.host.common.arrays import FloatArray, Int64Array
from steptwin.host.common.whole_file import whole_file
from steptwin.host.planning.plan import Plan
from steptwin.host.planning.trajectory import Switching, Trajectory
from steptwin.host.planning.trajectory_file import read_trajectory_until
from steptwin.host.record.folder.layout import TRAJECTORY, existing_file
from steptwin.host.robots.robot import Robot

if TYPE_CHECKING:
    from scipy.interpolate import CubicHermiteSpline

CUBICS_OFF_STEPS: Final = 1e-4
"""Largest distance of the stored cubics from the planned motion: a 75th of the verifier's tolerance."""


def write_motion(path: Path, plan: Plan) -> None:
    """Write the plan's PVT points, or every millisecond if cubics between the points are too far from the motion.

    Numbers are written with all their digits, so that reading gives the same values.
    """
    t_s = _stored_ms(plan) / 1000
    motion = plan.trajectory
    rows = zip(t_s.tolist(), motion.positions(t_s).tolist(), motion.velocities(t_s).tolist(), strict=True)
    with whole_file(path) as file:
        file.write(trajectory_head(plan.robot).encode())
        file.writelines(trajectory_row(*row).encode() for row in rows)


def trajectory_head(robot: Robot) -> str:
    """Return the file's first line."""
    names = robot.joint_names
    return ",".join(("t", *names, *(f"v_{name}" for name in names))) + "\n"


def trajectory_row(t_s: float, positions: Sequence[float], velocities: Sequence[float]) -> str:
    """Return the line of a point: time in s, positions in mm and deg, velocities in mm/s and deg/s."""
    return ",".join(map(repr, (t_s, *positions, *velocities))) + "\n"


def read_motion(folder: Path, robot: Robot, switchings: Sequence[Switching], until_s: float = inf) -> Trajectory:
    """Return the stored motion, or its part up to an instant, with the planned changes of outputs.

    Raises:
        InputError: the file is missing, or `read_trajectory_until` refuses it.
    """
    path = existing_file(folder, TRAJECTORY)
    end_s = min((until_s, *(change.from_s for change in switchings if change.until_s > until_s)))
    known = tuple(change for change in switchings if change.until_s <= end_s)
    return replace(read_trajectory_until(end_s, str(path), robot), switchings=known)


def _stored_ms(plan: Plan) -> Int64Array:
    """Return the times of the points to store, in milliseconds."""
    every_ms = np.arange(plan.times_ms[-1] + 1)
    t_s, point_s = every_ms / 1000, plan.times_ms / 1000
    motion = plan.trajectory
    cubics = scipy.interpolate.CubicHermiteSpline(point_s, motion.positions(point_s), motion.velocities(point_s))
    off_steps = np.abs(plan.robot.to_steps(_positions(cubics, t_s) - motion.positions(t_s)))
    return plan.times_ms if off_steps.max() <= CUBICS_OFF_STEPS else every_ms


def _positions(cubics: "CubicHermiteSpline", t_s: FloatArray) -> FloatArray:
    return np.asarray(cubics(t_s))
