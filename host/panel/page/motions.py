"""The motions that the Run tab offers, planned and checked as on the command line: jobs, trajectory files, programs."""

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Final

import numpy as np

from steptwin.host.common.arrays import FloatArray
from steptwin.host.common.errors import InputError
from steptwin.host.panel.page.option_titles import naming_titles
from steptwin.host.planning.jobs import job_fields, make_job
from steptwin.host.planning.plan import Plan
from steptwin.host.planning.planner import plan, plan_stretched
from steptwin.host.planning.programs import SUFFIX, compile_program, read_program
from steptwin.host.planning.trajectory import Trajectory
from steptwin.host.planning.trajectory_file import SUFFIXES, read_file_motion
from steptwin.host.robots.kinematics import make_kinematics
from steptwin.host.robots.robot import Robot

ENDINGS: Final = (*SUFFIXES, SUFFIX)
"""Endings of the files that can be run."""
_PATH_POINTS: Final = 600
"""Points of a planned path that is shown: as fine as a screen."""


def plan_job(robot: Robot, name: str, options: Mapping[str, str], stretch: float | None) -> Plan:
    """Plan a job with options given as texts; `stretch` as `plan_stretched`. Raises InputError."""
    with naming_titles(job_fields(robot, name)):
        return _planned(robot, make_job(robot, name, options), stretch)


def plan_upload(robot: Robot, name: str, content: bytes, stretch: float | None) -> Plan:
    """Plan the motion in an uploaded file; raise InputError, with the file's own name, if something is wrong in it."""
    with _as_file(name, content) as path:
        if path.endswith(SUFFIX):
            program = compile_program(read_program(path), robot)
            with program.explained(stretch or 1.0):
                return _planned(robot, program.trajectory, stretch)
        motion = read_file_motion(path, robot)
        with motion.explained(stretch or 1.0):
            return _planned(robot, motion.trajectory, stretch)


def path_mm(plan: Plan) -> FloatArray:
    """Return the tool's planned path, shape (n, 3)."""
    t_s = np.linspace(0.0, plan.trajectory.duration_s, _PATH_POINTS)
    return make_kinematics(plan.robot).forward(plan.trajectory.positions(t_s))[:, :3]


def _planned(robot: Robot, trajectory: Trajectory, stretch: float | None) -> Plan:
    return plan(robot, trajectory) if stretch == 1.0 else plan_stretched(robot, trajectory, stretch)


@contextmanager
def _as_file(name: str, content: bytes) -> Iterator[str]:
    """Write a content to a file for the block; errors name the file as its user knows it."""
    plain = Path(name).name
    if not plain.lower().endswith(ENDINGS):
        raise InputError(f"{plain}: a file to run ends in {', '.join(ENDINGS)}")
    with TemporaryDirectory(prefix="steptwin-") as folder:
        path = Path(folder) / f"upload{Path(plain).suffix.lower()}"
        path.write_bytes(content)
        try:
            yield str(path)
        except InputError as error:
            messages = (message.replace(str(path), plain) for message in error.messages)
            raise InputError(*messages).plainly(error.plain.replace(str(path), plain)) from error
