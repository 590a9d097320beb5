"""A job: a name, and how a robot and some options become a trajectory."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass

from host.robot import Robot
from host.trajectory import Trajectory


@dataclass(frozen=True, slots=True)
class Job:
    """An entry of the registry.

    Attributes:
        name: as on the command line.
        title: one line for people.
        make: builds the trajectory from the texts of its options; raises InputError for what makes none.
    """

    name: str
    title: str
    make: Callable[[Robot, Mapping[str, str]], Trajectory]
