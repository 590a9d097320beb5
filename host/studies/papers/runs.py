"""Run jobs once with their default options, and show their outcomes: pulses, which no paper has measured."""

from collections.abc import Callable, Iterator

from steptwin.host.planning.errand import Errand
from steptwin.host.planning.jobs import job_carries, make_job
from steptwin.host.planning.planner import plan
from steptwin.host.robots import load_robot
from steptwin.host.studies.papers.paper import Listing, S, Value
from steptwin.host.twin.embedded.execution import execute
from steptwin.host.twin.embedded.outcome import Outcome
from steptwin.host.twin.machine.kernels import Kernel, fastest_kernel


class Runs:
    """The outcome of each robot and job; a job runs when its outcome is first asked for."""

    def __init__(self, kernel: Kernel | None = None) -> None:
        self._kernel = kernel
        self._outcomes: dict[tuple[str, str], Outcome] = {}

    def outcome(self, robot_name: str, job: str) -> Outcome:
        """Return the outcome of one job; raise what `make_job`, `plan` and `execute` raise."""
        key = robot_name, job
        if key not in self._outcomes:
            robot = load_robot(robot_name)
            carries = job_carries(robot, job)
            errand = Errand.alone(carries) if carries else None
            self._kernel = self._kernel or fastest_kernel()
            self._outcomes[key] = execute(plan(robot, make_job(robot, job, {})), job, self._kernel, errand=errand)
        return self._outcomes[key]

    def made(self) -> Iterator[Outcome]:
        """Yield the outcomes that have been asked for."""
        yield from self._outcomes.values()


def pulses_of(outcome: Outcome, joint: str) -> int:
    """Return the pulses of a joint's axis; raise KeyError for an unknown joint."""
    return {axis.name: axis.pulses for axis in outcome.report.axes}[joint]


def run_listing(job: str, outcome: Callable[[S], Outcome]) -> Listing[S]:
    """Return the table of a run: a row for each axis, then the tool and the verdict."""
    return Listing(
        f"The run of `{job}` on the emulated board",
        ("axis", "steps at start", "at end", "pulses", "peak steps/s", "error max, steps"),
        lambda study: _rows(outcome(study)),
    )


def tool_values(outcome: Callable[[S], Outcome]) -> tuple[Value[S], ...]:
    """Return the largest error of the tool by the driver's counts, and the verdict; no paper has them."""
    return (
        Value(
            "tool off the plan by the counted steps, max", "mm", None,
            lambda study: outcome(study).report.tool.position_error_mm_max, decimals=4,
        ),
        Value("checks of the run that failed", "", None, lambda study: len(outcome(study).report.reasons)),
    )  # fmt: skip


def _rows(outcome: Outcome) -> list[list[str]]:
    return [
        [
            axis.name,
            str(axis.steps_start),
            str(axis.steps_end),
            str(axis.pulses),
            f"{axis.peak_rate_hz:.1f}" if axis.pulses else "-",
            f"{axis.position_error_steps_max:.4f}" if axis.pulses else "-",
        ]
        for axis in outcome.report.axes
    ]
