"""What the items of one paper share; each value is computed when an item first asks for it."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, ClassVar

import numpy as np

from steptwin.host.common.arrays import FloatArray
from steptwin.host.robots import load_robot
from steptwin.host.robots.kinematics import make_kinematics
from steptwin.host.robots.kinematics.base import tool_frames
from steptwin.host.robots.robot import Robot
from steptwin.host.studies.papers.paper import Curve, Panel
from steptwin.host.studies.papers.runs import Runs
from steptwin.host.twin.embedded.outcome import Outcome

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def whole_steps(robot: Robot, joints: FloatArray) -> FloatArray:
    """Return the nearest whole steps, half a step rounded up, of joints of shape (n, joints)."""
    return np.asarray(np.floor(robot.to_steps(joints) + 0.5))


def in_whole_steps(robot: Robot, joints: FloatArray) -> FloatArray:
    """Return joints of shape (n, joints) with each at its nearest whole step."""
    return robot.from_steps(whole_steps(robot, joints))


def pulses(robot: Robot, joints: FloatArray) -> list[int]:
    """Return each axis' pulses if every sample of the joints, of shape (n, joints), is rounded to whole steps."""
    moved: FloatArray = np.abs(np.diff(whole_steps(robot, joints), axis=0)).sum(axis=0)
    return [int(count) for count in moved]


def tool_off_mm(robot: Robot, joints: FloatArray, others: FloatArray) -> FloatArray:
    """Return the distances, of shape (n,), between the tool's positions for two sets of joints."""
    kinematics = make_kinematics(robot)
    offsets_mm = kinematics.forward(joints)[:, :3] - kinematics.forward(others)[:, :3]
    return np.asarray(np.linalg.norm(offsets_mm, axis=1))


def transforms(robot: Robot, joints: FloatArray) -> FloatArray:
    """Return the tool's transforms, of shape (n, 4, 4), as the product of the DH table's links."""
    return tool_frames(make_kinematics(robot), joints)


def panels_over(
    x: FloatArray, x_label: str, columns: Sequence[tuple[str, Sequence[tuple[str, FloatArray, str]]]]
) -> tuple[Panel, ...]:
    """Return a panel for each label, with its curves, each a name, values of shape (n,) and a style."""
    return tuple(
        Panel("", x_label, label, tuple(Curve(name, x, y, style) for name, y, style in curves))
        for label, curves in columns
    )


@dataclass(frozen=True)
class Study:
    """A robot and the runs of its jobs; each paper adds what it computes with them."""

    robot_name: ClassVar[str]
    runs: Runs

    @cached_property
    def robot(self) -> Robot:
        """The robot."""
        return load_robot(self.robot_name)

    def run_of(self, job: str) -> Outcome:
        """Return the outcome of one of its jobs, run with the job's default options."""
        return self.runs.outcome(self.robot_name, job)


def arm_picture(study: Study) -> "Figure":
    """Draw the arm at home in space."""
    from steptwin.host.record.plots.in_space import draw_arm_in_space

    return draw_arm_in_space(study.robot)


def frames_picture(joints: tuple[float, ...]) -> "Callable[[Study], Figure]":
    """Return the function that draws the frames of a study's DH table at a joint position."""

    def draw(study: Study) -> "Figure":
        from steptwin.host.record.plots.in_space import draw_link_frames

        return draw_link_frames(study.robot, joints)

    return draw
