"""What each command needs before it is taken, and how it is carried out: one table."""

import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Final, Generic, TypeVar

from steptwin.host.client import Progress
from steptwin.host.common.errors import StepTwinError
from steptwin.host.operate.homing import declare, home_robot
from steptwin.host.operate.moving import Moved, goal_by_name, joints_at, move, standing_joints
from steptwin.host.operate.recovering import reset
from steptwin.host.operate.running import LiveOutcome, execute_live
from steptwin.host.operate.session import Session
from steptwin.host.operate.stepping import step_joint, step_tool
from steptwin.host.operate.switching import switch_output
from steptwin.host.panel.desk import checks
from steptwin.host.panel.desk.commands import (
    Command,
    DeclareHere,
    Disable,
    Enable,
    HomeAll,
    HomeJoint,
    MoveJoints,
    MoveTool,
    ResetFaults,
    RunMotion,
    StepJoint,
    StepTool,
    SwitchOutput,
    WriteSettings,
)
from steptwin.host.panel.desk.results import RunResults
from steptwin.host.panel.desk.settings import MachineSettings, write_settings
from steptwin.host.panel.desk.stops import StopAskedError
from steptwin.host.panel.desk.words import told
from steptwin.host.planning.tool_by_hand import ToolStep
from steptwin.host.robots.robot import Robot
from steptwin.protocol import od
from steptwin.protocol.cia402 import Status

C = TypeVar("C", bound=Command)


@dataclass(frozen=True, slots=True)
class Doing:
    """What a command is carried out with.

    Attributes:
        session: the machine.
        limits: the robot's limits, which a command may change.
        progress: called with the part that is done.
        results: the runs that have ended.
        tell: logs what happens on the way.
        seen_s: when the machine was as the operator saw it, on the clock of `time.monotonic`.
    """

    session: Session
    limits: MachineSettings
    progress: Progress
    results: RunResults
    tell: Callable[[str], None]
    seen_s: float


@dataclass(frozen=True, slots=True)
class Action(Generic[C]):
    """How a command is checked and carried out.

    Attributes:
        title: names it, in a few words.
        perform: carries it out and says in one line what has come of it; an empty text says nothing.
        check: raises InputError for a command that is wrong, or impossible from where the machine stands.
        drives: True if it needs the drives: none in fault, no emergency stop.
        homed: True if every joint must know its position.
        changes_settings: True if settings must be read again after it.
    """

    title: Callable[[C], str]
    perform: Callable[[Doing, C], str]
    check: Callable[[checks.Standing, C], object] = lambda _standing, _command: None
    drives: bool = True
    homed: bool = False
    changes_settings: bool = False


def _enable(doing: Doing, _command: Enable) -> str:
    with doing.session.in_charge("switch on", known=False):
        return ""


def _disable(doing: Doing, _command: Disable) -> str:
    with doing.session.alone():
        doing.session.require_idle("switch off")
        doing.session.machine.disable()
    return ""


def _home_all(doing: Doing, command: HomeAll) -> str:
    home_robot(doing.session, together=command.together, progress=doing.progress)
    return "all joints are homed"


def _home_joint(doing: Doing, command: HomeJoint) -> str:
    home_robot(doing.session, joints=[command.joint], progress=doing.progress)
    return f"{command.joint} is homed"


def _declare(doing: Doing, command: DeclareHere) -> str:
    declare(doing.session, list(command.joints))
    return f"declared: {_positions(doing.session.robot, command.joints)}"


def _step_joint(doing: Doing, command: StepJoint) -> str:
    percent = command.speed_percent
    moved = step_joint(doing.session, command.joint, command.distance, speed_percent=percent, progress=doing.progress)
    if all(axis.read(od.STATUSWORD) & Status.POSITION_KNOWN for axis in doing.session.machine.axes):
        return _moved(doing, moved)
    return f"by {command.distance:+g} {doing.session.robot.joint(command.joint).unit}"


def _step_tool(doing: Doing, command: StepTool) -> str:
    step = ToolStep(command.distances, command.speed_percent)
    return _moved(doing, step_tool(doing.session, step, progress=doing.progress))


def _move_joints(doing: Doing, command: MoveJoints) -> str:
    goal = goal_by_name(doing.session.robot, command.joints)
    return _moved(doing, move(doing.session, goal, speed_percent=command.speed_percent, progress=doing.progress))


def _move_tool(doing: Doing, command: MoveTool) -> str:
    session = doing.session
    with session.alone():
        goal = joints_at(session.robot, command.position, standing_joints(session))
        return _moved(doing, move(session, goal, speed_percent=command.speed_percent, progress=doing.progress))


def _run(doing: Doing, command: RunMotion) -> str:
    """Run a motion; its result is kept however it ends."""
    doing.tell(f"{command.name}: begins{'' if command.repeat == 1 else f', to be run {command.repeat} times'}")
    try:
        outcome = execute_live(
            doing.session,
            command.plan,
            command.name,
            repeat=command.repeat,
            approach=command.approach,
            progress=doing.progress,
            begun=lambda: doing.results.reports.collect(len(command.plan.robot.joints)),
        )
    except (StepTwinError, StopAskedError) as error:
        doing.results.end(command.name, None, told(error) if isinstance(error, StepTwinError) else str(error))
        raise
    doing.results.end(command.name, outcome, None)
    return _ended(outcome)


def _ended(outcome: LiveOutcome) -> str:
    times = "" if outcome.repetitions == 1 else f", {outcome.repetitions} times"
    return f"{outcome.job}{times}: {'ended where planned' if outcome.passed else 'ENDED ELSEWHERE'}"


def _switch(doing: Doing, command: SwitchOutput) -> str:
    switch_output(doing.session, command.output, on=command.on)
    return f"{command.output}: {'on' if command.on else 'off'}"


def _reset(doing: Doing, _command: ResetFaults) -> str:
    reset(doing.session, age_s=time.monotonic() - doing.seen_s)
    return "faults are reset, the drives are off"


def _write(doing: Doing, command: WriteSettings) -> str:
    write_settings(doing.session, doing.limits, command.values)
    return ", ".join(f"{key} = {value:g}" for key, value in command.values.items())


def _moved(doing: Doing, moved: Moved) -> str:
    return _positions(doing.session.robot, moved.end)


def _positions(robot: Robot, joints: "list[float] | tuple[float, ...]") -> str:
    return ", ".join(
        f"{joint.name} {position:.3f} {joint.unit}" for joint, position in zip(robot.joints, joints, strict=True)
    )


ACTIONS: Final[dict[type[Command], Action[Any]]] = {
    Enable: Action(lambda _: "switch on", _enable),
    Disable: Action(lambda _: "switch off", _disable, drives=False),
    HomeAll: Action(lambda _: "home", _home_all, checks.check_home_all),
    HomeJoint: Action(lambda command: f"home {command.joint}", _home_joint, checks.check_home_joint),
    DeclareHere: Action(lambda _: "declare", _declare, checks.check_declare),
    StepJoint: Action(lambda command: f"step {command.joint}", _step_joint, checks.check_step_joint),
    StepTool: Action(
        lambda command: f"step {' '.join(command.distances)}", _step_tool, checks.check_step_tool, homed=True
    ),
    MoveJoints: Action(lambda _: "move", _move_joints, checks.check_move_joints, homed=True),
    MoveTool: Action(lambda _: "move", _move_tool, checks.check_move_tool, homed=True),
    RunMotion: Action(lambda command: command.name, _run, checks.check_run, homed=True),
    SwitchOutput: Action(lambda command: f"switch {command.output}", _switch, checks.check_output, drives=False),
    ResetFaults: Action(lambda _: "reset", _reset, drives=False),
    WriteSettings: Action(lambda _: "settings", _write, checks.check_write, drives=False, changes_settings=True),
}
"""How each command is checked and carried out."""
