"""`steptwin home`, `move` and `jog ROBOT WHAT AMOUNT --connect ...`: home a live machine, and move it."""

from dataclasses import asdict, dataclass, field
from typing import TYPE_CHECKING, Final

from steptwin.host.cli.app import command
from steptwin.host.cli.arguments import (
    OrientationOptions,
    PositionsFile,
    RobotName,
    check_percent,
    finite_number,
    joint_values,
    saved_position,
)
from steptwin.host.cli.live.connection import LiveOptions, SessionOptions
from steptwin.host.cli.options import argument, naming_options, option, switch
from steptwin.host.cli.output import fixed, pose_text, progress_bar
from steptwin.host.common.bad_input import prefixed, unknown
from steptwin.host.common.choices import name_value_pairs
from steptwin.host.common.errors import InputError

if TYPE_CHECKING:
    from steptwin.host.operate.jogging import Jogged, ToolJogged
    from steptwin.host.operate.moving import Moved
    from steptwin.host.operate.session import Session
    from steptwin.host.planning.programs.positions import ToolPosition
    from steptwin.host.planning.tool_by_hand import StepFrame
    from steptwin.host.robots.robot import Robot


_AT_END: Final = ", at the end of its travel"


@command("ar4-mk3 --together --connect 127.0.0.1", "ar4-mk3 --here '0 0 0 0 45 0' --connect 127.0.0.1")
def home(
    live: SessionOptions,
    robot: RobotName = None,
    together: bool = switch("Home all joints at once; by default one by one, in the file's order."),
    stay: bool = switch("Stay at the switches instead of moving to the home position."),
    here: str | None = option("'Q1 Q2 ...'", "Move nothing: declare that the joints stand here (mm, degrees)."),
) -> None:
    """Home a live machine by its switches, then move it to its home position."""
    from steptwin.host.operate.homing import declare, home_robot

    loaded = live.robot(robot)
    if here is not None and (together or stay):
        raise InputError("--here: moves nothing, so --together and --stay do not go with it")
    without = [joint.name for joint in loaded.joints if joint.homing is None]
    if here is None and without:
        raise InputError(f"{without[0]}: the robot's file has no homing for it; say where it stands by --here")
    standing = None if here is None else joint_values(here.split(), loaded.joint_names, "--here")
    with live.session(loaded) as session:
        if standing is not None:
            states = declare(session, standing)
        else:
            with progress_bar(f"{loaded.name} home") as progress:
                states = home_robot(session, together=together, stay=stay, progress=progress)
    live.report_states(loaded, states)


def _report_moved(live: LiveOptions, robot: "Robot", moved: "Moved") -> None:
    """Print the final joint positions, and the tool's pose if known; in JSON also start, goal and duration."""
    names = robot.joint_names
    figures = {
        key: dict(zip(names, value, strict=True)) if isinstance(value, list) else value
        for key, value in asdict(moved).items()
    }
    joints = ", ".join(f"{name} {fixed(position)}" for name, position in zip(names, moved.end, strict=True))
    live.tell_of(robot, figures, joints, *(() if moved.pose is None else (pose_text(moved.pose),)))


@dataclass(frozen=True, slots=True)
class PoseOptions:
    """Options for the tool's pose."""

    x: float | None = option("MM", "Target position; by default it stays.", read=finite_number)
    y: float | None = option("MM", "Target position; by default it stays.", read=finite_number)
    z: float | None = option("MM", "Target position; by default it stays.", read=finite_number)
    phi: float | None = option(
        "DEG", "Target attitude; by default it stays, or follows from the arm.", read=finite_number
    )

    turned: OrientationOptions = field(default_factory=OrientationOptions)

    def given(self) -> "ToolPosition | None":
        """Return the given coordinates; None without any."""
        from steptwin.host.planning.programs.positions import ToolPosition

        asked = {"x": self.x, "y": self.y, "z": self.z, "phi": self.phi}
        coordinates = {name: value for name, value in asked.items() if value is not None}
        orientation = self.turned.orientation()
        return ToolPosition(coordinates, orientation=orientation) if coordinates or orientation else None


@command(
    "ar4-mk3 J2=30 --connect 127.0.0.1",
    "corexy-gantry --z 120 --speed 50 --connect 127.0.0.1",
    negatives=True,
)
def move(
    target: PoseOptions,
    live: SessionOptions,
    words: list[str] | None = argument(
        "ROBOT [Q1 Q2 ... | JOINT=Q ...]",
        "The robot, and targets of all joints, or of some by name, in mm and degrees.",
    ),
    to: str | None = option("NAME", "Saved position to move to (`steptwin positions`)."),
    file: PositionsFile = None,
    speed: float = option("PERCENT", "Part of the joints' highest speeds and accelerations.", default=100.0),
) -> None:
    """Move joints, or the tool by the branch that is reached soonest; all axes arrive together.

    The path is straight in joint space, not for the tool. Ctrl-C stops all axes.
    """
    from steptwin.host.operate.moving import Goal, goal_by_name, joints_at, move, nearest_joints
    from steptwin.host.planning.programs.positions import JointPosition, ToolPosition
    from steptwin.host.robots.kinematics import make_kinematics

    loaded, rest = live.robot_and_rest(words)
    pose = target.given()
    joints = _joints(loaded, rest)
    if [bool(pose), bool(joints), to is not None].count(True) != 1:
        raise InputError(
            "where to? either joints, or a tool pose by --x, --y, --z, --phi, or a saved position by --to; in space a"
            " pose has --rpy or another orientation instead of --phi"
        )
    if pose:
        make_kinematics(loaded).task.check(pose.coordinates, pose.orientation)
    check_percent(speed, "--speed")
    if not 0 < speed <= 100:
        raise InputError(f"--speed {speed:g}: is not above 0 and up to 100 percent")
    saved = saved_position(loaded, to, file)
    with prefixed(f"--to {to}: " if saved else ""):
        goal: Goal = goal_by_name(loaded, saved.joints if isinstance(saved, JointPosition) else joints)
    with live.session(loaded) as session:

        def tool_goal(standing: list[float]) -> list[float]:
            if isinstance(saved, ToolPosition):
                with prefixed(f"--to {to}: "):
                    return joints_at(loaded, saved, standing)
            return nearest_joints(loaded, pose or ToolPosition({}), standing)

        goal = tool_goal if pose or isinstance(saved, ToolPosition) else goal
        with progress_bar(f"{loaded.name} move") as progress:
            moved = move(session, goal, speed_percent=speed, progress=progress)
    _report_moved(live, loaded, moved)


def _joints(robot: "Robot", words: list[str]) -> dict[str, float]:
    names = robot.joint_names
    if not any("=" in word for word in words):
        values = joint_values(words, names, f"joints of {robot.name}") if words else []
        return dict(zip(names, values, strict=False))
    return {name: finite_number(text, name) for name, text in name_value_pairs(words).items()}


@command(
    "corexy-gantry X +1 --connect 127.0.0.1",
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
            _report_moved(live, loaded, _by_step(session, name, value, speed, axes))
        elif name in loaded.joint_names:
            _report_jogged(live, loaded, _joint_at_speed(session, name, value, seconds))
        else:
            _report_tool_jogged(live, loaded, _tool_at_speed(session, name, value, seconds, axes))


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
    """Return the number of a distance or a speed, and whether it is a speed: by its unit, or by --seconds."""
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
    from steptwin.host.operate.jogging import check_step, check_step_speed
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
    from steptwin.host.operate.jogging import STEP_SPEED_PERCENT, step_joint, step_tool
    from steptwin.host.planning.tool_by_hand import ToolStep

    percent = STEP_SPEED_PERCENT if speed is None else speed
    with progress_bar(f"{session.robot.name} jog") as progress:
        if name in session.robot.joint_names:
            return step_joint(session, name, distance, speed_percent=percent, progress=progress)
        return step_tool(session, ToolStep({name: distance}, percent, frame), progress=progress)


def _report_jogged(live: LiveOptions, robot: "Robot", jogged: "Jogged") -> None:
    unit = robot.joint(jogged.joint).unit
    at_limit = _AT_END if jogged.at_limit else ""
    way = f"{jogged.joint}: from {fixed(jogged.start)} to {fixed(jogged.end)} {unit}{at_limit}"
    live.tell_of(robot, asdict(jogged), way)


def _report_tool_jogged(live: LiveOptions, robot: "Robot", jogged: "ToolJogged") -> None:
    named = {each: dict(zip(robot.joint_names, getattr(jogged, each), strict=True)) for each in ("start", "end")}
    joints = ", ".join(f"{name} {fixed(position)}" for name, position in named["end"].items())
    pose = () if jogged.pose is None else (pose_text(jogged.pose),)
    live.tell_of(robot, asdict(jogged) | named, joints + (_AT_END if jogged.at_end else ""), *pose)
