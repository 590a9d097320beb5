"""Read a trajectory file for `steptwin run`, and say before it runs what the robot makes of it."""

from typing import TYPE_CHECKING, Final, Literal

from steptwin.host.cli.arguments import positive_number
from steptwin.host.cli.option_names import naming_options
from steptwin.host.cli.output import say, warn
from steptwin.host.common.errors import InputError

if TYPE_CHECKING:
    from steptwin.host.planning.plan import Plan
    from steptwin.host.planning.polygon import Departure
    from steptwin.host.planning.trajectory_file import FileMotion
    from steptwin.host.robots.robot import Robot

InterpolationName = Literal["spline", "linear", "stop"]
"""The values of `steptwin.host.planning.trajectory_file.Interpolation`, which is imported only when it is needed."""

_SLOW_PERCENT: Final = 0.1
"""Percentage of every limit below which a motion is so slow that its times are probably in milliseconds or its
angles are in radians."""

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


def file_motion(
    robot: "Robot", path: str, options: dict[str, str], interpolate: InterpolationName | None, ramps: str | None
) -> "FileMotion":
    """Return the motion in a file; raise InputError as `read_trajectory` does, or for a job's options."""
    from steptwin.host.planning.trajectory_file import read_file_motion

    for name in options:
        if name != "elbow":
            raise InputError(f"option {name}: a trajectory from a file has no options")
    ramps_s = 0.0 if ramps is None else positive_number(ramps, "--ramps")
    with naming_options("interpolate", "elbow", ramps_s="--ramps"):
        return read_file_motion(path, robot, interpolate=interpolate, ramps_s=ramps_s, elbow=options.get("elbow"))


def refuse_file_options(interpolate: str | None, ramps: str | None) -> None:
    """Raise InputError for an option that only a trajectory file takes, beside a job or a program."""
    for option, value in (("--interpolate", interpolate), ("--ramps", ramps)):
        if value is not None:
            raise InputError(f"{option} {value}: is for a trajectory file")


def say_file_motion(path: str, file: "FileMotion", plan: "Plan", *, stretched: bool, to_stderr: bool) -> None:
    """Print what the file amounts to, how far the motion leaves the lines between its points, and warnings."""
    departures = file.departures()
    lines = [f"{path}: {_summary(file, plan)}"]
    if any(departure.distance >= _SHOWN for departure in departures):
        sizes = ", ".join(f"{departure.what} {departure.distance:.3f} {departure.unit}" for departure in departures)
        lines.append(f"{path}: off the lines between the points by {sizes}")
    if unread := file.points.unread:
        many = f"{unread[0]} to {unread[-1]} are" if len(unread) > 1 else f"{unread[0]} is"
        lines.append(f"{path}: {many} not read: positions and velocities alone make the motion")
    say(*lines, err=to_stderr)
    if large := [departure for departure in departures if departure.is_large]:
        warn(f"{path}: {_warning(file, large)}")
    if not stretched and 0.0 < max(peak.percent for peak in plan.peaks) < _SLOW_PERCENT:
        units = "are the times in ms, or the angles in radians? They are read in s and degrees"
        warn(f"{path}: below {_SLOW_PERCENT:g} % of every limit: {units}")


def _summary(file: "FileMotion", plan: "Plan") -> str:
    from steptwin.host.planning.peaks import Quantity

    peak = plan.highest(Quantity.SPEED)
    branch = "" if file.points.branch is None else f" on the branch {file.points.branch!r}"
    ramps = f" and ramps of {file.ramps_s:g} s" if file.ramps_s else ""
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
