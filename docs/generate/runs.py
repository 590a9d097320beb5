"""Every job once, with its default options: what the results, the pictures and tests have in common."""

from collections.abc import Iterator
from typing import Final

from steptwin.controller.backend import Kernel
from steptwin.host.planning.jobs import job_names, make_job
from steptwin.host.planning.planner import plan
from steptwin.host.robots import load_robot
from steptwin.host.twin.execution import execute
from steptwin.host.twin.outcome import Outcome

ROBOTS: Final = ("lab-scara", "warehouse-scara", "teaching-scara", "calibration-scara", "hybrid-arm")
"""In the order of the page."""


class Runs:
    """The outcomes by robot and job; each job runs when it is first asked for."""

    def __init__(self, kernel: Kernel) -> None:
        self._kernel = kernel
        self._outcomes: dict[tuple[str, str], Outcome] = {}

    def outcome(self, robot_name: str, job: str) -> Outcome:
        """One run; raises as `make_job`, `plan` and `execute` do."""
        key = robot_name, job
        if key not in self._outcomes:
            robot = load_robot(robot_name)
            self._outcomes[key] = execute(plan(robot, make_job(robot, job, {})), job, self._kernel)
        return self._outcomes[key]

    def all(self) -> Iterator[Outcome]:
        """Every job of every robot."""
        for name in ROBOTS:
            for job in job_names(load_robot(name)):
                yield self.outcome(name, job)
