"""Run jobs once, for all that shows their outcomes."""

from collections.abc import Iterator, Mapping
from types import MappingProxyType

from steptwin.host.planning.errand import Errand
from steptwin.host.planning.jobs import job_carries, make_job
from steptwin.host.planning.planner import plan
from steptwin.host.robots import load_robot
from steptwin.host.twin.embedded.execution import execute
from steptwin.host.twin.embedded.outcome import Outcome
from steptwin.host.twin.machine.kernels import Kernel, fastest_kernel


class Runs:
    """The outcome of each robot and job; a job runs when its outcome is first asked for."""

    def __init__(self, kernel: Kernel | None = None) -> None:
        self._kernel = kernel
        self._outcomes: dict[tuple[str, str, frozenset[tuple[str, str]]], Outcome] = {}

    def outcome(self, robot_name: str, job: str, options: Mapping[str, str] = MappingProxyType({})) -> Outcome:
        """Return the outcome of one job; raise what `make_job`, `plan` and `execute` raise."""
        key = robot_name, job, frozenset(options.items())
        if key not in self._outcomes:
            robot = load_robot(robot_name)
            carries = job_carries(robot, job, options)
            errand = Errand.alone(carries) if carries else None
            self._kernel = self._kernel or fastest_kernel()
            self._outcomes[key] = execute(plan(robot, make_job(robot, job, options)), job, self._kernel, errand=errand)
        return self._outcomes[key]

    def made(self) -> Iterator[Outcome]:
        """Yield the outcomes that have been asked for, of jobs with default options."""
        yield from (outcome for (_, _, options), outcome in self._outcomes.items() if not options)
