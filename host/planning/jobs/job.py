"""A job: a name, and a function from a robot and options to a trajectory."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Generic

from steptwin.host.planning.jobs.options import Options, describe_options, parse_options
from steptwin.host.planning.trajectory import Trajectory
from steptwin.host.robots.robot import Robot


@dataclass(frozen=True, slots=True)
class Job(Generic[Options]):
    """A job of a kind of robot.

    Attributes:
        name: name on the command line.
        summary: summary, one line.
        options: frozen dataclass whose fields are made by `steptwin.host.planning.jobs.options`, each with a default.
        build: function that returns the trajectory for a robot and options; it raises InputError if there is none.
    """

    name: str
    summary: str
    options: type[Options]
    build: Callable[[Robot, Options], Trajectory]

    def make(self, robot: Robot, texts: Mapping[str, str]) -> Trajectory:
        """Return the trajectory for options given as texts; raise InputError as `parse_options` and `build` do."""
        return self.build(robot, parse_options(self.options, texts, robot))

    def described_options(self, robot: Robot) -> dict[str, str]:
        """Return each option's default and valid values as text."""
        return describe_options(self.options, robot)
