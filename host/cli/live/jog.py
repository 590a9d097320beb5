"""`steptwin jog ROBOT WHAT AMOUNT --connect ...`: move a joint or the tool of a live board by hand."""

from dataclasses import asdict
from typing import TYPE_CHECKING

from steptwin.host.cli.app import command
from steptwin.host.cli.arguments import check_percent, finite_number
from steptwin.host.cli.live.connection import LiveOptions, SessionOptions
from steptwin.host.cli.live.move import tell_moved
from steptwin.host.cli.options import argument, naming_options, option
from steptwin.host.cli.output import fixed, progress_bar
from steptwin.host.common.bad_input import unknown
from steptwin.host.common.errors import InputError

if TYPE_CHECKING:
    from steptwin.host.operate.jogging import Jogged
    from steptwin.host.operate.moving import Moved
    from steptwin.host.operate.session import Session
    from steptwin.host.robots.robot import Robot


@command("lab-scara th2 +1 --connect 127.0.0.1", "lab-scara th2 -10deg/s --connect 127.0.0.1", negatives=True)
def jog(
    live: SessionOptions,
    words: list[str] | None = argument(
        "ROBOT WHAT AMOUNT",
        "The robot; one of its joints, or x, y, z, phi, rx, ry or rz of its tool; and how far, such as +1, 1mm or"
        " -5deg, or for a joint how fast, such as 5mm/s.",
    ),
    seconds: float | None = option("S", "Time to move at a speed, which then needs no unit; by default until Ctrl-C."),
    speed: float | None = option(
        "PERCENT",
        "Part of the highest speeds for a step: of the joint's, and of 250 mm/s or 90 deg/s of the tool; 20 by"
        " default.",
    ),
) -> None:
    """Move a joint or the tool by a step, or a joint at a speed until Ctrl-C.

    A number alone is a distance: the machine moves by it and stops. A speed has its unit, or the time by --seconds.

    A joint that knows its position keeps its limits; another one moves until a limit switch stops it, in fault. The
    tool moves straight along the world's axes.
    """
    loaded, rest = live.robot_and_rest(words)
    if len(rest) != 2:
        raise InputError(
            "a joint or x, y, z, phi, rx, ry, rz, and a distance or a speed are needed after the robot,"
            f" not {' '.join(rest) or 'nothing'}"
        )
    name, text = rest
    unit = _unit(loaded, name)
    value, at_speed = _amount(text, unit, timed=seconds is not None)
    if at_speed:
        _check_at_speed(loaded, name, value, seconds, speed)
    else:
        _check_step(loaded, name, value, seconds, speed)
    with live.session(loaded) as session:
        if at_speed:
            _tell_jogged(live, loaded, _at_speed(session, name, value, seconds))
        else:
            moved = _by_step(session, name, value, speed)
            tell_moved(live, loaded, moved)


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

    if name not in robot.joint_names:
        raise InputError(f"{name}: the tool is jogged by steps, such as {name} +1; only a joint has a speed")
    check_jog(robot, name, value)
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


def _at_speed(session: "Session", name: str, value: float, seconds: float | None) -> "Jogged":
    from steptwin.host.operate.jogging import jog

    return jog(session, name, value, seconds)


def _by_step(session: "Session", name: str, distance: float, speed: float | None) -> "Moved":
    from steptwin.host.operate.stepping import STEP_SPEED_PERCENT, step_joint, step_tool
    from steptwin.host.planning.tool_by_hand import ToolStep

    percent = STEP_SPEED_PERCENT if speed is None else speed
    with progress_bar(f"{session.robot.name} jog") as progress:
        if name in session.robot.joint_names:
            return step_joint(session, name, distance, speed_percent=percent, progress=progress)
        return step_tool(session, ToolStep({name: distance}, percent), progress=progress)


def _tell_jogged(live: LiveOptions, robot: "Robot", jogged: "Jogged") -> None:
    unit = robot.joint(jogged.joint).unit
    at_limit = ", at the end of its travel" if jogged.at_limit else ""
    way = f"{jogged.joint}: from {fixed(jogged.start)} to {fixed(jogged.end)} {unit}{at_limit}"
    live.tell_of(robot, asdict(jogged), way)
