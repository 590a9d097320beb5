"""Choose the motion of `steptwin run`: a job, a program or a trajectory file, with its speed."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import AbstractContextManager, contextmanager, nullcontext
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Final, NamedTuple

from steptwin.host.cli.arguments import AnswerOptions, finite_number, positive_number
from steptwin.host.cli.options import naming_options, of_features, option, with_options
from steptwin.host.cli.output import say, warn
from steptwin.host.common.bad_input import prefixed, unknown
from steptwin.host.common.choices import name_value_pairs
from steptwin.host.common.errors import InputError
from steptwin.host.common.features import FileOptions, drive_model

if TYPE_CHECKING:
    from steptwin.host.planning.drives import DriveLimits
    from steptwin.host.planning.motion import Motion
    from steptwin.host.planning.plan import Plan
    from steptwin.host.planning.polygon import Departure
    from steptwin.host.planning.trajectory_file import FileMotion
    from steptwin.host.robots.robot import Robot


_SHOWN: Final = 0.0005
"""Smallest deviation that three decimals show."""

_KINDS: Final = {
    "spline": "a spline",
    "linear": "straight lines with blends",
    "stop": "straight lines with stops",
    None: "cubics between velocities",
}
_REMEDIES: Final = {
    "spline": "-o interpolate=linear or stop keeps closer, and so do more points",
    "linear": "-o interpolate=stop keeps closer, and so does more time",
}
_REMEDY_FOR_THE_TOOL: Final = "more points or a program's `line` steps keep closer"
"""Between the poses of a file the tool follows the joints, whatever the interpolation."""


_LEFT: Final = "left_percent"
"""Option of fastest motions: percentage of the drives' torque that remains."""
_OF_FILES: Final = ("interpolate", "ramps_s", "units", "elbow", "law")
"""Further options of trajectory files."""


@dataclass(frozen=True, slots=True)
class MotionOptions:
    """Options of a motion: those of its job or file, and its slowness."""

    pairs: list[str] | None = option(
        "NAME=VALUE",
        "Set an option of the job (`steptwin jobs ROBOT` lists them); of a trajectory file: interpolate=spline, linear"
        " or stop, ramps_s=SECONDS, units=rad,m, elbow=right or left, law=fastest; with law=fastest"
        " left_percent=PERCENT; of a file that a step of programs runs: a key of the step. Repeatable"
        " (docs/motions.md, docs/programs.md).",
        "--option",
        "-o",
    )
    stretch: str | None = option(
        "FACTOR|auto", "Make the motion this many times slower; auto: just as slow as it must be."
    )
    files: Sequence[FileOptions] = of_features("file_options")

    def by_name(self) -> dict[str, str]:
        """Return the options by name; raise InputError for one of another form, or for a repeated one."""
        return name_value_pairs(self.pairs or [])

    def of_job(self) -> dict[str, str]:
        """Return the options of the job or the file; raise as `by_name`."""
        return {name: text for name, text in self.by_name().items() if name != _LEFT}

    def keys(self, file: str) -> dict[str, str]:
        """Return the keys of the step that runs a file; raise InputError for an option of another kind of file."""
        return keys_of(self.files, file)

    def drives(self, robot: "Robot") -> "DriveLimits | None":
        """Return the drives that limit the motion; None without the option for their remaining torque."""
        text = self.by_name().get(_LEFT)
        if text is None:
            return None
        from steptwin.host.planning.drives import AskedLimits, known_drives

        percent = finite_number(text, f"option {_LEFT}")
        with prefixed("option "):
            limits = AskedLimits("motors", percent)
        with prefixed(f"option {_LEFT}: "):
            return limits.drives(robot, known_drives())

    def factor(self) -> float | None:
        """Return the factor on the motion's duration; None without one, and for `--stretch auto`."""
        return None if self.stretch in (None, "auto") else positive_number(self.stretch, "--stretch")


def keys_of(files: Sequence[FileOptions], file: str) -> dict[str, str]:
    """Return the keys, given by the features' options, of the step that runs a file."""
    return {key: text for options in files for key, text in options.keys(file).items()}


AS_PLANNED: Final = MotionOptions(None, None)
"""No options: a motion as in its job or file."""


def _read_file(
    robot: "Robot", path: str, options: Mapping[str, str], drives: "DriveLimits | None" = None
) -> "FileMotion":
    """Read the motion of a trajectory file; raise InputError as `read_trajectory`, or for an unknown option."""
    from steptwin.host.planning.trajectory_file import read_file_motion

    for name in options:
        if name not in _OF_FILES:
            raise unknown("option", name, (*_OF_FILES, _LEFT))
    ramps_s = options.get("ramps_s")
    with naming_options(**{name: f"-o {name}=" for name in _OF_FILES}):
        return read_file_motion(
            path,
            robot,
            interpolate=options.get("interpolate"),
            ramps_s=0.0 if ramps_s is None else positive_number(ramps_s, "option ramps_s"),
            elbow=options.get("elbow"),
            units=options.get("units"),
            law=options.get("law"),
            drives=drives,
        )


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
        f"{len(file.points.times_s)} points{branch} in {plan.motion.duration_s:.3f} s,"
        f" {_KINDS[file.interpolation]}{ramps}, peak speed {peak.percent:.3g} % of the limit ({peak.joint})"
    )


def _warning(file: "FileMotion", large: "list[Departure]") -> str:
    """Return where the motion deviates most, relative to the tolerance, and the remedy."""
    worst = max(large, key=lambda departure: departure.distance / departure.allowed)
    remedy = _REMEDIES[file.interpolation or "spline"] if file.points.tool_mm is None else _REMEDY_FOR_THE_TOOL
    size = f"{worst.what} {worst.distance:.3g} {worst.unit} at t = {worst.t_s:.3f} s"
    return f"far off the lines between the points: {size} (limit {worst.allowed:.3g} {worst.unit}); {remedy}"


@dataclass(frozen=True, slots=True)
class ChosenMotion:
    """The planned motion of a command line.

    Attributes:
        job: name of the job, the program or the file.
        plan: the motion, checked.
        file: the motion with its file's points; None for a job or a program.
        doubted: question about the file's units; None without one.
    """

    job: str
    plan: "Plan"
    file: "FileMotion | None"
    doubted: str | None = None

    def print_summary(self, answer: AnswerOptions) -> None:
        """Print a summary of a trajectory file, with the motion's deviation from the lines between its points.

        Then print doubts about it. For a job or a program, print nothing.
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
            warn(f"{path}: {with_options(self.doubted, units='-o units=')}")


def choose_motion(
    robot: "Robot", job: str, options: Mapping[str, str], motion_options: MotionOptions = AS_PLANNED
) -> ChosenMotion:
    """Return the motion of a command line, with options of its job or file.

    Raises:
        InputError: the robot cannot execute it, or an option is invalid, which the message names.
    """
    options = {**options, **motion_options.keys(job)}
    motion, file, explained, is_foretold = _motion(robot, job, options, motion_options.drives(robot))
    plan = _planned(robot, motion, motion_options, explained)
    if plan.changed is not None:
        say(f"{job}: {plan.changed.described()}", err=True)
    model = drive_model() if is_foretold else None
    if model is not None and (forecast := model.forecast(robot, plan.motion)):
        warn(f"{job}: {forecast}")
    if file is None or "units" in options:
        return ChosenMotion(job, plan, file)
    from steptwin.host.planning.trajectory_file import doubt

    doubted = doubt(file, plan, lambda units: _read_file(robot, job, {**options, "units": units}))
    return ChosenMotion(job, plan, file, doubted)


_Explained = Callable[[float], AbstractContextManager[None]]
"""Explains the refusal of a motion that was stretched by a factor."""


class _Motion(NamedTuple):
    """A motion, the points of its file, the explanation of a refusal, and True for a motor forecast."""

    motion: "Motion"
    file: "FileMotion | None"
    explained: _Explained
    is_foretold: bool = False


def _motion(robot: "Robot", job: str, options: Mapping[str, str], drives: "DriveLimits | None") -> _Motion:
    """Return the motion that a command line names."""
    from steptwin.host.planning.jobs import job_names, make_job
    from steptwin.host.planning.programs import SUFFIX
    from steptwin.host.planning.programs.step_files import is_step_file
    from steptwin.host.planning.trajectory_file import SUFFIXES, is_trajectory_file

    if is_trajectory_file(job):
        file = _read_file(robot, job, options, drives)
        return _Motion(file.whole, file, file.explained)
    if job.endswith(SUFFIX) or is_step_file(job):
        if drives is not None:
            raise InputError(f"option {_LEFT}: a program asks itself, by [limits] left_percent (docs/motors.md)")
        return _program(robot, job, options)
    if Path(job).is_file():
        raise InputError(f"{job}: a trajectory file ends in {', '.join(SUFFIXES)}")
    here = [name for suffix in (SUFFIX, *SUFFIXES) if Path(name := f"{job}{suffix}").is_file()]
    if here and job not in job_names(robot):
        raise InputError(f"job {job!r} is unknown: did you mean {' or '.join(here)}, the file here?")
    with naming_options(law="-o law="):
        motion = make_job(robot, job, dict(options), drives=drives)
    return _Motion(motion, None, lambda _: nullcontext())


def _program(robot: "Robot", path: str, options: Mapping[str, str]) -> _Motion:
    """Return the motion of a program, or of a file that a step of a program runs."""
    from steptwin.host.planning.drives import known_drives
    from steptwin.host.planning.programs import SUFFIX, compile_program, read_program
    from steptwin.host.planning.programs.step_files import read_step_file, without_step

    is_program = path.endswith(SUFFIX)
    if options and is_program:
        raise InputError(f"option {next(iter(options))}: a program has no options")
    try:
        program = read_program(path) if is_program else read_step_file(path, options)
        with prefixed(f"{path}: "), nullcontext() if is_program else without_step(Path(path).name):
            compiled = compile_program(program, robot, drives=known_drives())
    except InputError as error:
        if len(error.messages) == 1:
            raise
        raise InputError(f"{error}; more is wrong, `steptwin check` tells it all") from error
    for row in compiled.steps:
        drives = () if row.drives is None else (str(row.drives),)
        say(*(f"{path}: {row.place}: {sentence}" for sentence in (*row.passed(), *drives)), err=True)
        say(*(f"{path}: {note}" for note in row.notes if not is_program), err=True)

    @contextmanager
    def explained(stretch: float) -> Iterator[None]:
        with prefixed(f"{path}: "), compiled.explained(stretch):
            yield

    return _Motion(compiled.motion, None, explained, program.limits is None)


def _planned(robot: "Robot", motion: "Motion", options: MotionOptions, explained: _Explained) -> "Plan":
    """Plan a motion with its slowness, and print the consequence."""
    from steptwin.host.planning.planner import executed_duration_s, plan, plan_stretched

    factor = options.factor()
    with naming_options("stretch", interpolate="-o interpolate=", ramps_s="-o ramps_s="), explained(factor or 1.0):
        if options.stretch is None:
            return plan(robot, motion)
        planned = plan_stretched(robot, motion, factor)
    new_s, old_s = planned.motion.duration_s, executed_duration_s(robot, motion)
    if new_s == old_s:
        say("not stretched: it is slow enough", err=True)
    else:
        say(f"stretched {new_s / old_s:.4g} times: {new_s:.3f} s instead of {old_s:.3f} s", err=True)
    return planned
