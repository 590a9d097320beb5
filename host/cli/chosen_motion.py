"""Choose the motion of `steptwin run`: a job, a program or a trajectory file, as fast as the options ask for."""

from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager, nullcontext
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from steptwin.host.cli.arguments import check_percent, positive_number
from steptwin.host.cli.file_motion import InterpolationName, file_motion, refuse_file_options, say_file_motion
from steptwin.host.cli.option_names import naming_options
from steptwin.host.cli.output import say
from steptwin.host.common.bad_input import prefixed
from steptwin.host.common.errors import InputError

if TYPE_CHECKING:
    from steptwin.host.planning.plan import Plan
    from steptwin.host.planning.trajectory import Trajectory
    from steptwin.host.planning.trajectory_file import FileMotion
    from steptwin.host.robots.robot import Robot


@dataclass(frozen=True, slots=True)
class ChosenMotion:
    """The motion that a command line names, planned.

    Attributes:
        job: name of the job, the program or the file.
        plan: the motion, checked.
        file: the motion with its file's points; None for a job or a program.
        stretched: True if --stretch or --speed was given.
    """

    job: str
    plan: "Plan"
    file: "FileMotion | None"
    stretched: bool

    def say_summary(self, *, to_stderr: bool) -> None:
        """Print what a trajectory file amounts to; nothing of a job or a program."""
        if self.file is not None:
            say_file_motion(self.job, self.file, self.plan, stretched=self.stretched, to_stderr=to_stderr)


def choose_motion(
    robot: "Robot",
    job: str,
    options: dict[str, str],
    *,
    interpolate: InterpolationName | None,
    ramps: str | None,
    stretch: str | None,
    speed: str | None,
) -> ChosenMotion:
    """Return the motion that a command line names; raise InputError, with the option, if the robot cannot make it."""
    trajectory, file, explained = _motion(robot, job, options, interpolate, ramps)
    plan = _planned(robot, trajectory, stretch, speed, explained)
    return ChosenMotion(job, plan, file, stretched=bool(stretch or speed))


_Explained = Callable[[float], AbstractContextManager[None]]
"""Says more about the refusal of a motion that was stretched by a factor."""


def _motion(
    robot: "Robot", job: str, options: dict[str, str], interpolate: InterpolationName | None, ramps: str | None
) -> "tuple[Trajectory, FileMotion | None, _Explained]":
    """Return a motion, with its points if a trajectory file has them, and what explains its refusal."""
    from steptwin.host.planning.jobs import job_names, make_job
    from steptwin.host.planning.programs import SUFFIX
    from steptwin.host.planning.trajectory_file import SUFFIXES, is_trajectory_file

    if is_trajectory_file(job):
        file = file_motion(robot, job, options, interpolate, ramps)
        return file.trajectory, file, file.explained
    refuse_file_options(interpolate, ramps)
    if job.endswith(SUFFIX):
        return _program(robot, job, options)
    if Path(job).is_file():
        raise InputError(f"{job}: a trajectory file ends in {' or '.join(SUFFIXES)}")
    here = [name for suffix in (SUFFIX, *SUFFIXES) if Path(name := f"{job}{suffix}").is_file()]
    if here and job not in job_names(robot):
        raise InputError(f"job {job!r} is unknown: did you mean {' or '.join(here)}, the file here?")
    return make_job(robot, job, options), None, lambda _: nullcontext()


def _program(robot: "Robot", path: str, options: dict[str, str]) -> "tuple[Trajectory, None, _Explained]":
    from steptwin.host.planning.programs import compile_program, read_program

    if options:
        raise InputError(f"option {next(iter(options))}: a program has no options")
    try:
        program = read_program(path)
        with prefixed(f"{path}: "):
            compiled = compile_program(program, robot)
    except InputError as error:
        if len(error.messages) == 1:
            raise
        raise InputError(f"{error}; more is wrong, `steptwin check` tells it all") from error

    @contextmanager
    def explained(stretch: float) -> Iterator[None]:
        with prefixed(f"{path}: "), compiled.explained(stretch):
            yield

    return compiled.trajectory, None, explained


def _planned(
    robot: "Robot", trajectory: "Trajectory", stretch: str | None, speed: str | None, explained: _Explained
) -> "Plan":
    """Plan a motion with the slowness that --stretch or --speed asks for, and say what that makes of it."""
    from steptwin.host.planning.planner import plan, plan_stretched

    factor = _stretch_factor(stretch, speed)
    with naming_options("stretch", "interpolate", ramps_s="--ramps"), explained(factor or 1.0):
        if stretch is None and speed is None:
            return plan(robot, trajectory)
        planned = plan_stretched(robot, trajectory, factor)
    new_s, old_s = planned.trajectory.duration_s, trajectory.duration_s
    if planned.trajectory is trajectory:
        say("not stretched: it is slow enough", err=True)
    else:
        say(f"stretched {new_s / old_s:.4g} times: {new_s:.3f} s instead of {old_s:.3f} s", err=True)
    return planned


def _stretch_factor(stretch: str | None, speed: str | None) -> float | None:
    """Return the factor that --stretch or --speed gives; None without them, and for `auto`."""
    if stretch is not None and speed is not None:
        raise InputError(f"--stretch {stretch} --speed {speed}: give only one of them")
    if speed is not None:
        percent = positive_number(speed, "--speed")
        check_percent(percent, "--speed")
        return 100.0 / percent
    return None if stretch in (None, "auto") else positive_number(stretch, "--stretch")
