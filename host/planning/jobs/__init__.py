"""Jobs: the named motions of each kind of robot, with the experiments of the papers."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Final

import numpy as np

from steptwin.host.common.bad_input import unknown
from steptwin.host.common.planning_time import in_planning_time, planning_step
from steptwin.host.planning.errand import Carry
from steptwin.host.planning.fastest import DriveLimits
from steptwin.host.planning.jobs.carry import CARRY
from steptwin.host.planning.jobs.hybrid_jobs import FIVE_POINTS, HELIX
from steptwin.host.planning.jobs.job import Job, fitted
from steptwin.host.planning.jobs.options import OptionField, number
from steptwin.host.planning.jobs.shelf_jobs import DRAWER_PULL, EVERY_SLOT, FETCH, PULL_LINE, STORE
from steptwin.host.planning.jobs.spiral import SPIRAL
from steptwin.host.planning.laws import Cubic
from steptwin.host.planning.motions.joint_move import JointMove
from steptwin.host.planning.trajectory import Trajectory
from steptwin.host.robots.robot import Robot

__all__ = ["Job", "job_carries", "job_fields", "job_names", "job_options", "job_summary", "make_job"]

START: Final = (0.0, 0.0, 0.0, 0.0)
GOAL: Final = (60.0, -45.0, 100.0, 90.0)
"""th1, th2 in degrees, d3 in mm, th4 in degrees; a joint with narrower limits stops at them."""


@dataclass(frozen=True, slots=True)
class DemoOptions:
    """The options of the demo."""

    duration_s: float = number(2.0, 0.01, 60.0, "s")


def demo(robot: Robot, options: DemoOptions) -> Trajectory:
    """Return the calibration robot's move of all joints at once, by a cubic of time.

    Its paper (ICMEMTC 2016, Atlantis Press, from p. 918) has no experiment: the move is assumed. Raises InputError
    unless the duration is a whole number of milliseconds.
    """
    start, goal = (tuple(fitted(robot, np.array(point)).tolist()) for point in (START, GOAL))
    return JointMove(robot.joint_names, start, goal, Cubic(1.0, options.duration_s))


DEMO: Final = Job("demo", "all joints at once by a cubic of time", DemoOptions, demo)


_JOBS: Final[dict[str, tuple[Job[Any], ...]]] = {
    "lab-scara": (SPIRAL,),
    "warehouse-scara": (DRAWER_PULL, PULL_LINE, STORE, FETCH, EVERY_SLOT),
    "teaching-scara": (CARRY,),
    "calibration-scara": (DEMO,),
    "hybrid-arm": (FIVE_POINTS, HELIX),
}
"""Jobs by the kind of kinematics: a user's robot file with the same mechanism has the same jobs."""


def job_names(robot: Robot) -> tuple[str, ...]:
    """Return the names of the robot's jobs."""
    return tuple(_jobs(robot))


def job_summary(robot: Robot, job_name: str) -> str:
    """Return one line that says what a job does; raise InputError for an unknown job."""
    return _job(robot, job_name).summary


def job_options(robot: Robot, job_name: str) -> dict[str, str]:
    """Return a job's options, each with its default and valid values as text; raise InputError for an unknown job."""
    return {field.name: str(field) for field in job_fields(robot, job_name)}


def job_fields(robot: Robot, job_name: str) -> tuple[OptionField, ...]:
    """Return a job's options as a form shows them; raise InputError for an unknown job."""
    return _job(robot, job_name).fields(robot)


@in_planning_time()
def make_job(
    robot: Robot, job_name: str, options: Mapping[str, str] | None = None, *, drives: DriveLimits | None = None
) -> Trajectory:
    """Return a job's trajectory; options are texts, as on the command line, and may be left out.

    With `drives`, such as `motor_limits` returns, a job with law=fastest is as fast as the motors manage.

    Raises:
        InputError: an unknown job or option, a value out of range, or a motion that the robot cannot make.
    """
    with planning_step(f"job {job_name}"):
        return _job(robot, job_name).make(robot, options or {}, drives)


def job_carries(robot: Robot, job_name: str, options: Mapping[str, str] | None = None) -> tuple[Carry, ...]:
    """Return the boxes that a job carries, in order; none for most jobs. Raises as `make_job` does for its options."""
    return _job(robot, job_name).carried(robot, options or {})


def _jobs(robot: Robot) -> dict[str, Job[Any]]:
    return {job.name: job for job in _JOBS.get(robot.kinematics, ())}


def _job(robot: Robot, job_name: str) -> Job[Any]:
    jobs = _jobs(robot)
    if job_name not in jobs:
        raise unknown("job", job_name, jobs)
    return jobs[job_name]
