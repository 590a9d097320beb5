"""What makes a command wrong, or impossible from where the machine stands; the checks have the commands' names."""

from dataclasses import dataclass

from steptwin.host.common.errors import InputError
from steptwin.host.operate.homing import check_homing
from steptwin.host.operate.moving import check_goal, goal_by_name, joints_at
from steptwin.host.operate.running import check_repeatable
from steptwin.host.operate.stepping import check_step, check_step_speed
from steptwin.host.operate.switching import no_such_output
from steptwin.host.panel.desk.commands import (
    DeclareHere,
    HomeAll,
    HomeJoint,
    MoveJoints,
    MoveTool,
    RunMotion,
    StepJoint,
    StepTool,
    SwitchOutput,
    WriteSettings,
)
from steptwin.host.panel.desk.settings import MachineSettings, check_settings
from steptwin.host.planning.tool_by_hand import ToolStep
from steptwin.host.robots.robot import Robot


@dataclass(frozen=True, slots=True)
class Standing:
    """What a command is checked with: the robot's limits, and where its joints stand in mm and degrees."""

    limits: MachineSettings
    joints: list[float]

    @property
    def robot(self) -> Robot:
        """The robot with its present limits."""
        return self.limits.robot


def check_declare(standing: Standing, command: DeclareHere) -> None:
    """Raise InputError unless each joint has a position within its limits."""
    robot = standing.robot
    if len(command.joints) != len(robot.joints):
        raise InputError(f"{len(command.joints)} positions for the {len(robot.joints)} joints of {robot.name}")
    check_goal(robot, command.joints)


def _check_percent(percent: float) -> None:
    if not 0 < percent <= 100:
        raise InputError(f"speed: {percent:g} is not above 0 and up to 100 percent")


def check_step_joint(standing: Standing, command: StepJoint) -> None:
    """Raise InputError unless the joint exists, and distance and speed are within its limits."""
    check_step(standing.robot, command.joint, command.distance)
    check_step_speed(command.speed_percent)


def check_step_tool(_standing: Standing, command: StepTool) -> None:
    """Raise InputError unless the coordinates exist, and the speed is within its limits."""
    ToolStep(command.distances, command.speed_percent)
    check_step_speed(command.speed_percent)


def check_move_joints(standing: Standing, command: MoveJoints) -> None:
    """Raise InputError unless the joints exist, and the positions and the speed are within their limits."""
    if not command.joints:
        raise InputError("move: names no joint")
    goal_by_name(standing.robot, command.joints)
    _check_percent(command.speed_percent)


def check_run(standing: Standing, command: RunMotion) -> None:
    """Raise InputError unless the plan was made for the present limits, and it can be repeated."""
    if command.plan.robot != standing.robot:
        raise InputError(f"{command.name}: was planned for other limits than the machine has now: plan it again")
    check_repeatable(command.plan, command.repeat)


def check_output(standing: Standing, command: SwitchOutput) -> None:
    """Raise InputError unless the output exists."""
    robot = standing.robot
    if command.output not in robot.outputs:
        raise no_such_output(robot.name, command.output, list(robot.outputs))


def check_move_tool(standing: Standing, command: MoveTool) -> None:
    """Raise InputError unless the arm reaches the pose."""
    _check_percent(command.speed_percent)
    check_goal(standing.robot, joints_at(standing.robot, command.position, standing.joints))


def check_home_all(standing: Standing, _command: HomeAll) -> None:
    """Raise InputError unless each joint can be homed."""
    check_homing(standing.robot, standing.robot.joint_names)


def check_home_joint(standing: Standing, command: HomeJoint) -> None:
    """Raise InputError unless the joint exists and can be homed."""
    check_homing(standing.robot, [command.joint])


def check_write(standing: Standing, command: WriteSettings) -> None:
    """Raise InputError unless the settings exist and may have these values."""
    check_settings(standing.limits, command.values)
