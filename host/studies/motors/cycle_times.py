"""How long a program takes by the torque that its motors are to have left, and what other motors would give."""

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from typing import TYPE_CHECKING, Any, Final

from steptwin.host.common.bad_input import unknown
from steptwin.host.common.errors import InputError
from steptwin.host.planning.fastest import AskedLimits
from steptwin.host.planning.programs import Program, compile_program
from steptwin.host.robots.motor import JointMotor
from steptwin.host.robots.robot import Robot
from steptwin.host.twin.motor_limits import motor_limits

if TYPE_CHECKING:
    from matplotlib.figure import Figure

LEFT_PERCENT: Final = (10.0, 20.0, 30.0, 40.0, 50.0, 60.0, 70.0)
"""Percentages of the torque that are tried."""


@dataclass(frozen=True, slots=True)
class CycleTime:
    """A program with some torque left.

    Attributes:
        left_percent: what is asked for.
        duration_s: its duration; None if the motors do not manage it.
        joint: the joint whose motor has least left; empty if they do not manage it.
        tries: number of motions of the step that was refused most often by the rotors.
        refused: why they do not manage it; empty if they do.
    """

    left_percent: float
    duration_s: float | None
    joint: str = ""
    tries: int = 0
    refused: str = ""

    def to_dict(self) -> dict[str, Any]:
        """Return plain values for JSON."""
        return asdict(self)


def with_motors_of(robot: Robot, models: Mapping[str, str]) -> Robot:
    """Return a robot with other motors of the catalogue at some joints; raise InputError for an unknown one."""
    for name in models:
        if name not in robot.joint_names:
            raise unknown("joint", name, robot.joint_names)
    joints = tuple(
        replace(joint, motor=JointMotor(model=models[joint.name])) if joint.name in models else joint
        for joint in robot.joints
    )
    return replace(robot, joints=joints)


def cycle_times(program: Program, robot: Robot) -> tuple[CycleTime, ...]:
    """Return how long a program takes by each percentage; raise InputError if it is wrong for other reasons."""
    compile_program(replace(program, limits=None), robot)
    return tuple(_cycle_time(program, robot, left) for left in LEFT_PERCENT)


def _cycle_time(program: Program, robot: Robot, left_percent: float) -> CycleTime:
    asking = replace(program, limits=AskedLimits(left_percent))
    try:
        made = compile_program(asking, robot, drives=motor_limits)
    except InputError as error:
        return CycleTime(left_percent, None, refused=str(error))
    answers = [row.drives for row in made.steps if row.drives]
    weakest = min(answers, key=lambda answer: answer.left_percent)
    return CycleTime(left_percent, made.trajectory.duration_s, weakest.joint, max(each.tries for each in answers))


def draw_cycles(robot: Robot, cycles: Mapping[str, Sequence[CycleTime]], by_joints_s: float) -> "Figure":
    """Draw the durations by the torque that is left, a line for each choice of motors, by its name."""
    from matplotlib.figure import Figure

    from steptwin.host.record.plots.canvas import COUNTED, LIMIT

    figure = Figure(figsize=(10, 4.4), layout="constrained")
    figure.suptitle(f"{robot.name}: duration by the torque that its motors are to have left", x=0.01, ha="left")
    axes = figure.subplots()
    for (label, times), color, style in zip(cycles.items(), (COUNTED, "#d08a1d"), ("o-", "s--"), strict=False):
        managed = [each for each in times if each.duration_s is not None]
        axes.plot(
            [each.left_percent for each in managed],
            [each.duration_s or 0.0 for each in managed],
            style,
            color=color,
            markersize=4,
            label=label,
        )
    axes.axhline(by_joints_s, color=LIMIT, linewidth=1.0, label="limits of the joints alone")
    axes.set(xlabel="left_percent [%]", ylabel="duration [s]", xlim=(0.0, LEFT_PERCENT[-1] + 5.0), ylim=(0.0, None))
    axes.legend(loc="lower right")
    return figure
