"""A job: a name, and how a robot and some options become a trajectory."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Generic

from steptwin.host.planning.jobs.options import Options, describe_options, parse_options
from steptwin.host.planning.trajectory import Trajectory
from steptwin.host.robots.robot import Robot


@dataclass(frozen=True, slots=True)
class Job(Generic[Options]):
    """An entry of the registry.

    Attributes:
        name: as on the command line.
        summary: one line for people.
        options: a frozen dataclass whose fields are made by `steptwin.host.planning.jobs.options`, each with a default.
        build: the trajectory of a robot with these options; raises InputError for what makes none.
    """

    name: str
    summary: str
    options: type[Options]
    build: Callable[[Robot, Options], Trajectory]

    def make(self, robot: Robot, texts: Mapping[str, str]) -> Trajectory:
        """The trajectory from the texts of its options; raises InputError as `parse_options` and `build` do."""
        return self.build(robot, parse_options(self.options, texts, robot))

    def described_options(self, robot: Robot) -> dict[str, str]:
        """Each option's default and valid values, for people."""
        return describe_options(self.options, robot)
