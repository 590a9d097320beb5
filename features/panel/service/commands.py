"""Requests of an operator: power and faults, outputs and settings, homing, steps, moves, runs, and jogs."""

import time
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from typing import ClassVar, NamedTuple

from steptwin.features.panel.service.history import EventLog
from steptwin.features.panel.service.messages import operator_message
from steptwin.features.panel.service.results import RunResults
from steptwin.features.panel.service.settings import MachineSettings
from steptwin.host.client import Progress
from steptwin.host.common.errors import InputError, StepTwinError
from steptwin.host.operate.homing import check_homing, declare, home_robot
from steptwin.host.operate.inputs_outputs import no_such_output, switch_output
from steptwin.host.operate.jogging import (
    STEP_SPEED_PERCENT,
    check_jog,
    check_step,
    check_step_speed,
    jog,
    jog_tool,
    step_joint,
    step_tool,
)
from steptwin.host.operate.moving import Goal, check_goal, goal_by_name, joints_at, move
from steptwin.host.operate.recovering import reset
from steptwin.host.operate.running import check_repeatable, execute_live
from steptwin.host.operate.session import Session
from steptwin.host.planning.plan import Plan
from steptwin.host.planning.programs.positions import ToolPosition
from steptwin.host.planning.tool_by_hand import StepFrame, ToolStep, check_tool_jog
from steptwin.host.robots.robot import Robot


@dataclass(frozen=True, slots=True)
class Request(ABC):
    """A command or a jog: checked in the thread that requests it, performed in the service's thread.

    Positions and distances are in mm and degrees, speeds in percent of the highest ones.
    """

    named: ClassVar[str]
    """Short title of the request; {0} is the request."""
    needs_drives: ClassVar[bool] = True
    """True if it is refused during a drive fault or an emergency stop."""
    needs_homed: ClassVar[bool] = False
    """True if it needs all joints homed."""
    jogs: ClassVar[bool] = False
    """True if it lasts while a button is held."""

    @property
    def title(self) -> str:
        """Short title."""
        return self.named.format(self)

    def check(self, limits: MachineSettings, standing: Sequence[float]) -> None:
        """Raise InputError for a request that is invalid, or impossible from the joints' position."""


class Work(NamedTuple):
    """Context of a command's execution.

    Attributes:
        session: the machine.
        limits: the robot's limits and all settings; a command may change them.
        events: log of events.
        runs: ended runs.
        progress: receives the fraction done.
        seen_s: time of the state that the operator saw, on the clock of `time.monotonic`.
    """

    session: Session
    limits: MachineSettings
    events: EventLog
    runs: RunResults
    progress: Progress
    seen_s: float


@dataclass(frozen=True, slots=True)
class Command(Request):
    """A request that ends by itself."""

    @abstractmethod
    def perform(self, work: Work) -> str:
        """Execute the command; return its result in one line, or an empty text."""


@dataclass(frozen=True, slots=True)
class Enable(Command):
    """Switch every drive on; each holds its position."""

    named = "switch on"

    def perform(self, work: Work) -> str:
        with work.session.charge("switch on", needs=()) as charge:
            charge.enable()
        return ""


@dataclass(frozen=True, slots=True)
class Disable(Command):
    """Switch every drive off."""

    named = "switch off"
    needs_drives = False

    def perform(self, work: Work) -> str:
        with work.session.alone("switch off"):
            work.session.machine.disable()
        return ""


@dataclass(frozen=True, slots=True)
class ResetFaults(Command):
    """Reset the drives' faults and the emergency stop; the drives are off afterwards."""

    named = "reset"
    needs_drives = False

    def perform(self, work: Work) -> str:
        reset(work.session, age_s=time.monotonic() - work.seen_s)
        return "faults are reset, the drives are off"


@dataclass(frozen=True, slots=True)
class SwitchOutput(Command):
    """Switch a digital output by its name in the robot's file."""

    named = "switch {0.output}"
    needs_drives = False
    output: str
    on: bool

    def check(self, limits: MachineSettings, _standing: Sequence[float]) -> None:
        outputs = list(limits.robot.outputs)
        if self.output not in outputs:
            raise no_such_output(limits.robot.name, self.output, outputs)

    def perform(self, work: Work) -> str:
        switch_output(work.session, self.output, on=self.on)
        return f"{self.output}: {'on' if self.on else 'off'}"


@dataclass(frozen=True, slots=True)
class WriteSettings(Command):
    """Write settings, given by `Setting.key`."""

    named = "settings"
    needs_drives = False
    values: Mapping[str, float]

    def check(self, limits: MachineSettings, _standing: Sequence[float]) -> None:
        limits.check(self.values)

    def perform(self, work: Work) -> str:
        work.limits.write(work.session, self.values)
        return ", ".join(f"{key} = {value:g}" for key, value in self.values.items())


@dataclass(frozen=True, slots=True)
class HomeAll(Command):
    """Home every joint by its switches, then move to the home position."""

    named = "home"
    together: bool = False
    """True homes all joints at once, False one after the other."""

    def check(self, limits: MachineSettings, _standing: Sequence[float]) -> None:
        check_homing(limits.robot, limits.robot.joint_names)

    def perform(self, work: Work) -> str:
        home_robot(work.session, together=self.together, progress=work.progress)
        return "all joints are homed"


@dataclass(frozen=True, slots=True)
class HomeJoint(Command):
    """Home one joint by its switches, then move it to its home position."""

    named = "home {0.joint}"
    joint: str

    def check(self, limits: MachineSettings, _standing: Sequence[float]) -> None:
        check_homing(limits.robot, [self.joint])

    def perform(self, work: Work) -> str:
        home_robot(work.session, joints=[self.joint], progress=work.progress)
        return f"{self.joint} is homed"


@dataclass(frozen=True, slots=True)
class DeclareHere(Command):
    """Declare the position of the machine at standstill; nothing moves."""

    named = "declare"
    joints: tuple[float, ...]
    """Position of every joint, in the robot's order."""

    def check(self, limits: MachineSettings, _standing: Sequence[float]) -> None:
        robot = limits.robot
        if len(self.joints) != len(robot.joints):
            raise InputError(f"{len(self.joints)} positions for the {len(robot.joints)} joints of {robot.name}")
        check_goal(robot, self.joints)

    def perform(self, work: Work) -> str:
        declare(work.session, list(self.joints))
        return f"declared: {_position_message(work.session.robot, self.joints)}"


@dataclass(frozen=True, slots=True)
class StepJoint(Command):
    """Move one joint by a distance with a sign."""

    named = "step {0.joint}"
    joint: str
    distance: float
    speed_percent: float = STEP_SPEED_PERCENT

    def check(self, limits: MachineSettings, _standing: Sequence[float]) -> None:
        check_step(limits.robot, self.joint, self.distance)
        check_step_speed(self.speed_percent)

    def perform(self, work: Work) -> str:
        session, percent = work.session, self.speed_percent
        moved = step_joint(session, self.joint, self.distance, speed_percent=percent, progress=work.progress)
        if moved.pose is not None:
            return _position_message(session.robot, moved.end)
        return f"by {self.distance:+g} {session.robot.joint(self.joint).unit}"


@dataclass(frozen=True, slots=True)
class StepTool(Command):
    """Move the tool by distances along axes of the world or of its own, or turn it about them or by phi, by name."""

    needs_homed = True
    distances: Mapping[str, float]
    speed_percent: float = STEP_SPEED_PERCENT
    frame: StepFrame = StepFrame.WORLD

    @property
    def title(self) -> str:
        """Short title with the coordinates."""
        return f"step {' '.join(self.distances)}"

    def check(self, _limits: MachineSettings, _standing: Sequence[float]) -> None:
        self._step()
        check_step_speed(self.speed_percent)

    def perform(self, work: Work) -> str:
        return _position_message(work.session.robot, step_tool(work.session, self._step(), progress=work.progress).end)

    def _step(self) -> ToolStep:
        return ToolStep(self.distances, self.speed_percent, self.frame)


@dataclass(frozen=True, slots=True)
class MoveJoints(Command):
    """Move joints to positions, by name, with a common arrival; the others stay."""

    named = "move"
    needs_homed = True
    joints: Mapping[str, float]
    speed_percent: float = 100.0

    def check(self, limits: MachineSettings, _standing: Sequence[float]) -> None:
        if not self.joints:
            raise InputError("move: names no joint")
        goal_by_name(limits.robot, self.joints)
        _check_percent(self.speed_percent)

    def perform(self, work: Work) -> str:
        return _move(work, goal_by_name(work.session.robot, self.joints), self.speed_percent)


@dataclass(frozen=True, slots=True)
class MoveTool(Command):
    """Move the tool to a pose on the branch of the present position; coordinates may be left out."""

    named = "move"
    needs_homed = True
    position: ToolPosition
    speed_percent: float = 100.0

    def check(self, limits: MachineSettings, standing: Sequence[float]) -> None:
        _check_percent(self.speed_percent)
        check_goal(limits.robot, joints_at(limits.robot, self.position, list(standing)))

    def perform(self, work: Work) -> str:
        return _move(work, partial(joints_at, work.session.robot, self.position), self.speed_percent)


@dataclass(frozen=True, slots=True)
class RunMotion(Command):
    """Run a plan, made for `MachineService.robot`."""

    named = "{0.name}"
    needs_homed = True
    plan: Plan
    name: str
    repeat: int = 1
    approach: bool = False
    """True to move to the plan's start first."""

    def check(self, limits: MachineSettings, _standing: Sequence[float]) -> None:
        if self.plan.robot != limits.robot:
            raise InputError(f"{self.name}: was planned for other limits than the machine has now: plan it again")
        check_repeatable(self.plan, self.repeat)

    def perform(self, work: Work) -> str:
        runs = work.runs
        work.events.info(f"{self.name}: begins{'' if self.repeat == 1 else f', to be run {self.repeat} times'}")
        try:
            outcome = execute_live(
                work.session,
                self.plan,
                self.name,
                repeat=self.repeat,
                approach=self.approach,
                progress=work.progress,
                begun=lambda: runs.begin(len(self.plan.robot.axes)),
            )
        except Exception as error:  # an error of the machine, or a stop
            runs.end(self.name, None, operator_message(error) if isinstance(error, StepTwinError) else str(error))
            raise
        runs.end(self.name, outcome, None)
        times = "" if outcome.repetitions == 1 else f", {outcome.repetitions} times"
        return f"{outcome.job}{times}: {'ended where planned' if outcome.passed else 'ENDED ELSEWHERE'}"


class JogEnd(NamedTuple):
    """End of a jog: whether anything has moved, and whether it is at the end of its travel."""

    moved: bool
    at_end: bool


@dataclass(frozen=True, slots=True)
class Jog(Request):
    """A motion at a speed with sign, in mm/s or deg/s, while a button is held."""

    jogs = True

    @abstractmethod
    def perform(self, session: Session, released: Callable[[], bool]) -> JogEnd:
        """Jog until the button is released, or until the machine can go no further."""


@dataclass(frozen=True, slots=True)
class JointJog(Jog):
    """Move one joint, up to its limit."""

    named = "jog {0.joint}"
    joint: str
    speed: float

    def check(self, limits: MachineSettings, _standing: Sequence[float]) -> None:
        check_jog(limits.robot, self.joint, self.speed)

    def perform(self, session: Session, released: Callable[[], bool]) -> JogEnd:
        jogged = jog(session, self.joint, self.speed, None, until=released)
        return JogEnd(jogged.end != jogged.start, jogged.at_limit)


@dataclass(frozen=True, slots=True)
class ToolJog(Jog):
    """Move the tool along an axis of the world or of its own, or turn it about one or by phi."""

    named = "jog {0.coordinate}"
    needs_homed = True
    coordinate: str
    speed: float
    frame: StepFrame = StepFrame.WORLD

    def check(self, limits: MachineSettings, _standing: Sequence[float]) -> None:
        check_tool_jog(limits.robot, self.coordinate, self.speed)

    def perform(self, session: Session, released: Callable[[], bool]) -> JogEnd:
        jogged = jog_tool(session, self.coordinate, self.speed, None, frame=self.frame, until=released)
        return JogEnd(jogged.end != jogged.start, jogged.at_end)


def _check_percent(percent: float) -> None:
    if not 0 < percent <= 100:
        raise InputError(f"speed: {percent:g} is not above 0 and up to 100 percent")


def _move(work: Work, goal: Goal, percent: float) -> str:
    moved = move(work.session, goal, speed_percent=percent, progress=work.progress)
    return _position_message(work.session.robot, moved.end)


def _position_message(robot: Robot, joints: Iterable[float]) -> str:
    return ", ".join(
        f"{joint.name} {position:.3f} {joint.unit}" for joint, position in zip(robot.joints, joints, strict=True)
    )
