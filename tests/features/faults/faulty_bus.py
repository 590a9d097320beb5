"""The drawer pull on a bus with faults."""

from typing import Final

from steptwin.controller.motion.backend import Kernel
from steptwin.features.faults.kinds.bus import BusFault
from steptwin.features.faults.options import FaultOptions
from steptwin.features.faults.report import report_in
from steptwin.features.faults.scenario import Scenario, TriggeredFault
from steptwin.features.faults.triggers import AtTime
from steptwin.host.planning.jobs import make_job
from steptwin.host.planning.planner import plan
from steptwin.host.robots import load_robot
from steptwin.host.twin.embedded.execution import execute
from steptwin.host.twin.embedded.outcome import Outcome

MS: Final = 72_000
"""Counts of the board's timer in a millisecond."""


def drawer_pull(
    kernel: Kernel, *faults: BusFault, seed: int = 1, from_s: float = 0.0, duration_s: float = 2.0
) -> Outcome:
    """Run the drawer pull, by default a quick one, while the bus has these faults from an instant since power-up on."""
    options = {"duration_s": str(duration_s), "ramp_s": str(duration_s / 4)}
    robot, begin = load_robot("warehouse-scara"), AtTime(from_s, from_power_up=True)
    scenario = Scenario("bus", tuple(TriggeredFault(fault.do, begin, fault) for fault in faults), seed)
    return execute(
        plan(robot, make_job(robot, "pull-line", options)),
        "pull-line",
        kernel,
        extras=[FaultOptions(scenario=scenario)],
    )


def strikes(outcome: Outcome) -> int:
    """Return how often a run's faults have struck."""
    report = report_in(outcome.verdicts)
    assert report is not None
    return sum(fault.strikes for fault in report.faults)
