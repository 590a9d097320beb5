"""The commands of the operator: power and faults, outputs and settings, homing, steps, moves and runs."""

import time
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial

from steptwin.features.panel.desk.requests import Command, Work
from steptwin.features.panel.desk.settings import MachineSettings, check_settings, write_settings
from steptwin.features.panel.desk.stops import StopAskedError
from steptwin.features.panel.desk.words import told
from steptwin.host.common.errors import InputError, StepTwinError
from steptwin.host.operate.homing import check_homing, declare, home_robot
from steptwin.host.operate.inputs_outputs import no_such_output, switch_output
from steptwin.host.operate.jogging import STEP_SPEED_PERCENT, check_step, check_step_speed, step_joint, step_tool
from steptwin.host.operate.moving import Goal, check_goal, goal_by_name, joints_at, move
from steptwin.host.operate.recovering import reset
from steptwin.host.operate.running import check_repeatable, execute_live
from steptwin.host.planning.plan import Plan
from steptwin.host.planning.programs.positions import ToolPosition
from steptwin.host.planning.tool_by_hand import StepFrame, ToolStep
from steptwin.host.robots.robot import Robot


@dataclass(frozen=True, slots=True)
class Enable(Command):
    """Switch every drive on; they hold their positions."""

    named = "switch on"

    def perform(self, work: Work) -> str:
        """Switch the drives on."""
        with work.session.charge("switch on", needs=()) as charge:
            charge.enable()
        return ""


@dataclass(frozen=True, slots=True)
class Disable(Command):
    """Switch every drive off."""

    named = "switch off"
    needs_drives = False

    def perform(self, work: Work) -> str:
        """Switch the drives off, unless they move."""
        with work.session.alone("switch off"):
            work.session.machine.disable()
        return ""


@dataclass(frozen=True, slots=True)
class ResetFaults(Command):
    """Reset the drives' faults, and end an emergency stop; the drives are off afterwards."""

    named = "reset"
    needs_drives = False

    def perform(self, work: Work) -> str:
        """Reset the faults that the operator has seen."""
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
        """Raise InputError unless the output exists."""
        outputs = list(limits.robot.outputs)
        if self.output not in outputs:
            raise no_such_output(limits.robot.name, self.output, outputs)

    def perform(self, work: Work) -> str:
        """Switch the output."""
        switch_output(work.session, self.output, on=self.on)
        return f"{self.output}: {'on' if self.on else 'off'}"


@dataclass(frozen=True, slots=True)
class WriteSettings(Command):
    """Write settings: values by `Setting.key`."""

    named = "settings"
    needs_drives = False
    changes_settings = True
    values: Mapping[str, float]

    def check(self, limits: MachineSettings, _standing: Sequence[float]) -> None:
        """Raise InputError unless the settings exist and may have these values."""
        check_settings(limits, self.values)

    def perform(self, work: Work) -> str:
        """Write the settings to the board, and change the limits."""
        write_settings(work.session, work.limits, self.values)
        return ", ".join(f"{key} = {value:g}" for key, value in self.values.items())


@dataclass(frozen=True, slots=True)
class HomeAll(Command):
    """Find every joint's position by its switches, then move to the home position."""

    named = "home"
    together: bool = False
    """True homes all joints at once, False one after the other."""

    def check(self, limits: MachineSettings, _standing: Sequence[float]) -> None:
        """Raise InputError unless each joint can be homed."""
        check_homing(limits.robot, limits.robot.joint_names)

    def perform(self, work: Work) -> str:
        """Home the joints."""
        home_robot(work.session, together=self.together, progress=work.progress)
        return "all joints are homed"


@dataclass(frozen=True, slots=True)
class HomeJoint(Command):
    """Find one joint's position by its switches, then move it to its home position."""

    named = "home {0.joint}"
    joint: str

    def check(self, limits: MachineSettings, _standing: Sequence[float]) -> None:
        """Raise InputError unless the joint exists and can be homed."""
        check_homing(limits.robot, [self.joint])

    def perform(self, work: Work) -> str:
        """Home the joint."""
        home_robot(work.session, joints=[self.joint], progress=work.progress)
        return f"{self.joint} is homed"


@dataclass(frozen=True, slots=True)
class DeclareHere(Command):
    """Say where the standing machine is; nothing moves."""

    named = "declare"
    joints: tuple[float, ...]
    """Position of every joint, in the robot's order."""

    def check(self, limits: MachineSettings, _standing: Sequence[float]) -> None:
        """Raise InputError unless each joint has a position within its limits."""
        robot = limits.robot
        if len(self.joints) != len(robot.joints):
            raise InputError(f"{len(self.joints)} positions for the {len(robot.joints)} joints of {robot.name}")
        check_goal(robot, self.joints)

    def perform(self, work: Work) -> str:
        """Declare the positions."""
        declare(work.session, list(self.joints))
        return f"declared: {_words(work.session.robot, self.joints)}"


@dataclass(frozen=True, slots=True)
class StepJoint(Command):
    """Move one joint by a distance with a sign."""

    named = "step {0.joint}"
    joint: str
    distance: float
    speed_percent: float = STEP_SPEED_PERCENT

    def check(self, limits: MachineSettings, _standing: Sequence[float]) -> None:
        """Raise InputError unless the joint exists, and distance and speed are within its limits."""
        check_step(limits.robot, self.joint, self.distance)
        check_step_speed(self.speed_percent)

    def perform(self, work: Work) -> str:
        """Step; return the positions, or the distance if they are unknown."""
        session, percent = work.session, self.speed_percent
        moved = step_joint(session, self.joint, self.distance, speed_percent=percent, progress=work.progress)
        if moved.pose is not None:
            return _words(session.robot, moved.end)
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
        """Its name, with the coordinates."""
        return f"step {' '.join(self.distances)}"

    def check(self, _limits: MachineSettings, _standing: Sequence[float]) -> None:
        """Raise InputError unless the coordinates exist, and the speed is within its limits."""
        self._step()
        check_step_speed(self.speed_percent)

    def perform(self, work: Work) -> str:
        """Step; return the positions."""
        return _words(work.session.robot, step_tool(work.session, self._step(), progress=work.progress).end)

    def _step(self) -> ToolStep:
        return ToolStep(self.distances, self.speed_percent, self.frame)


@dataclass(frozen=True, slots=True)
class MoveJoints(Command):
    """Move joints to positions, by name; the others stay. All arrive together."""

    named = "move"
    needs_homed = True
    joints: Mapping[str, float]
    speed_percent: float = 100.0

    def check(self, limits: MachineSettings, _standing: Sequence[float]) -> None:
        """Raise InputError unless the joints exist, and the positions and the speed are within their limits."""
        if not self.joints:
            raise InputError("move: names no joint")
        goal_by_name(limits.robot, self.joints)
        _check_percent(self.speed_percent)

    def perform(self, work: Work) -> str:
        """Move; return the positions."""
        return _move(work, goal_by_name(work.session.robot, self.joints), self.speed_percent)


@dataclass(frozen=True, slots=True)
class MoveTool(Command):
    """Move the tool to a pose, on the branch that the position names; coordinates may be left out."""

    named = "move"
    needs_homed = True
    position: ToolPosition
    speed_percent: float = 100.0

    def check(self, limits: MachineSettings, standing: Sequence[float]) -> None:
        """Raise InputError unless the arm reaches the pose."""
        _check_percent(self.speed_percent)
        check_goal(limits.robot, joints_at(limits.robot, self.position, list(standing)))

    def perform(self, work: Work) -> str:
        """Move; return the positions."""
        return _move(work, partial(joints_at, work.session.robot, self.position), self.speed_percent)


@dataclass(frozen=True, slots=True)
class RunMotion(Command):
    """Run a plan, made for `Desk.robot`."""

    named = "{0.name}"
    needs_homed = True
    plan: Plan
    name: str
    repeat: int = 1
    approach: bool = False
    """True moves to the plan's start first."""

    def check(self, limits: MachineSettings, _standing: Sequence[float]) -> None:
        """Raise InputError unless the plan was made for the present limits, and it can be repeated."""
        if self.plan.robot != limits.robot:
            raise InputError(f"{self.name}: was planned for other limits than the machine has now: plan it again")
        check_repeatable(self.plan, self.repeat)

    def perform(self, work: Work) -> str:
        """Run the motion; its result is kept however it ends."""
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
        except (StepTwinError, StopAskedError) as error:
            runs.end(self.name, None, told(error) if isinstance(error, StepTwinError) else str(error))
            raise
        runs.end(self.name, outcome, None)
        times = "" if outcome.repetitions == 1 else f", {outcome.repetitions} times"
        return f"{outcome.job}{times}: {'ended where planned' if outcome.passed else 'ENDED ELSEWHERE'}"


def _check_percent(percent: float) -> None:
    if not 0 < percent <= 100:
        raise InputError(f"speed: {percent:g} is not above 0 and up to 100 percent")


def _move(work: Work, goal: Goal, percent: float) -> str:
    """Move to joint positions; return those at the end in words."""
    moved = move(work.session, goal, speed_percent=percent, progress=work.progress)
    return _words(work.session.robot, moved.end)


def _words(robot: Robot, joints: Iterable[float]) -> str:
    return ", ".join(
        f"{joint.name} {position:.3f} {joint.unit}" for joint, position in zip(robot.joints, joints, strict=True)
    )
