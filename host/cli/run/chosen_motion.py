"""Choose the motion of `steptwin run`: a job, a program or a trajectory file, as fast as the options ask for."""

from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager, nullcontext
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Final, Literal, NamedTuple

from steptwin.host.cli.arguments import AnswerOptions, check_percent, positive_number
from steptwin.host.cli.options import given_options, naming_options, option, with_options
from steptwin.host.cli.output import say, warn
from steptwin.host.common.bad_input import prefixed
from steptwin.host.common.errors import InputError
from steptwin.host.common.features import drive_model

if TYPE_CHECKING:
    from steptwin.host.planning.drives import DriveLimits
    from steptwin.host.planning.plan import Plan
    from steptwin.host.planning.polygon import Departure
    from steptwin.host.planning.trajectory import Trajectory
    from steptwin.host.planning.trajectory_file import FileMotion
    from steptwin.host.robots.robot import Robot


InterpolationName = Literal["spline", "linear", "stop"]
"""The values of `steptwin.host.planning.trajectory_file.Interpolation`, which is imported only when it is needed."""

_SHOWN: Final = 0.0005
"""Smallest departure that three decimals show."""

_KINDS: Final = {
    "spline": "a spline",
    "linear": "straight lines with blends",
    "stop": "straight lines with stops",
    None: "cubics between velocities",
}
_REMEDIES: Final = {
    "spline": "--interpolate linear or stop keeps closer, and so do more points",
    "linear": "--interpolate stop keeps closer, and so does more time",
}
_REMEDY_FOR_THE_TOOL: Final = "more points or a program's `line` steps keep closer"
"""Between the poses of a file the tool follows the joints, whatever the interpolation."""


@dataclass(frozen=True, slots=True)
class FileOptions:
    """The options that only a trajectory file takes; None where one is not given."""

    interpolate: InterpolationName | None = option(
        "spline|linear|stop",
        "Motion between a file's points: a spline, straight lines of the joints with blends, or with stops.",
    )
    ramps: float | None = option(
        "SECONDS", "Duration of a run-in and run-out for a file that is in motion there.", read=positive_number
    )
    units: str | None = option("rad,m", "Units of a file's angles, deg or rad, and of its lengths, mm or m.")

    def refuse(self) -> None:
        """Raise InputError for an option that is given, beside a job or a program."""
        for name, value in given_options(self).items():
            text = f"{value:g}" if isinstance(value, float) else value
            raise InputError(f"{name} {text}: is for a trajectory file")

    def read(
        self, robot: "Robot", path: str, options: dict[str, str], drives: "DriveLimits | None" = None
    ) -> "FileMotion":
        """Return the motion in a file; raise InputError as `read_trajectory` does, or for a job's options."""
        from steptwin.host.planning.trajectory_file import read_file_motion

        for name in options:
            if name not in ("elbow", "law"):
                raise InputError(f"option {name}: a trajectory from a file has no options")
        with naming_options("interpolate", "elbow", "units", "law", ramps_s="--ramps"):
            return read_file_motion(
                path,
                robot,
                interpolate=self.interpolate,
                ramps_s=self.ramps or 0.0,
                elbow=options.get("elbow"),
                units=self.units,
                law=options.get("law"),
                drives=drives,
            )


@dataclass(frozen=True, slots=True)
class SpeedOptions:
    """The options that make a motion slower, or as fast as the motors manage; None where one is not given."""

    stretch: str | None = option(
        "FACTOR|auto", "Make the motion this many times slower; auto: just as slow as it must be."
    )
    speed: str | None = option("PERCENT", "Speed of the motion, from 1: 50 is the same as --stretch 2.")
    left_percent: float | None = option(
        "PERCENT", "With --law fastest: as fast as the motors manage, with so much of their torque left, such as 30."
    )

    @property
    def given(self) -> bool:
        """True if the motion is to be slower."""
        return self.stretch is not None or self.speed is not None

    def drives(self, robot: "Robot") -> "DriveLimits | None":
        """Return the motors that limit the motion; None without the option."""
        if self.left_percent is None:
            return None
        from steptwin.host.planning.drives import AskedLimits, known_drives

        with prefixed("--left-percent: "):
            return AskedLimits(self.left_percent).drives(robot, known_drives())

    def factor(self) -> float | None:
        """Return how many times slower the motion is to be; None without either option, and for `--stretch auto`."""
        if self.stretch is not None and self.speed is not None:
            raise InputError(f"--stretch {self.stretch} --speed {self.speed}: give only one of them")
        if self.speed is not None:
            percent = positive_number(self.speed, "--speed")
            check_percent(percent, "--speed")
            return 100.0 / percent
        return None if self.stretch in (None, "auto") else positive_number(self.stretch, "--stretch")


def _is(what: str) -> str:
    return "are" if what.endswith("s") else "is"


def _summary(file: "FileMotion", plan: "Plan") -> str:
    from steptwin.host.planning.peaks import Quantity

    peak = plan.highest(Quantity.SPEED)
    branch = f" {file.points.branch_words}".rstrip()
    ramps = f" and ramps of {file.ramps_s:g} s" if file.ramps_s else ""
    if file.is_fastest:
        ramps = " in the least time"
    return (
        f"{len(file.points.times_s)} points{branch} in {plan.trajectory.duration_s:.3f} s,"
        f" {_KINDS[file.interpolation]}{ramps}, peak speed {peak.percent:.3g} % of the limit ({peak.joint})"
    )


def _warning(file: "FileMotion", large: "list[Departure]") -> str:
    """Return where the motion is farthest off, measured by what is allowed, and what keeps closer."""
    worst = max(large, key=lambda departure: departure.distance / departure.allowed)
    remedy = _REMEDIES[file.interpolation or "spline"] if file.points.tool_mm is None else _REMEDY_FOR_THE_TOOL
    size = f"{worst.what} {worst.distance:.3g} {worst.unit} at t = {worst.t_s:.3f} s"
    return f"far off the lines between the points: {size} (limit {worst.allowed:.3g} {worst.unit}); {remedy}"


@dataclass(frozen=True, slots=True)
class ChosenMotion:
    """The motion that a command line names, planned.

    Attributes:
        job: name of the job, the program or the file.
        plan: the motion, checked.
        file: the motion with its file's points; None for a job or a program.
        doubted: what is to be asked about the file's units; None if nothing is.
    """

    job: str
    plan: "Plan"
    file: "FileMotion | None"
    doubted: str | None = None

    def say_summary(self, answer: AnswerOptions) -> None:
        """Print what a trajectory file amounts to, and how far the motion leaves the lines between its points.

        Then print what is doubtful about it. Of a job or a program, print nothing.
        """
        file, path = self.file, self.job
        if file is None:
            return
        departures = file.departures()
        answer.add(f"{path}: {_summary(file, self.plan)}")
        if any(departure.distance >= _SHOWN for departure in departures):
            sizes = ", ".join(f"{departure.what} {departure.distance:.3f} {departure.unit}" for departure in departures)
            answer.add(f"{path}: off the lines between the points by {sizes}")
        if file.points.begun_at_home:
            first_s = float(file.points.times_s[1])
            answer.add(f"{path}: begins at the robot's home position, {first_s:g} s before the first point")
        if unread := file.points.unread:
            many = f"{unread[0]} to {unread[-1]} are" if len(unread) > 1 else f"{unread[0]} {_is(unread[0])}"
            answer.add(f"{path}: {many} not read: positions and velocities alone make the motion")
        if rounded_s := file.points.rounded_s:
            answer.add(f"{path}: times are rounded to whole milliseconds, by up to {1e3 * rounded_s:.2g} ms")
        if large := [departure for departure in departures if departure.is_large]:
            warn(f"{path}: {_warning(file, large)}")
        if self.doubted:
            warn(f"{path}: {with_options(self.doubted, 'units')}")


def choose_motion(
    robot: "Robot", job: str, options: dict[str, str], file_options: FileOptions, speed_options: SpeedOptions
) -> ChosenMotion:
    """Return the motion that a command line names; raise InputError, with the option, if the robot cannot make it."""
    trajectory, file, explained, is_foretold = _motion(robot, job, options, file_options, speed_options.drives(robot))
    plan = _planned(robot, trajectory, speed_options, explained)
    model = drive_model() if is_foretold else None
    if model is not None and (forecast := model.forecast(robot, plan.trajectory)):
        warn(f"{job}: {forecast}")
    if file is None or file_options.units:
        return ChosenMotion(job, plan, file)
    from steptwin.host.planning.trajectory_file import doubt

    return ChosenMotion(
        job, plan, file, doubt(file, plan, lambda units: replace(file_options, units=units).read(robot, job, options))
    )


_Explained = Callable[[float], AbstractContextManager[None]]
"""Says more about the refusal of a motion that was stretched by a factor."""


class _Motion(NamedTuple):
    """A motion, its points if a trajectory file has them, what explains its refusal, and if its motors are foretold."""

    trajectory: "Trajectory"
    file: "FileMotion | None"
    explained: _Explained
    is_foretold: bool = False


def _motion(
    robot: "Robot", job: str, options: dict[str, str], file_options: FileOptions, drives: "DriveLimits | None"
) -> _Motion:
    """Return the motion that a command line names."""
    from steptwin.host.planning.jobs import job_names, make_job
    from steptwin.host.planning.programs import SUFFIX
    from steptwin.host.planning.trajectory_file import SUFFIXES, is_trajectory_file

    if is_trajectory_file(job):
        file = file_options.read(robot, job, options, drives)
        return _Motion(file.trajectory, file, file.explained)
    file_options.refuse()
    if job.endswith(SUFFIX):
        if drives is not None:
            raise InputError("--left-percent: a program asks itself, by [limits] left_percent (docs/motors.md)")
        return _program(robot, job, options)
    if Path(job).is_file():
        raise InputError(f"{job}: a trajectory file ends in {', '.join(SUFFIXES)}")
    here = [name for suffix in (SUFFIX, *SUFFIXES) if Path(name := f"{job}{suffix}").is_file()]
    if here and job not in job_names(robot):
        raise InputError(f"job {job!r} is unknown: did you mean {' or '.join(here)}, the file here?")
    with naming_options("law"):
        motion = make_job(robot, job, options, drives=drives)
    return _Motion(motion, None, lambda _: nullcontext())


def _program(robot: "Robot", path: str, options: dict[str, str]) -> _Motion:
    from steptwin.host.planning.drives import known_drives
    from steptwin.host.planning.programs import compile_program, read_program

    if options:
        raise InputError(f"option {next(iter(options))}: a program has no options")
    try:
        program = read_program(path)
        with prefixed(f"{path}: "):
            compiled = compile_program(program, robot, drives=known_drives())
    except InputError as error:
        if len(error.messages) == 1:
            raise
        raise InputError(f"{error}; more is wrong, `steptwin check` tells it all") from error
    for row in compiled.steps:
        drives = () if row.drives is None else (str(row.drives),)
        say(*(f"{path}: {row.place}: {sentence}" for sentence in (*row.passed(), *drives)), err=True)

    @contextmanager
    def explained(stretch: float) -> Iterator[None]:
        with prefixed(f"{path}: "), compiled.explained(stretch):
            yield

    return _Motion(compiled.trajectory, None, explained, program.limits is None)


def _planned(robot: "Robot", trajectory: "Trajectory", speed_options: SpeedOptions, explained: _Explained) -> "Plan":
    """Plan a motion as slow as the options want it, and say what that makes of it."""
    from steptwin.host.planning.planner import plan, plan_stretched

    factor = speed_options.factor()
    with naming_options("stretch", "interpolate", ramps_s="--ramps"), explained(factor or 1.0):
        if not speed_options.given:
            return plan(robot, trajectory)
        planned = plan_stretched(robot, trajectory, factor)
    new_s, old_s = planned.trajectory.duration_s, trajectory.duration_s
    if planned.trajectory is trajectory:
        say("not stretched: it is slow enough", err=True)
    else:
        say(f"stretched {new_s / old_s:.4g} times: {new_s:.3f} s instead of {old_s:.3f} s", err=True)
    return planned
