"""`steptwin home ROBOT` and `move ROBOT Q1 Q2 ... --connect ...`: let a live machine find its position, and move it."""

from dataclasses import asdict, dataclass, field
from typing import TYPE_CHECKING

from steptwin.host.cli.app import command
from steptwin.host.cli.arguments import (
    PositionsFile,
    RobotName,
    check_percent,
    finite_number,
    joint_values,
    saved_position,
)
from steptwin.host.cli.live.connection import LiveOptions, SessionOptions
from steptwin.host.cli.options import argument, option, switch
from steptwin.host.cli.orientation_options import OrientationOptions
from steptwin.host.cli.output import fixed, pose_text, progress_bar
from steptwin.host.common.bad_input import prefixed
from steptwin.host.common.choices import name_value_pairs
from steptwin.host.common.errors import InputError

if TYPE_CHECKING:
    from steptwin.host.operate.moving import Moved
    from steptwin.host.planning.programs.positions import ToolPosition
    from steptwin.host.robots.robot import Robot


@command("lab-scara --together --connect 127.0.0.1", "lab-scara --here '150 0 90 0' --connect 127.0.0.1")
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
    live.tell_states(loaded, states)


def tell_moved(live: LiveOptions, robot: "Robot", moved: "Moved") -> None:
    """Print the joints at the end, and the tool's pose if it is known; with JSON also start, goal and duration."""
    names = robot.joint_names
    figures = {
        key: dict(zip(names, value, strict=True)) if isinstance(value, list) else value
        for key, value in asdict(moved).items()
    }
    joints = ", ".join(f"{name} {fixed(position)}" for name, position in zip(names, moved.end, strict=True))
    live.tell_of(robot, figures, joints, *(() if moved.pose is None else (pose_text(moved.pose),)))


@dataclass(frozen=True, slots=True)
class PoseOptions:
    """The options that say where the tool is to be."""

    x: float | None = option("MM", "Target position; by default it stays.", read=finite_number)
    y: float | None = option("MM", "Target position; by default it stays.", read=finite_number)
    z: float | None = option("MM", "Target position; by default it stays.", read=finite_number)
    phi: float | None = option(
        "DEG", "Target attitude; by default it stays, or follows from the arm.", read=finite_number
    )

    turned: OrientationOptions = field(default_factory=OrientationOptions)

    def given(self) -> "ToolPosition | None":
        """Return the coordinates that are given; None without any."""
        from steptwin.host.planning.programs.positions import ToolPosition

        asked = {"x": self.x, "y": self.y, "z": self.z, "phi": self.phi}
        coordinates = {name: value for name, value in asked.items() if value is not None}
        orientation = self.turned.orientation()
        return ToolPosition(coordinates, orientation=orientation) if coordinates or orientation else None


@command(
    "lab-scara th2=30 --connect 127.0.0.1",
    "lab-scara --z 120 --speed 50 --connect 127.0.0.1",
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
    tell_moved(live, loaded, moved)


def _joints(robot: "Robot", words: list[str]) -> dict[str, float]:
    names = robot.joint_names
    if not any("=" in word for word in words):
        values = joint_values(words, names, f"joints of {robot.name}") if words else []
        return dict(zip(names, values, strict=False))
    return {name: finite_number(text, name) for name, text in name_value_pairs(words).items()}
