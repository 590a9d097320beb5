"""A motion of a second on the laboratory arm, in which faults happen."""

from dataclasses import replace
from functools import cache
from typing import Final

import pytest

from steptwin.controller.motion.backend import Kernel
from steptwin.features.faults.options import FaultOptions
from steptwin.features.faults.report import ScenarioReport, report_in
from steptwin.features.faults.scenario import Scenario, parse_scenario
from steptwin.host.common.findings import Findings
from steptwin.host.planning.jobs import make_job
from steptwin.host.planning.plan import Plan
from steptwin.host.planning.planner import plan
from steptwin.host.robots import load_robot
from steptwin.host.twin.embedded.execution import execute
from steptwin.host.twin.embedded.outcome import Outcome

ROBOT: Final = load_robot("teaching-scara")


@cache
def carry(drivers: str | None = None) -> Plan:
    """Plan the teaching arm's `carry`, a fast motion of 1 s of all joints; named drivers have their faults wired."""
    robot = ROBOT
    if drivers is not None:
        board = replace(ROBOT.board, osc_pf=None, driver_profile=drivers, current_a=None, fault_wired=True)
        robot = replace(ROBOT, board=board)
    return plan(robot, make_job(robot, "carry", {}))


def scenario(text: str) -> Scenario:
    """Return the scenario of a TOML text, in which nothing is wrong."""
    findings = Findings()
    read = parse_scenario(text, ROBOT, findings)
    assert findings.messages == []
    return read


def _turning() -> list[object]:
    """Return the option of motors that turn with the board; skip the test where motors are not installed."""
    options = pytest.importorskip("steptwin.features.motors.options")
    return [options.MotorOptions(motors=True)]


def played(
    kernel: Kernel,
    text: str,
    *,
    motors: bool = False,
    boards: tuple[int, ...] | None = None,
    drivers: str | None = None,
) -> tuple[Outcome, ScenarioReport]:
    """Carry while a scenario happens, perhaps with motors that turn, on several boards, or with other drivers."""
    crystals = [0] * len(boards or (1,))
    outcome = execute(
        carry(drivers),
        "carry",
        kernel,
        extras=[FaultOptions(scenario=scenario(text)), *(_turning() if motors else ())],
        axes_per_board=boards,
        crystal_ppm=crystals,
    )
    report = report_in(outcome.verdicts)
    assert report is not None
    return outcome, report
