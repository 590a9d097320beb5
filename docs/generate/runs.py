"""Run the robots' jobs for the pages, each once."""

from steptwin.host.planning.jobs import job_extras, make_job
from steptwin.host.planning.planner import plan
from steptwin.host.robots import load_robot
from steptwin.host.twin.embedded.execution import execute
from steptwin.host.twin.embedded.outcome import Outcome
from steptwin.host.twin.machine.kernels import Kernel, fastest_kernel


class Runs:
    """The outcome of each robot and job with default options; a job runs when its outcome is first asked for."""

    def __init__(self, kernel: Kernel | None = None) -> None:
        self._kernel = kernel or fastest_kernel()
        self._outcomes: dict[tuple[str, str], Outcome] = {}

    def outcome(self, robot_name: str, job: str) -> Outcome:
        """Return the outcome of one job; raise what `make_job`, `plan` and `execute` raise."""
        key = robot_name, job
        if key not in self._outcomes:
            robot = load_robot(robot_name)
            extras = job_extras(robot, job, {})
            self._outcomes[key] = execute(plan(robot, make_job(robot, job, {})), job, self._kernel, extras=extras)
        return self._outcomes[key]
