"""Commands that move the machine, or tell it where it stands: homing, steps, moves, runs."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from functools import partial

from steptwin.host.common.errors import InputError, StepTwinError
from steptwin.host.operate.homing import check_homing, declare, home_robot
from steptwin.host.operate.moving import Goal, check_goal, goal_by_name, joints_at, move
from steptwin.host.operate.running import check_repeatable, execute_live
from steptwin.host.operate.stepping import STEP_SPEED_PERCENT, check_step, check_step_speed, step_joint, step_tool
from steptwin.host.panel.desk.requests import Command, Work
from steptwin.host.panel.desk.state import DeskState
from steptwin.host.panel.desk.stops import StopAskedError
from steptwin.host.panel.desk.words import told
from steptwin.host.planning.plan import Plan
from steptwin.host.planning.programs.positions import ToolPosition
from steptwin.host.planning.tool_by_hand import ToolStep
from steptwin.host.robots.robot import Robot


@dataclass(frozen=True, slots=True)
class HomeAll(Command):
    """Find every joint's position by its switches, then move to the home position."""

    title = "home"
    together: bool = False
    """True homes all joints at once, False one after the other."""

    def check(self, state: DeskState) -> None:
        """Raise InputError unless each joint can be homed."""
        check_homing(state.robot, state.robot.joint_names)

    def perform(self, work: Work) -> str:
        """Home the joints."""
        home_robot(work.session, together=self.together, progress=work.progress)
        return "all joints are homed"


@dataclass(frozen=True, slots=True)
class HomeJoint(Command):
    """Find one joint's position by its switches, then move it to its home position."""

    joint: str

    @property
    def title(self) -> str:
        """Its name, with the joint."""
        return f"home {self.joint}"

    def check(self, state: DeskState) -> None:
        """Raise InputError unless the joint exists and can be homed."""
        check_homing(state.robot, [self.joint])

    def perform(self, work: Work) -> str:
        """Home the joint."""
        home_robot(work.session, joints=[self.joint], progress=work.progress)
        return f"{self.joint} is homed"


@dataclass(frozen=True, slots=True)
class DeclareHere(Command):
    """Say where the standing machine is; nothing moves."""

    title = "declare"
    joints: tuple[float, ...]
    """Position of every joint, in the robot's order."""

    def check(self, state: DeskState) -> None:
        """Raise InputError unless each joint has a position within its limits."""
        robot = state.robot
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

    joint: str
    distance: float
    speed_percent: float = STEP_SPEED_PERCENT

    @property
    def title(self) -> str:
        """Its name, with the joint."""
        return f"step {self.joint}"

    def check(self, state: DeskState) -> None:
        """Raise InputError unless the joint exists, and distance and speed are within its limits."""
        check_step(state.robot, self.joint, self.distance)
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
    """Move the tool by distances along x, y, z of the world, or turn it by phi, by name."""

    needs_homed = True
    distances: Mapping[str, float]
    speed_percent: float = STEP_SPEED_PERCENT

    @property
    def title(self) -> str:
        """Its name, with the coordinates."""
        return f"step {' '.join(self.distances)}"

    def check(self, _state: DeskState) -> None:
        """Raise InputError unless the coordinates exist, and the speed is within its limits."""
        self._step()
        check_step_speed(self.speed_percent)

    def perform(self, work: Work) -> str:
        """Step; return the positions."""
        return _words(work.session.robot, step_tool(work.session, self._step(), progress=work.progress).end)

    def _step(self) -> ToolStep:
        return ToolStep(self.distances, self.speed_percent)


@dataclass(frozen=True, slots=True)
class MoveJoints(Command):
    """Move joints to positions, by name; the others stay. All arrive together."""

    title = "move"
    needs_homed = True
    joints: Mapping[str, float]
    speed_percent: float = 100.0

    def check(self, state: DeskState) -> None:
        """Raise InputError unless the joints exist, and the positions and the speed are within their limits."""
        if not self.joints:
            raise InputError("move: names no joint")
        goal_by_name(state.robot, self.joints)
        _check_percent(self.speed_percent)

    def perform(self, work: Work) -> str:
        """Move; return the positions."""
        return _move(work, goal_by_name(work.session.robot, self.joints), self.speed_percent)


@dataclass(frozen=True, slots=True)
class MoveTool(Command):
    """Move the tool to a pose, on the branch that the position names; coordinates may be left out."""

    title = "move"
    needs_homed = True
    position: ToolPosition
    speed_percent: float = 100.0

    def check(self, state: DeskState) -> None:
        """Raise InputError unless the arm reaches the pose."""
        _check_percent(self.speed_percent)
        standing = [joint.position for joint in state.latest.joints]
        check_goal(state.robot, joints_at(state.robot, self.position, standing))

    def perform(self, work: Work) -> str:
        """Move; return the positions."""
        return _move(work, partial(joints_at, work.session.robot, self.position), self.speed_percent)


@dataclass(frozen=True, slots=True)
class RunMotion(Command):
    """Run a plan, made for `Desk.robot`."""

    needs_homed = True
    plan: Plan
    name: str
    repeat: int = 1
    approach: bool = False
    """True moves to the plan's start first."""

    @property
    def title(self) -> str:
        """The motion's name."""
        return self.name

    def check(self, state: DeskState) -> None:
        """Raise InputError unless the plan was made for the present limits, and it can be repeated."""
        if self.plan.robot != state.robot:
            raise InputError(f"{self.name}: was planned for other limits than the machine has now: plan it again")
        check_repeatable(self.plan, self.repeat)

    def perform(self, work: Work) -> str:
        """Run the motion; its result is kept however it ends."""
        results = work.state.results
        work.state.events.info(f"{self.name}: begins{'' if self.repeat == 1 else f', to be run {self.repeat} times'}")
        try:
            outcome = execute_live(
                work.session,
                self.plan,
                self.name,
                repeat=self.repeat,
                approach=self.approach,
                progress=work.progress,
                begun=lambda: results.reports.collect(len(self.plan.robot.joints)),
            )
        except (StepTwinError, StopAskedError) as error:
            results.end(self.name, None, told(error) if isinstance(error, StepTwinError) else str(error))
            raise
        results.end(self.name, outcome, None)
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
