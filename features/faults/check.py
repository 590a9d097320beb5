"""Check the file of a scenario, for `steptwin check`."""

from collections.abc import Mapping
from typing import Any, Final

from steptwin.features.faults.requests import request_of
from steptwin.features.faults.scenario import parse_scenario
from steptwin.host.cli.arguments import CheckedFile
from steptwin.host.cli.output import Columns, print_rows
from steptwin.host.common.errors import InputError
from steptwin.host.common.findings import Findings
from steptwin.host.robots import load_robot


def check_scenario(_path: str, text: str, robot_name: str | None, findings: Findings) -> CheckedFile:
    """Check a scenario for a robot; its faults name joints, switches and inputs."""
    robot = None
    with findings.collecting():
        if robot_name is None:
            raise InputError("which robot? `steptwin check FILE ROBOT`: the faults name its joints")
        robot = load_robot(robot_name)
    if robot is None:
        return CheckedFile()
    scenario = parse_scenario(text, robot, findings)
    faults = [
        {
            "name": fault.name,
            "due": str(fault.trigger),
            "do": request_of(robot, fault.fault),
            "until": None if fault.until is None else _until(fault.until),
        }
        for fault in scenario.drawn().faults
    ]
    document = {"robot": robot.name, "name": scenario.name, "seed": scenario.seed, "faults": faults}
    said = f"scenario {scenario.name}: {len(faults)} faults, seed {scenario.seed}"
    return CheckedFile(document, (lambda: print_rows(_FAULTS, faults, text_columns=4), said))


def _until(until: object) -> str:
    return f"for {until:g} s" if isinstance(until, float | int) else str(until)


def _request(request: Mapping[str, Any]) -> str:
    """Return a fault's request as text: its name, then its keys and values."""
    keys = (f"{key}={_word(value)}" for key, value in request.items() if key != "do")
    return " ".join((request["do"], *keys))


def _word(value: object) -> str:
    if isinstance(value, list):
        return ",".join(f"0x{each:X}" for each in value)
    if isinstance(value, bool):
        return str(value).lower()
    return f"{value:g}" if isinstance(value, float) else str(value)


_FAULTS: Final[Columns] = {
    "fault": "{0[name]}",
    "due": "{0[due]}",
    "does": lambda fault: _request(fault["do"]),
    "until": lambda fault: fault["until"] or "to the end",
}
