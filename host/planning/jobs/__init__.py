"""Jobs: the named motions of each kind of robot, with the papers' experiments."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Final

import numpy as np

from steptwin.host.common.bad_input import unknown
from steptwin.host.common.features import giving
from steptwin.host.common.planning_time import in_planning_time, planning_step
from steptwin.host.planning.drives import DriveLimits
from steptwin.host.planning.jobs.carry import CARRY
from steptwin.host.planning.jobs.hybrid_jobs import FIVE_POINTS, HELIX
from steptwin.host.planning.jobs.job import Job, fitted
from steptwin.host.planning.jobs.options import OptionField, number
from steptwin.host.planning.jobs.pull_line import PULL_LINE
from steptwin.host.planning.jobs.spiral import SPIRAL
from steptwin.host.planning.laws import Cubic
from steptwin.host.planning.motion import Motion
from steptwin.host.planning.motions.joint_move import joint_move
from steptwin.host.robots.robot import Robot

__all__ = ["Job", "job_extras", "job_fields", "job_intent", "job_names", "job_options", "job_summary", "make_job"]

START: Final = (0.0, 0.0, 0.0, 0.0)
GOAL: Final = (60.0, -45.0, 100.0, 90.0)
"""th1, th2 in degrees, d3 in mm, th4 in degrees; limited to the joints' ranges."""


@dataclass(frozen=True, slots=True)
class DemoOptions:
    """Options of the demo."""

    duration_s: float = number(2.0, 0.01, 60.0, "s")


def demo(robot: Robot, options: DemoOptions) -> Motion:
    """Return the calibration robot's move of all joints at once, by a cubic of time.

    Its paper (ICMEMTC 2016, Atlantis Press, from p. 918) has no experiment: the move is an assumption. Raises
    InputError if the duration is not a whole number of milliseconds.
    """
    start, goal = (tuple(fitted(robot, np.array(point)).tolist()) for point in (START, GOAL))
    return joint_move(robot.joint_names, start, goal, Cubic(1.0, options.duration_s))


DEMO: Final = Job("demo", "all joints at once by a cubic of time", DemoOptions, demo)


_JOBS: Final[dict[str, tuple[Job[Any], ...]]] = {
    "lab-scara": (SPIRAL,),
    "warehouse-scara": (PULL_LINE,),
    "teaching-scara": (CARRY,),
    "calibration-scara": (DEMO,),
    "hybrid-arm": (FIVE_POINTS, HELIX),
}
"""Jobs by the kind of kinematics: a user's robot file with the same mechanism has the same jobs."""


def job_names(robot: Robot) -> tuple[str, ...]:
    """Return the names of the robot's jobs."""
    return tuple(_jobs(robot))


def job_summary(robot: Robot, job_name: str) -> str:
    """Return a job's summary in one line; raise InputError for an unknown job."""
    return _job(robot, job_name).summary


def job_options(robot: Robot, job_name: str) -> dict[str, str]:
    """Return a job's options, each with its default and valid values as text; raise InputError for an unknown job."""
    return {field.name: str(field) for field in job_fields(robot, job_name)}


def job_fields(robot: Robot, job_name: str) -> tuple[OptionField, ...]:
    """Return a job's options as form fields; raise InputError for an unknown job."""
    return _job(robot, job_name).fields(robot)


@in_planning_time()
def make_job(
    robot: Robot, job_name: str, options: Mapping[str, str] | None = None, *, drives: DriveLimits | None = None
) -> Motion:
    """Return a job's motion; options are texts, as on the command line, and may be left out.

    With `drives`, such as `motor_limits` returns, a job with law=fastest uses the motors' limits.

    Raises:
        InputError: an unknown job or option, a value out of range, or a motion that the robot cannot make.
    """
    with planning_step(f"job {job_name}"):
        return _job(robot, job_name).make(robot, options or {}, drives)


def job_intent(robot: Robot, job_name: str, options: Mapping[str, str] | None = None) -> Any:
    """Return a job's intent for a feature besides its motion; None for most jobs. Raises as `make_job` for options."""
    return _job(robot, job_name).intended(robot, options or {})


def job_extras(robot: Robot, job_name: str, options: Mapping[str, str] | None = None) -> list[Any]:
    """Return options of the emulated machine for a job, by its intent.

    Raises:
        InputError: as `make_job` for its options.
    """
    intent = job_intent(robot, job_name, options)
    made = [extra(robot, intent) for _, extra in giving("job_extra")] if intent is not None else []
    return [extra for extra in made if extra is not None]


def _jobs(robot: Robot) -> dict[str, Job[Any]]:
    """Return a robot's jobs by name; jobs of features replace the core's of the same name."""
    own = {job.name: job for job in _JOBS.get(robot.kinematics, ())}
    of_features = {job.name: job for _, jobs in giving("jobs") for job in jobs().get(robot.kinematics, ())}
    return of_features | {name: job for name, job in own.items() if name not in of_features}


def _job(robot: Robot, job_name: str) -> Job[Any]:
    jobs = _jobs(robot)
    if job_name not in jobs:
        raise unknown("job", job_name, jobs)
    return jobs[job_name]
