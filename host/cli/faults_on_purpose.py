"""Faults on purpose: read a scenario's file, print what answered, decide the exit code."""

from collections.abc import Mapping
from typing import TYPE_CHECKING, Annotated, Any

import typer

from steptwin.host.cli.output import fixed, print_table, say

if TYPE_CHECKING:
    from steptwin.host.robots.robot import Robot
    from steptwin.host.twin.scenarios.scenario import Scenario

Faults = Annotated[
    str | None,
    typer.Option(
        "--faults", metavar="FILE", help="Let the faults of a scenario happen: TOML with [[fault]] (docs/faults.md)."
    ),
]


def chosen_scenario(path: str | None, robot: "Robot") -> "Scenario | None":
    """Return the scenario in the file of --faults; None without one. Raises InputError for what is wrong in it."""
    if path is None:
        return None
    from steptwin.host.twin.scenarios.reading import read_scenario

    return read_scenario(path, robot)


def print_faults(document: Mapping[str, Any]) -> None:
    """Print a row for each fault, and the scenario's verdict; nothing for a run without a scenario."""
    if "scenario" not in document:
        return
    rows = [
        [
            fault["name"],
            fault["due"],
            "never" if fault["struck_s"] is None else f"{fault['struck_s']:.3f}",
            _answer(fault),
            "-" if fault["standstill_ms"] is None else f"{fault['standstill_ms']:.2f}",
            _lost(fault),
            "yes" if fault["as_documented"] else "NO",
        ]
        for fault in document["faults"]
    ]
    print_table(["fault", "due", "struck s", "answer", "stood ms", "lost steps", "as documented"], rows, text_columns=2)
    scenario = document["scenario"]
    struck = sum(fault["struck_s"] is not None for fault in document["faults"])
    verdict = "PASSED" if scenario["passed"] else "FAILED"
    say(
        f"scenario {scenario['name']}: {verdict}, {struck} of {len(rows)} faults struck, seed {scenario['seed']}",
        *(f"  {reason}" for reason in scenario["reasons"]),
    )


def _answer(fault: Mapping[str, Any]) -> str:
    """Return the codes of EMCY that answered, the first ones first; "none"."""
    return " ".join(dict.fromkeys(told["code"] for told in fault["emcys"])) or "none"


def _lost(fault: Mapping[str, Any]) -> str:
    lost = {name: joint["lost_steps"] for name, joint in fault["joints"].items() if joint["lost_steps"]}
    return " ".join(f"{name} {fixed(steps)}" for name, steps in lost.items()) or "0"
