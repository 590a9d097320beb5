"""A motion of a second on the laboratory arm, in which faults happen."""

from functools import cache
from typing import Final

from steptwin.controller.motion.backend import Kernel
from steptwin.host.common.findings import Findings
from steptwin.host.faults.report import ScenarioReport
from steptwin.host.faults.scenario import Scenario, parse_scenario
from steptwin.host.planning.jobs import make_job
from steptwin.host.planning.plan import Plan
from steptwin.host.planning.planner import plan
from steptwin.host.robots import load_robot
from steptwin.host.twin.embedded.execution import execute
from steptwin.host.twin.embedded.outcome import Outcome

ROBOT: Final = load_robot("teaching-scara")


@cache
def carry() -> Plan:
    """Plan the teaching arm's `carry`, a fast motion of 1 s of all joints."""
    return plan(ROBOT, make_job(ROBOT, "carry", {}))


def scenario(text: str) -> Scenario:
    """Return the scenario of a TOML text, in which nothing is wrong."""
    findings = Findings()
    read = parse_scenario(text, ROBOT, findings)
    assert findings.messages == []
    return read


def played(
    kernel: Kernel, text: str, *, motors: bool = False, boards: tuple[int, ...] | None = None
) -> tuple[Outcome, ScenarioReport]:
    """Carry while a scenario happens, perhaps with motors that turn with the board, or on several boards."""
    crystals = [0] * len(boards or (1,))
    outcome = execute(
        carry(), "carry", kernel, scenario=scenario(text), motors=motors, axes_per_board=boards, crystal_ppm=crystals
    )
    assert outcome.scenario is not None
    return outcome, outcome.scenario
