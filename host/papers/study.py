"""What the items of one paper share; each value is computed when an item first asks for it."""

from dataclasses import dataclass
from functools import cached_property
from typing import ClassVar

from steptwin.host.papers.runs import Runs
from steptwin.host.robots import load_robot
from steptwin.host.robots.robot import Robot
from steptwin.host.twin.outcome import Outcome


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
