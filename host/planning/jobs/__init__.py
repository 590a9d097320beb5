"""Jobs: the named motions of each kind of robot, which features bring."""

from collections.abc import Mapping
from typing import Any

from steptwin.host.common.bad_input import unknown
from steptwin.host.common.features import giving
from steptwin.host.common.planning_time import in_planning_time, planning_step
from steptwin.host.planning.drives import DriveLimits
from steptwin.host.planning.jobs.job import Job
from steptwin.host.planning.jobs.options import OptionField
from steptwin.host.planning.motion import Motion
from steptwin.host.robots.robot import Robot

__all__ = ["Job", "job_extras", "job_fields", "job_intent", "job_names", "job_options", "job_summary", "make_job"]


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
    """Return a robot's jobs by name; those of later features come first, and replace others of the same name."""
    found: dict[str, Job[Any]] = {}
    for _, jobs in reversed(giving("jobs")):
        found = found | {job.name: job for job in jobs().get(robot.kinematics, ()) if job.name not in found}
    return found


def _job(robot: Robot, job_name: str) -> Job[Any]:
    jobs = _jobs(robot)
    if job_name not in jobs:
        raise unknown("job", job_name, jobs)
    return jobs[job_name]
