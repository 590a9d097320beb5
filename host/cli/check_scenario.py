"""`steptwin check faults.toml ROBOT`: what a scenario's faults are, and which reaction is documented for each."""

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from steptwin.host.cli.checked_file import CheckedFile
from steptwin.host.cli.output import print_table, say
from steptwin.host.common.errors import InputError
from steptwin.host.common.findings import Findings

if TYPE_CHECKING:
    from steptwin.host.twin.scenarios.scenario import Scenario


def check_scenario(text: str, robot_name: str | None, findings: Findings) -> CheckedFile:
    """Check a scenario for a robot, whose joints, switches and inputs its faults name."""
    from steptwin.host.robots import load_robot
    from steptwin.host.twin.control.operations import request_of
    from steptwin.host.twin.scenarios.reading import parse_scenario

    robot = None
    with findings.collecting():
        if robot_name is None:
            raise InputError("which robot? `steptwin check FILE ROBOT`: the faults name its joints")
        robot = load_robot(robot_name)
    if robot is None:
        return CheckedFile({})
    scenario = parse_scenario(text, robot, findings)
    faults = [
        {
            "name": fault.name,
            "due": str(fault.trigger),
            "do": request_of(robot, fault.harm),
            "until": None if fault.until is None else _until(fault.until),
        }
        for fault in scenario.drawn().faults
    ]
    document = {"robot": robot.name, "name": scenario.name, "seed": scenario.seed, "faults": faults}
    return CheckedFile(document, lambda: _print(scenario, faults))


def _until(until: object) -> str:
    return f"for {until:g} s" if isinstance(until, float | int) else str(until)


def _print(scenario: "Scenario", faults: list[dict[str, Any]]) -> None:
    rows = [
        [
            fault["name"],
            fault["due"],
            _request(fault["do"]),
            fault["until"] or "to the end",
        ]
        for fault in faults
    ]
    print_table(["fault", "due", "does", "until"], rows, text_columns=4)
    say(f"scenario {scenario.name}: {len(faults)} faults, seed {scenario.seed}")


def _request(request: Mapping[str, Any]) -> str:
    """Return what a fault does, then its keys with their values."""
    keys = (f"{key}={_word(value)}" for key, value in request.items() if key != "do")
    return " ".join((request["do"], *keys))


def _word(value: object) -> str:
    if isinstance(value, list):
        return ",".join(f"0x{each:X}" for each in value)
    if isinstance(value, bool):
        return str(value).lower()
    return f"{value:g}" if isinstance(value, float) else str(value)
