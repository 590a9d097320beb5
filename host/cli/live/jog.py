"""`steptwin jog ROBOT WHAT AMOUNT --connect ...`: move a joint or the tool of a live board by hand."""

from dataclasses import asdict
from typing import TYPE_CHECKING, Final

from steptwin.host.cli.app import command
from steptwin.host.cli.arguments import check_percent, finite_number
from steptwin.host.cli.live.connection import LiveOptions, SessionOptions
from steptwin.host.cli.live.move import tell_moved
from steptwin.host.cli.options import argument, naming_options, option
from steptwin.host.cli.output import fixed, pose_text, progress_bar
from steptwin.host.common.bad_input import unknown
from steptwin.host.common.errors import InputError

if TYPE_CHECKING:
    from steptwin.host.operate.jogging import Jogged, ToolJogged
    from steptwin.host.operate.moving import Moved
    from steptwin.host.operate.session import Session
    from steptwin.host.planning.tool_by_hand import StepFrame
    from steptwin.host.robots.robot import Robot

_AT_END: Final = ", at the end of its travel"


@command(
    "lab-scara th2 +1 --connect 127.0.0.1",
    "ar4-mk3 rz 5deg/s --frame tool --connect 127.0.0.1",
    negatives=True,
)
def jog(
    live: SessionOptions,
    words: list[str] | None = argument(
        "ROBOT WHAT AMOUNT",
        "The robot; one of its joints, or x, y, z, phi, rx, ry or rz of its tool; and how far, such as +1, 1mm or"
        " -5deg, or how fast, such as 5mm/s.",
    ),
    frame: str | None = option(
        "NAME", "Axes along and about which the tool moves: world, or tool for its own; world by default."
    ),
    seconds: float | None = option("S", "Time to move at a speed, which then needs no unit; by default until Ctrl-C."),
    speed: float | None = option(
        "PERCENT",
        "Part of the highest speeds for a step: of the joint's, and of 250 mm/s or 90 deg/s of the tool; 20 by"
        " default.",
    ),
) -> None:
    """Move a joint or the tool, by a step or at a speed until Ctrl-C.

    A number alone is a distance: the machine moves by it and stops. A speed has its unit, or the time by --seconds.

    A joint that knows its position keeps its limits; another one moves until a limit switch stops it, in fault. The
    tool moves straight along axes, or turns about them on the spot.
    """
    loaded, rest = live.robot_and_rest(words)
    if len(rest) != 2:
        raise InputError(
            "a joint or x, y, z, phi, rx, ry, rz, and a distance or a speed are needed after the robot,"
            f" not {' '.join(rest) or 'nothing'}"
        )
    name, text = rest
    unit = _unit(loaded, name)
    axes = _frame(loaded, name, frame)
    value, at_speed = _amount(text, unit, timed=seconds is not None)
    if at_speed:
        _check_at_speed(loaded, name, value, seconds, speed)
    else:
        _check_step(loaded, name, value, seconds, speed)
    with live.session(loaded) as session:
        if not at_speed:
            tell_moved(live, loaded, _by_step(session, name, value, speed, axes))
        elif name in loaded.joint_names:
            _tell_jogged(live, loaded, _joint_at_speed(session, name, value, seconds))
        else:
            _tell_tool_jogged(live, loaded, _tool_at_speed(session, name, value, seconds, axes))


def _frame(robot: "Robot", name: str, text: str | None) -> "StepFrame":
    from steptwin.host.planning.tool_by_hand import StepFrame

    if text is None:
        return StepFrame.WORLD
    if text not in list(StepFrame):
        raise InputError(f"--frame {text}: there are {', '.join(StepFrame)}")
    if name in robot.joint_names:
        raise InputError(f"--frame {text}: is for the tool; {name} is a joint")
    return StepFrame(text)


def _unit(robot: "Robot", name: str) -> str:
    from steptwin.host.robots.kinematics import make_kinematics

    steps = make_kinematics(robot).task.steps
    units = {**steps, **{joint.name: str(joint.unit) for joint in robot.joints}}
    if name not in units:
        raise unknown("joint", name, [*robot.joint_names, *steps])
    return units[name]


def _amount(text: str, unit: str, *, timed: bool) -> tuple[float, bool]:
    """Return the number of a distance or a speed, and whether it is a speed: by its unit, or because it is timed."""
    from steptwin.host.robots.joint import Unit

    number, per_second = text.removesuffix("/s"), text.endswith("/s")
    given = next((unit for unit in Unit if number.endswith(unit)), "")
    value = finite_number(number.removesuffix(given), "AMOUNT")
    if given not in ("", unit):
        raise InputError(f"AMOUNT: {text} is not in {unit} or {unit}/s")
    return value, per_second or (timed and not given)


def _check_at_speed(robot: "Robot", name: str, value: float, seconds: float | None, speed: float | None) -> None:
    from steptwin.host.operate.jogging import check_jog
    from steptwin.host.planning.tool_by_hand import check_tool_jog

    if name in robot.joint_names:
        check_jog(robot, name, value)
    else:
        check_tool_jog(robot, name, value)
    if seconds is not None and not 0 < seconds < float("inf"):
        raise InputError(f"--seconds {seconds:g}: is not above 0 and finite")
    if speed is not None:
        raise InputError(f"--speed {speed:g}: is for a step; the speed of this jog is {value:g}")


def _check_step(robot: "Robot", name: str, value: float, seconds: float | None, speed: float | None) -> None:
    from steptwin.host.operate.stepping import check_step, check_step_speed
    from steptwin.host.planning.tool_by_hand import ToolStep

    if seconds is not None:
        raise InputError(f"--seconds {seconds:g}: is for a speed, such as {value:g}{_unit(robot, name)}/s")
    if speed is not None:
        check_percent(speed, "--speed")
        with naming_options(speed_percent="--speed"):
            check_step_speed(speed)
    if name in robot.joint_names:
        check_step(robot, name, value)
    else:
        ToolStep({name: value}, 1.0)


def _joint_at_speed(session: "Session", name: str, value: float, seconds: float | None) -> "Jogged":
    from steptwin.host.operate.jogging import jog

    return jog(session, name, value, seconds)


def _tool_at_speed(
    session: "Session", name: str, value: float, seconds: float | None, frame: "StepFrame"
) -> "ToolJogged":
    from steptwin.host.operate.jogging import jog_tool

    return jog_tool(session, name, value, seconds, frame=frame)


def _by_step(session: "Session", name: str, distance: float, speed: float | None, frame: "StepFrame") -> "Moved":
    from steptwin.host.operate.stepping import STEP_SPEED_PERCENT, step_joint, step_tool
    from steptwin.host.planning.tool_by_hand import ToolStep

    percent = STEP_SPEED_PERCENT if speed is None else speed
    with progress_bar(f"{session.robot.name} jog") as progress:
        if name in session.robot.joint_names:
            return step_joint(session, name, distance, speed_percent=percent, progress=progress)
        return step_tool(session, ToolStep({name: distance}, percent, frame), progress=progress)


def _tell_jogged(live: LiveOptions, robot: "Robot", jogged: "Jogged") -> None:
    unit = robot.joint(jogged.joint).unit
    at_limit = _AT_END if jogged.at_limit else ""
    way = f"{jogged.joint}: from {fixed(jogged.start)} to {fixed(jogged.end)} {unit}{at_limit}"
    live.tell_of(robot, asdict(jogged), way)


def _tell_tool_jogged(live: LiveOptions, robot: "Robot", jogged: "ToolJogged") -> None:
    named = {each: dict(zip(robot.joint_names, getattr(jogged, each), strict=True)) for each in ("start", "end")}
    joints = ", ".join(f"{name} {fixed(position)}" for name, position in named["end"].items())
    pose = () if jogged.pose is None else (pose_text(jogged.pose),)
    live.tell_of(robot, asdict(jogged) | named, joints + (_AT_END if jogged.at_end else ""), *pose)
