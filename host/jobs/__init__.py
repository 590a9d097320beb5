"""Jobs: the named motions of each kind of robot, the experiments of the papers among them."""

from collections.abc import Mapping
from typing import Final

from host.inputs import unknown
from host.jobs.drawer_pull import DRAWER_PULL
from host.jobs.job import Job
from host.robot import Robot
from host.trajectory import Trajectory

__all__ = ["Job", "job_names", "make_job"]

_JOBS: Final[dict[str, tuple[Job, ...]]] = {
    "warehouse-scara": (DRAWER_PULL,),
}
"""By the kind of kinematics, so that a user's own file of the same mechanism has the same jobs."""


def job_names(robot: Robot) -> tuple[str, ...]:
    """What the robot can be asked to do."""
    return tuple(job.name for job in _JOBS.get(robot.kinematics, ()))


def make_job(robot: Robot, job_name: str, options: Mapping[str, str]) -> Trajectory:
    """A job's trajectory; options are texts as on the command line, those not given take their defaults.

    Raises:
        InputError: no such job or option, a value out of range, or a motion that the robot cannot make.
    """
    for job in _JOBS.get(robot.kinematics, ()):
        if job.name == job_name:
            return job.make(robot, options)
    raise unknown("job", job_name, job_names(robot))
